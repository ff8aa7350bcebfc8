"""FMI-LS-REF: what lies in an FMU beside the model, and what each file is for, said in one place for any importer.

Files of ours lie in `extra/org.fmi-standard.fmi-ls-ref` beside the manifest that lists them. A tool that does not know
the layered standard passes it by.
Reference: FMI Layered Standard References 1.0.0-beta.1 (1 July 2026), Modelica Association; for FMI 2.0 and 3.0.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from pyfmi_models.export.description import xml_text
from pyfmi_models.export.srmd import metadata

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
MANIFEST = "fmi-ls-manifest.xml"
_SPACE = "http://fmi-standard.org/fmi-ls-manifest"
_SAYS = {
    "fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
    "fmi-ls-version": "1.0.0-beta.1",
    "fmi-ls-description": "Layered Standard providing information on related files included in an FMU.",
}


@dataclass(frozen=True)
class Related:
    """A file of an FMU: its MIME type, where it lies from the manifest on, its role, a word on it, and its content.

    Without content it is in the archive already.
    """

    kind: str
    source: str
    role: str
    description: str
    content: bytes = b""


PAGE = Related("text/html", "../../documentation/index.html", "document", "The model: equations, numbers, limits")


def references(related: Iterable[Related]) -> dict[str, bytes]:
    """Return what an archive gets: the manifest and the files that it does not have yet, by name in the archive."""
    return listed((PAGE, *related), empty())


def empty() -> ET.Element:
    """A manifest that lists nothing."""
    ET.register_namespace("fmi-ls", _SPACE)
    return ET.Element("fmiReferences", {f"{{{_SPACE}}}{key}": one for key, one in _SAYS.items()})


def listed(related: Iterable[Related], manifest: ET.Element) -> dict[str, bytes]:
    """Return what an archive gets: its manifest with these files too, and those that have content, by name."""
    files = tuple(related)
    for one in files:
        told = {"type": one.kind, "source": one.source, "role": one.role, "description": one.description}
        ET.SubElement(manifest, "Related", told)
    content = {f"{FOLDER}/{one.source}": one.content for one in files if one.content}
    return {f"{FOLDER}/{MANIFEST}": xml_text(manifest), **content}


def identified(name: str, origin: Mapping[str, object], numbers: bytes) -> tuple[Related, ...]:
    """What an FMU says of a model that was identified, for it may go on alone, without its SSP.

    Args:
        name: of the component.
        origin: what it was identified from and how well (see `srmd`); where nothing is known, nothing is said.
        numbers: its parameters as a set of SSP; empty where it has none.
    """
    if not origin:
        return ()
    said = "What the model was identified from, and how well"
    found = [Related("application/x-srmd-meta-data", "identification.srmd", "meta-data", said, metadata(name, origin))]
    if numbers:
        kind, said = "application/x-ssp-parameter-set", "The numbers of the card"
        found.append(Related(kind, "card.ssv", "parameter", said, numbers))
    return tuple(found)
