"""The zip of an SSP: members are read one by one under names of ours, so nothing lands where an archive says."""

import posixpath
import re
import shutil
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from math import isfinite, nan
from pathlib import Path
from typing import IO
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree

from cosim.fmi.description import first_line
from cosim.support.archive import DAMAGED, contents
from cosim.support.errors import ScenarioError
from cosim.support.files import cache_home, replacing, sha256
from cosim.support.xml_files import check_xml

MAIN = "SystemStructure.ssd"
"""The file of the system that is meant where no other is chosen."""
LARGEST = 2**30
"""Bytes of a member at most: more is a mistake or an attack."""
_OUTSIDE = (".fmu", ".ssp", ".ssd", ".ssv", ".ssm", ".ssb")
_BASE = "http://ssp-standard.org/SSP1/SystemStructure"
_SPACES = {
    "ssd": "Description",
    "ssc": "Common",
    "ssv": "ParameterValues",
    "ssm": "ParameterMapping",
    "ssb": "SignalDictionary",
}


class Archive:
    """An SSP file.

    Args:
        path: the archive.
        outside: files beside the archive may be read where a source leads there; never anything from a network.
        name: what the archive is called in messages.

    Raises:
        ScenarioError: it does not exist or is no zip archive.
    """

    def __init__(self, path: Path, outside: bool = False, name: str = "") -> None:
        self.path, self.outside, self.name = path, outside, name or str(path)
        self.base = path.parent / path.stem
        """Where the archive would lie if it were unpacked; sources that lead out of it start here."""
        if not path.exists():
            raise ScenarioError(f"{path} does not exist.", culprit=str(path))
        self.members = {posixpath.normpath(one.filename): one for one in contents(path, self.error)}

    main = MAIN
    """The file of the system that is run where no other is chosen."""

    def roots(self) -> list[str]:
        """List the SSDs at the root of the archive, each a system of its own."""
        return sorted(one for one in self.members if one.endswith(".ssd") and "/" not in one)

    def error(self, what: str, *choices: str) -> ScenarioError:
        """Make the error that says what is wrong with this archive."""
        listed = f"; there are: {', '.join(choices)}" if choices else ""
        sentence = f"{self.name} is an SSP that cannot run: {what}{listed}."
        return ScenarioError(sentence, culprit=self.name, choices=choices)

    def read(self, source: str) -> bytes:
        """Return a member, named by a relative URI."""
        beyond = self._beyond(source)
        if beyond is not None:
            return beyond.read_bytes()
        with self._opened(source) as file:
            return file.read()

    def _info(self, source: str) -> zipfile.ZipInfo:
        info = self.members[self._member(source)]
        if info.file_size > LARGEST:
            raise self.error(f'"{info.filename}" has more than {LARGEST >> 20} MiB')
        return info

    @contextmanager
    def _opened(self, source: str) -> Iterator[IO[bytes]]:
        """Open a member; what goes wrong within the block is said of it."""
        info = self._info(source)
        try:
            with zipfile.ZipFile(self.path) as archive, archive.open(info) as file:
                yield file
        except (*DAMAGED, OSError) as error:
            raise self.error(f'"{info.filename}" is damaged or encrypted: {first_line(error)}') from error

    def xml(self, source: str, tag: str) -> ElementTree.Element:
        """Read an XML member whose root is `tag`, as in `ssv:ParameterSet`."""
        content = self.read(source)
        check_xml(content, f'"{source}"', self.error)
        try:
            root = ElementTree.fromstring(content)
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
        found = {
            source: self._beyond(source) or home / f"{index}_{_plain(source)}"
            for index, source in enumerate(dict.fromkeys(sources))
        }
        for source, path in found.items():
            if path.parent != home:
                continue
            if not path.is_file() or path.stat().st_size != self._info(source).file_size:
                with replacing(path, force=True) as partial, self._opened(source) as file, partial.open("wb") as copy:
                    shutil.copyfileobj(file, copy)
        return found

    def nested(self, source: str) -> "Archive":
        """Open an SSP that lies in this one, under the same rules."""
        return Archive(self.unpacked([source])[source], self.outside, f"{self.name}, {source},")

    def _beyond(self, source: str) -> Path | None:
        """Return the file outside the archive that a source means; None where it lies inside."""
        parts = urlsplit(source)
        name = posixpath.normpath(unquote(parts.path))
        if not (parts.scheme or parts.netloc or name.startswith(("/", ".."))):
            return None
        if parts.scheme not in ("", "file") or parts.netloc:
            raise self.error(f'"{source}" lies outside the archive and is no file of this computer')
        if not self.outside:
            rule = "only what is inside is read; --outside reads files beside it too"
            raise self.error(f'"{source}" lies outside the archive, and {rule}')
        found = (self.base / name).resolve()
        if found.suffix not in _OUTSIDE or not found.is_file():
            raise self.error(
                f'"{source}" lies outside the archive, where {found} is no file of a kind that is read', *_OUTSIDE
            )
        return found

    def _name(self, source: str) -> str:
        return posixpath.normpath(unquote(urlsplit(source).path))

    def _member(self, source: str) -> str:
        name = self._name(source)
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
