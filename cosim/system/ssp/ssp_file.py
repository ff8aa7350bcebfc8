"""Where an SSD stands: the archive, the folder inside it to which sources are relative, and the file's own definitions.

Units and enumerations count in the file that defines them (SSP 2.0, 4.3).
"""

import posixpath
from dataclasses import dataclass
from functools import cached_property
from xml.etree.ElementTree import Element

from cosim.support.errors import ScenarioError
from cosim.support.units import BASE, in_base_units
from cosim.system.ssp.archive import Archive, child, children


@dataclass(frozen=True, eq=False)
class SspFile:
    """A file of an archive: its root element, and the folder in the archive that holds it."""

    archive: Archive
    root: Element
    folder: str = ""

    @cached_property
    def units(self) -> dict[str, str]:
        """The units that the file defines, as this project knows them."""
        return units_of(self.archive, self.root, "ssd:Units")

    def path(self, source: str) -> str:
        """Return a relative source as one of the archive."""
        return posixpath.join(self.folder, source) if self.folder and "://" not in source else source

    def xml(self, source: str, tag: str) -> Element:
        """Read an XML file beside this one."""
        return self.archive.xml(self.path(source), tag)

    def error(self, what: str, *choices: str) -> ScenarioError:
        """Make the error that says what is wrong with the archive."""
        return self.archive.error(what, *choices)

    def number(self, element: Element, key: str, default: float = 0.0) -> float:
        """Read an attribute that is a finite number."""
        return self.archive.number(element, key, default)


def units_of(archive: Archive, root: Element, tag: str) -> dict[str, str]:
    """Read the definitions of units under a root; one that says nothing about itself is left as it is named."""
    found = {}
    for one in children(root, tag, "ssc:Unit"):
        name, base = one.get("name", ""), child(one, "ssc:BaseUnit")
        if base is not None:
            powers = {key: int(archive.number(base, key)) for key in BASE}
            factor, offset = archive.number(base, "factor", 1.0), archive.number(base, "offset")
            found[name] = in_base_units(name, powers, factor, offset)
    return found
