"""FMI-LS-REF: which files an FMU brings along, and what each is for.

Reference: FMI Layered Standard References, 1.0.0-alpha.1 and 1.0.0-beta.1 (drafts, 2025 and 2026), Modelica
Association; for FMI 2.0 and 3.0.
"""

import posixpath
import zipfile
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree

from cosim.fmi.xml_member import plain, xml_in
from cosim.support.errors import FmuError

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
MANIFEST = f"{FOLDER}/fmi-ls-manifest.xml"
NAME = "org.fmi-standard.fmi-ls-ref"
VERSIONS = ("1.0.0-alpha.1", "1.0.0-beta.1")
"""Versions of the layered standard that are known here."""
_SPACE = "{http://fmi-standard.org/fmi-ls-manifest}"


@dataclass(frozen=True)
class Related:
    """A file that goes with an FMU: its MIME type, its name in the archive, role and description."""

    kind: str
    member: str
    role: str
    description: str

    @property
    def main_role(self) -> str:
        """The role without what specifies it: `experiment` of `experiment/smoke-test`."""
        return self.role.partition("/")[0]


@dataclass(frozen=True)
class Manifest:
    """What an FMU brings along: version of the layered standard, and files; those absent or elsewhere are notes."""

    version: str
    related: tuple[Related, ...]
    notes: tuple[str, ...] = ()


def manifest_of(path: Path) -> Manifest | None:
    """Read the manifest of an FMU; None where there is none.

    Raises:
        FmuError: the manifest cannot be read, or is of a version that is not known here.
    """
    with zipfile.ZipFile(path) as archive:
        names = set(archive.namelist())
    if MANIFEST not in names:
        return None
    root = xml_in(path, MANIFEST)
    version = _version(path, root)
    related, notes = [], []
    for element in (one for one in root if plain(one) == "Related"):
        source, role = element.get("source", ""), element.get("role", "")
        member = member_of(MANIFEST, source)
        if member not in names:
            where = "lies elsewhere" if urlsplit(source).scheme else "is not in the archive"
            notes.append(f'The manifest names "{source}" ({role}), which {where}.')
            continue
        kind = element.get("type", "application/octet-stream")
        related.append(Related(kind, member, role, element.get("description", "")))
    return Manifest(version, tuple(related), tuple(notes))


def member_of(base: str, source: str) -> str:
    """The name in the archive of a file that one of it names relative to itself; empty for one elsewhere."""
    if urlsplit(source).scheme or source.startswith("/"):
        return ""
    return posixpath.normpath(posixpath.join(posixpath.dirname(base), unquote(source)))


def _version(path: Path, root: ElementTree.Element) -> str:
    name, version = root.get(f"{_SPACE}fmi-ls-name", ""), root.get(f"{_SPACE}fmi-ls-version", "")
    if plain(root) != "fmiReferences" or name != NAME:
        raise FmuError(
            f'{path}: {MANIFEST} is of "{name or root.tag}" and not of {NAME}.', culprit=str(path), value=name
        )
    if version not in VERSIONS:
        text = f'{path}: {MANIFEST} is of FMI-LS-REF "{version}"; known here are: {", ".join(VERSIONS)}.'
        raise FmuError(text, culprit=str(path), value=version, choices=VERSIONS)
    return version
