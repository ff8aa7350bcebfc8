"""The zip of an SSP: members are read one by one under names of ours, so nothing lands where an archive says."""

import posixpath
import re
import zipfile
import zlib
from collections.abc import Iterator
from math import isfinite, nan
from pathlib import Path
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree

from cosim.description import first_line
from cosim.errors import ScenarioError
from cosim.files import cache_home, replacing, sha256

LARGEST = 2**30
"""Bytes of a member at most: more is a mistake or an attack."""
_BASE = "http://ssp-standard.org/SSP1/SystemStructure"
_SPACES = {"ssd": "Description", "ssc": "Common", "ssv": "ParameterValues", "ssm": "ParameterMapping"}
_DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, OSError)
"""What `zipfile` raises at a member it cannot unpack: damaged, packed in a way it does not know, or with a password."""


class Archive:
    """An SSP file.

    Raises:
        ScenarioError: it does not exist or is no zip archive.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            with zipfile.ZipFile(path) as archive:
                self.members = {posixpath.normpath(one.filename): one for one in archive.infolist()}
        except FileNotFoundError as error:
            raise ScenarioError(f"{path} does not exist.", culprit=str(path)) from error
        except _DAMAGED as error:
            raise self.error(f"it is no zip archive: {first_line(error)}") from error

    def error(self, what: str, *choices: str) -> ScenarioError:
        """Make the error that says what is wrong with this archive."""
        listed = f"; there are: {', '.join(choices)}" if choices else ""
        sentence = f"{self.path} is an SSP that cannot run: {what}{listed}."
        return ScenarioError(sentence, culprit=str(self.path), choices=choices)

    def read(self, source: str) -> bytes:
        """Return a member, named by a relative URI."""
        name = self._member(source)
        if self.members[name].file_size > LARGEST:
            raise self.error(f'"{name}" has more than {LARGEST >> 20} MiB')
        try:
            with zipfile.ZipFile(self.path) as archive:
                return archive.read(self.members[name])
        except _DAMAGED as error:
            raise self.error(f'"{name}" is damaged or encrypted: {first_line(error)}') from error

    def xml(self, source: str, tag: str) -> ElementTree.Element:
        """Read an XML member whose root is `tag`, as in `ssv:ParameterSet`."""
        try:
            root = ElementTree.fromstring(self.read(source))
        except (ElementTree.ParseError, LookupError, ValueError) as error:  # the last two: encodings that are not known
            raise self.error(f'"{source}" is not valid XML: {first_line(error)}') from error
        if root.tag != tagged(tag):
            raise self.error(f'"{source}" has the root "{root.tag}" where "{tagged(tag)}" is needed')
        return root

    def number(self, element: ElementTree.Element, key: str, default: float = 0.0) -> float:
        """Read an attribute that is a finite number."""
        text = element.get(key)
        try:
            number = default if text is None else float(text)
        except ValueError:
            number = nan
        if not isfinite(number):
            raise self.error(f'{element.tag.partition("}")[2]} {key} = "{text}" is no finite number')
        return number

    def unpacked(self, sources: list[str]) -> dict[str, Path]:
        """Put members into the user's cache, under the content of this archive, and return their paths by source."""
        home = cache_home() / "ssp" / sha256(self.path)[:16]
        found = {source: home / f"{index}_{_plain(source)}" for index, source in enumerate(dict.fromkeys(sources))}
        for source, path in found.items():
            content = self.read(source)
            if not path.is_file() or path.stat().st_size != len(content):
                with replacing(path, force=True) as partial:
                    partial.write_bytes(content)
        return found

    def _member(self, source: str) -> str:
        parts = urlsplit(source)
        name = posixpath.normpath(unquote(parts.path))
        if parts.scheme or parts.netloc or name.startswith(("/", "..")):
            raise self.error(f'"{source}" lies outside the archive, and only what is inside is read')
        if name not in self.members or self.members[name].is_dir():
            suffix = posixpath.splitext(name)[1]
            raise self.error(f'"{source}" is missing', *sorted(one for one in self.members if one.endswith(suffix)))
        return name


def _plain(source: str) -> str:
    return re.sub(r"[^\w.-]", "_", posixpath.basename(source)).lstrip(".") or "file"


def tagged(tag: str) -> str:
    """Turn `ssd:System` into the name that ElementTree gives it."""
    prefix, _, name = tag.partition(":")
    return f"{{{_BASE}{_SPACES[prefix]}}}{name}"


def children(element: ElementTree.Element, *path: str) -> Iterator[ElementTree.Element]:
    """Yield the elements at a path such as `ssd:Elements`, `ssd:Component`."""
    yield from element.iterfind("/".join(map(tagged, path)))


def child(element: ElementTree.Element, *path: str) -> ElementTree.Element | None:
    """Return the first element at a path, if there is one."""
    return next(children(element, *path), None)
