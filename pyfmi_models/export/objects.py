"""What compiled object files (ELF) take before they are linked: bytes of code and data, and how deep the stack goes.

Functions and data must have sections of their own (-ffunction-sections -fdata-sections) and frames must be noted
(-fstack-size-section); then the relocations are the graph of calls and uses. A call through a pointer is not seen.
"""

import struct
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import NamedTuple

_SYMTAB, _RELA, _REL = 2, 4, 9
_WRITE, _EXECUTE = 1, 4
_RETURN_ADDRESS = {62: 8}
"""Bytes that a call pushes, by machine: on x86-64 the address to return to; on ARM it is in the callee's frame."""


@dataclass(frozen=True)
class Footprint:
    """What a function and all that it reaches take, in bytes, and the names that it needs from elsewhere.

    `stack` is the deepest chain of calls, each frame at its largest; what the functions `outside` need is not in it.
    """

    stack: int
    code: int
    constants: int
    variables: int
    outside: tuple[str, ...]


def footprint(objects: list[Path], start: str) -> Footprint:
    """Measure what is reached from the function `start`.

    Raises ValueError if a function calls itself, at once or by a detour: then no chain of calls is the deepest.
    """
    graph = _Graph([_Object(path.read_bytes()) for path in objects])
    reached = graph.reached(graph.named[start])
    loaded = [graph.sections[one] for one in reached if isinstance(one, int)]
    return Footprint(
        stack=graph.depth(graph.named[start]),
        code=sum(one.size for one in loaded if one.flags & _EXECUTE),
        constants=sum(one.size for one in loaded if not one.flags & (_EXECUTE | _WRITE)),
        variables=sum(one.size for one in loaded if one.flags & _WRITE),
        outside=tuple(sorted(one for one in reached if isinstance(one, str))),
    )


class _Header(NamedTuple):
    """A section header, the same in both widths."""

    name: int
    kind: int
    flags: int
    address: int
    offset: int
    size: int
    link: int
    info: int


class _Symbol(NamedTuple):
    name: str
    is_global: bool
    section: int


@dataclass
class _Section:
    """A function or a piece of data; `uses` are places of sections and, of what lies elsewhere, names."""

    name: str
    flags: int
    size: int
    frame: int = 0
    uses: set[int | str] = field(default_factory=set)


class _Object:
    """One file: its sections by index, its symbols."""

    def __init__(self, content: bytes) -> None:
        self.content, self.wide = content, content[4] == 2
        self.machine = struct.unpack_from("<H", content, 18)[0]
        self.headers = self._headers()
        self.symbols = self._symbols()
        names = self.headers[struct.unpack_from("<H", content, 62 if self.wide else 50)[0]]
        self.sections = [_Section(self._text(names, one.name), one.flags, one.size) for one in self.headers]
        for header, section in zip(self.headers, self.sections, strict=True):
            if section.name == ".stack_sizes":
                self.sections[header.link].frame = _leb128(self._bytes(header)[8 if self.wide else 4 :])
            if header.kind in (_REL, _RELA):
                self.sections[header.info].uses |= self._uses(header)

    def _headers(self) -> list[_Header]:
        layout = "<2I4Q2I" if self.wide else "<8I"
        start = struct.unpack_from("<Q" if self.wide else "<I", self.content, 40 if self.wide else 32)[0]
        size, count = struct.unpack_from("<2H", self.content, 58 if self.wide else 46)
        return [_Header(*struct.unpack_from(layout, self.content, start + i * size)) for i in range(count)]

    def _bytes(self, header: _Header) -> bytes:
        return self.content[header.offset : header.offset + header.size]

    def _text(self, strings: _Header, at: int) -> str:
        return self._bytes(strings)[at:].partition(b"\0")[0].decode()

    def _symbols(self) -> list[_Symbol]:
        table = next(one for one in self.headers if one.kind == _SYMTAB)
        strings = self.headers[table.link]
        rows = struct.iter_unpack("<IBxH16x" if self.wide else "<I8xBxH", self._bytes(table))
        return [_Symbol(self._text(strings, name), info >> 4 != 0, section) for name, info, section in rows]

    def _uses(self, header: _Header) -> set[int | str]:
        word = "Q" if self.wide else "I"
        rows = struct.iter_unpack(f"<{word * (3 if header.kind == _RELA else 2)}", self._bytes(header))
        symbols = [self.symbols[row[1] >> (32 if self.wide else 8)] for row in rows]
        return {one.section or one.name for one in symbols}


class _Graph:
    """The sections of all files in one list; `named` are the places of global names."""

    def __init__(self, objects: list[_Object]) -> None:
        self.sections: list[_Section] = []
        self.named: dict[str, int] = {}
        for one in objects:
            first = len(self.sections)
            self.sections += one.sections
            for section in one.sections:
                section.uses = {use if isinstance(use, str) else first + use for use in section.uses}
            self.named |= {s.name: first + s.section for s in one.symbols if s.is_global and s.section}
        self.pushed = _RETURN_ADDRESS.get(objects[0].machine, 0)

    def following(self, place: int) -> set[int | str]:
        """What a section refers to; names stay where no file defines them."""
        return {self.named.get(one, one) if isinstance(one, str) else one for one in self.sections[place].uses}

    def reached(self, start: int) -> set[int | str]:
        """Everything that is needed, the start included."""
        found: set[int | str] = set()
        waiting: list[int | str] = [start]
        while waiting:
            one = waiting.pop()
            if one not in found:
                found.add(one)
                waiting += self.following(one) if isinstance(one, int) else ()
        return found

    def depth(self, start: int) -> int:
        """Bytes of the deepest chain of calls."""
        under_way: list[int] = []

        @cache
        def below(place: int) -> int:
            if place in under_way:
                raise ValueError(f"{self.sections[place].name} calls itself, so no depth of the stack can be stated")
            under_way.append(place)
            called = [one for one in self.following(place) if isinstance(one, int) and self.is_code(one)]
            deepest = max(map(below, called), default=0)
            under_way.pop()
            return self.sections[place].frame + self.pushed + deepest

        return below(start)

    def is_code(self, place: int) -> bool:
        """Tell a function from data."""
        return bool(self.sections[place].flags & _EXECUTE)


def _leb128(content: bytes) -> int:
    """Read a number in groups of seven bits, the lowest first."""
    value = 0
    for place, byte in enumerate(content):
        value |= (byte & 127) << 7 * place
        if byte < 128:
            break
    return value
