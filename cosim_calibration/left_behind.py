"""What an FMU with other numbers must not carry: experiments whose references are what it gave with the old ones.

FMI-LS-REF lists related files in a manifest. Entries of the roles `experiment` and `result` go, and with them the files
beside the manifest that they name; all other entries stay as they are written.
"""

import zipfile
from collections.abc import Iterator
from posixpath import dirname, join, normpath
from typing import Any

from cosim.fmi.manifest import MANIFEST

OLD = ("experiment", "result")
"""Roles, up to a slash, of what depends on the numbers of the FMU."""


def left_behind(archive: zipfile.ZipFile) -> tuple[frozenset[str], bytes]:
    """Members that go, and the manifest without them; it is empty where there is none or nothing else is listed."""
    if MANIFEST not in archive.namelist():
        return frozenset(), b""
    root = _parsed(archive.read(MANIFEST))
    if root is None:
        return frozenset(), archive.read(MANIFEST)
    gone = {MANIFEST}
    for entry in list(root):
        if str(entry.get("role", "")).partition("/")[0] not in OLD:
            continue
        root.remove(entry)
        member = _member(entry)
        gone |= {member, *_named_by(archive, member)}
    gone = {one for one in gone if one.startswith(f"{dirname(MANIFEST)}/")}  # never a description or a binary
    for entry in list(root):
        if _member(entry) in gone:
            root.remove(entry)
    from lxml import etree

    text = bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8")) if len(root) else b""
    return frozenset(gone), text


def _named_by(archive: zipfile.ZipFile, member: str) -> Iterator[str]:
    """Files that an experiment has as its sources."""
    if member not in archive.namelist() or member.endswith(".csv"):
        return
    root = _parsed(archive.read(member))
    if root is not None:
        yield from (normpath(join(dirname(member), one.get("source"))) for one in root.iter() if one.get("source"))


def _member(entry: Any) -> str:
    return normpath(join(dirname(MANIFEST), str(entry.get("source", ""))))


def _parsed(text: bytes) -> Any:
    """The root of an XML text; None where it is none."""
    from lxml import etree

    try:
        return etree.fromstring(text, etree.XMLParser(resolve_entities=False, no_network=True))
    except etree.XMLSyntaxError:
        return None
