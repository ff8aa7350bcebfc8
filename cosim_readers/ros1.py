"""Bags of ROS 1, format 2.0: every message by the definition that the bag itself holds.

A bag is a chain of records, each a header of fields and data; messages lie in chunks, plain or packed by bz2 or lz4.
Connections name topic, type and definition. Sources: wiki.ros.org/Bags/Format/2.0 and wiki.ros.org/msg.
"""

import bz2
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from cosim.data.columns import Columns
from cosim.data.limits import check_text, check_time, check_unpacked, short
from cosim.support.errors import RecordingError
from cosim_readers.messages import Message, columns_of

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, CHUNK, CONNECTION = 2, 5, 7
"""Kinds of records, the field `op`, that are read."""
DEEPEST = 30
"""Messages inside messages; a type that holds itself has no end."""
LINE = "=" * 80
NUMBERS = {
    "bool": "u1", "int8": "i1", "uint8": "u1", "byte": "i1", "char": "u1", "int16": "<i2", "uint16": "<u2",
    "int32": "<i4", "uint32": "<u4", "int64": "<i8", "uint64": "<u8", "float32": "<f4", "float64": "<f8",
}  # fmt: skip
"""Types of one number, as NumPy calls them."""
Fields = Mapping[bytes, bytes]


@dataclass(frozen=True)
class Member:
    """One field of a message: its type, its name, and how many there are: None for one, -1 for a stated number."""

    kind: str
    name: str
    count: int | None = None


@dataclass
class Cursor:
    """Where in the bytes of a message reading is."""

    data: bytes
    place: int = 0

    def take(self, size: int) -> bytes:
        """Return the next bytes (ValueError: there are not as many)."""
        if not 0 <= size <= len(self.data) - self.place:
            raise ValueError(f"a message ends {size - len(self.data) + self.place:,} bytes too early")
        self.place += size
        return self.data[self.place - size : self.place]

    def length(self) -> int:
        """Return a length of 32 bits."""
        return int.from_bytes(self.take(4), "little")


@dataclass
class Connection:
    """A topic, its type, and the members of each type in its definition."""

    topic: str
    kind: str
    types: dict[str, list[Member]] = field(default_factory=dict)


def read(path: Path) -> Columns:
    """Read the topic of a bag that tells of an axis."""
    check_text(path, path.stat().st_size)
    data = path.read_bytes()
    if not data.startswith(MAGIC):
        text = f"{path} is no bag of ROS 1 of format 2.0: it begins with {short(repr(data[:16]))}"
        raise RecordingError(
            f"{text}; rosbag fix or rosbag reindex mends an older or unfinished one.", culprit=str(path)
        )
    whole = _whole(data[len(MAGIC) :])
    torn = f"{path.stem}: its last record was left out, as it is torn; the messages before it were read."
    columns = columns_of(path, _messages(path, whole), "ROS 1")
    return replace(columns, notes=(*columns.notes, torn)) if len(whole) < len(data) - len(MAGIC) else columns


def _whole(data: bytes) -> bytes:
    """Return the records that are there to their end: a recorder that was killed leaves a part of one."""
    place = 0
    while place < len(data):
        end = place
        for _ in range(2):
            end += 4 + int.from_bytes(data[end : end + 4].ljust(4, b"\xff"), "little")
        if end > len(data):
            break
        place = end
    return data[:place]


def _messages(path: Path, data: bytes) -> Iterator[Message]:
    known: dict[bytes, Connection] = {}
    unpacked = 0
    for fields, body in _records(data):
        if _kind(fields) != CHUNK:
            yield from _message(known, fields, body)
            continue
        unpacked += int.from_bytes(fields.get(b"size", b""), "little")
        check_unpacked(path, unpacked)
        check_time(path)
        for inner, content in _records(_plain(fields, body)):
            yield from _message(known, inner, content)


def _message(known: dict[bytes, Connection], fields: Fields, body: bytes) -> Iterator[Message]:
    """Learn a connection, or decode a message of one."""
    kind, key = _kind(fields), fields.get(b"conn", b"")
    if kind == CONNECTION and key not in known:
        told = _fields(body)
        name = told.get(b"type", b"").decode("utf-8", "replace")
        types = _types(name, told.get(b"message_definition", b"").decode("utf-8", "replace"))
        known[key] = Connection(fields.get(b"topic", b"").decode("utf-8", "replace"), name, types)
    if kind == MESSAGE and key in known:
        one = known[key]
        seconds, nanos = struct.unpack("<II", fields[b"time"])
        decode = partial(_decoded, Cursor(body), one.types, one.kind, 0)
        yield Message(one.topic, one.kind, seconds * 10**9 + nanos, len(body), decode)


def _records(data: bytes) -> Iterator[tuple[Fields, bytes]]:
    cursor = Cursor(data)
    while cursor.place < len(data):
        header = cursor.take(cursor.length())
        yield _fields(header), cursor.take(cursor.length())


def _fields(header: bytes) -> Fields:
    cursor, found = Cursor(header), {}
    while cursor.place < len(header):
        name, _, value = cursor.take(cursor.length()).partition(b"=")
        found[name] = value
    return found


def _kind(fields: Fields) -> int:
    return int.from_bytes(fields.get(b"op", b""), "little")


def _plain(fields: Fields, body: bytes) -> bytes:
    """Return a chunk unpacked, of the size that it claims."""
    packing = fields.get(b"compression", b"none").decode("ascii", "replace")
    size = int.from_bytes(fields.get(b"size", b""), "little")
    if packing == "none":
        return body
    if packing == "bz2":
        return bz2.BZ2Decompressor().decompress(body, max_length=size)
    if packing == "lz4":
        import pyarrow as pa

        return bytes(pa.Codec("lz4").decompress(body, decompressed_size=size))
    raise ValueError(f"a chunk is packed by {short(packing)}, which is not known")


def _types(name: str, definition: str) -> dict[str, list[Member]]:
    """Return the members of a type and of those that it uses, by full name."""
    parts = definition.split(f"\n{LINE}\n")
    types = {name: _members(name, parts[0])}
    for part in parts[1:]:
        head, _, body = part.partition("\n")
        inner = head.removeprefix("MSG:").strip()
        types[inner] = _members(inner, body)
    return types


def _members(owner: str, text: str) -> list[Member]:
    """Parse `float64[] position`, `Header header`; constants and comments are no members."""
    members = []
    for line in text.splitlines():
        words = line.partition("#")[0].split()
        if len(words) != 2 or "=" in words[1]:
            continue
        kind, bracket, count = words[0].partition("[")
        number = None if not bracket else int(count.rstrip("]") or -1)
        members.append(Member(_full(owner, kind), words[1], number))
    return members


def _full(owner: str, kind: str) -> str:
    """Return the full name of a type that is named within the package of its owner."""
    if kind in NUMBERS or kind in ("string", "time", "duration") or "/" in kind:
        return kind
    return "std_msgs/Header" if kind == "Header" else f"{owner.rpartition('/')[0]}/{kind}"


def _decoded(cursor: Cursor, types: Mapping[str, list[Member]], kind: str, depth: int) -> Any:
    if depth > DEEPEST:
        raise ValueError(f"the type {short(kind)} holds itself")
    if kind not in types:
        raise ValueError(f"the type {short(kind)} is not defined")
    values = {one.name: _value(cursor, types, one, depth) for one in types[kind]}
    return SimpleNamespace(**values)


def _value(cursor: Cursor, types: Mapping[str, list[Member]], member: Member, depth: int) -> Any:
    if member.count is None:
        return _one(cursor, types, member.kind, depth)
    count = cursor.length() if member.count < 0 else member.count
    if kind := NUMBERS.get(member.kind):
        return np.frombuffer(cursor.take(count * np.dtype(kind).itemsize), kind)
    if count > len(cursor.data) - cursor.place:
        raise ValueError(f"a message claims {count:,} values of {short(member.kind)}, more than its bytes")
    return [_one(cursor, types, member.kind, depth) for _ in range(count)]


def _one(cursor: Cursor, types: Mapping[str, list[Member]], kind: str, depth: int) -> Any:
    if number := _READERS.get(kind):
        return number(cursor)
    return _decoded(cursor, types, kind, depth + 1)


def _time(cursor: Cursor) -> SimpleNamespace:
    """Return a stamp or duration with the fields that ROS 2 has."""
    seconds, nanos = struct.unpack("<iI", cursor.take(8))
    return SimpleNamespace(sec=seconds, nanosec=nanos)


def _text(cursor: Cursor) -> str:
    return cursor.take(cursor.length()).decode("utf-8", "replace")


def _number(kind: str) -> Callable[[Cursor], Any]:
    size = np.dtype(kind).itemsize
    return lambda cursor: np.frombuffer(cursor.take(size), kind)[0].item()


_READERS: dict[str, Callable[[Cursor], Any]] = {
    **{name: _number(kind) for name, kind in NUMBERS.items()},
    "string": _text,
    "time": _time,
    "duration": _time,
}
