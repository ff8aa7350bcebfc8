"""Ways to spoil bytes, text, XML, JSON and archives; each takes the dice and says in a word what it did."""

import io
import json
import re
import struct
import zipfile
from collections.abc import Callable
from random import Random
from typing import Any

Spoil = Callable[[Random, bytes], tuple[str, bytes]]

NUMBERS = (
    "0", "-1", "1e308", "-1e308", "1e-308", "5e-324", "1e400", "nan", "inf", "-inf", "9223372036854775807",
    "9223372036854775808", "18446744073709551616", "-9223372036854775809", "4294967296", "2147483648", "1e30", "1e14",
    "0x10", "1_000", "1,5", "1e", "--1", "", "+", "9" * 5000, "1." + "0" * 400, "true", "0.1", "1e-9", "3.0000000001",
)  # fmt: skip
"""What a number is replaced by."""
WORDS = (
    "", " ", "\x00", "\n", "../../etc/passwd", "/etc/passwd", "C:\\x", "𝔘𝔫𝔦", "\ufeff", "\u202e", "a" * 5000, "'", '"',
    "]]>", "<!--", "&x;", "%n%s", "{", "}", "None", "t", "tau", "[" * 2000, "\udcff", "é", "=", "#",
)  # fmt: skip
"""What a word is replaced by."""
VALUES: tuple[Any, ...] = (
    None, True, 0, -1, 1.5, 10**30, 1e308, float("nan"), "", "x" * 5000, [], {}, [[]], {"": None}, [None] * 1000,
    "/etc/passwd", "../x", {"a": {"b": {"c": []}}},
)  # fmt: skip
"""What a node of JSON is replaced by."""
NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
WORD = re.compile(rb"[A-Za-z_][A-Za-z_0-9.]*")
TAG = re.compile(rb"<[^<>]*>")
ATTRIBUTE = re.compile(rb'([\w:]+)="([^"]*)"')


def span(dice: Random, raw: bytes, most: int = 64) -> tuple[int, int]:
    """Draw where a piece begins and ends."""
    first = dice.randrange(len(raw) + 1)
    return first, min(len(raw), first + dice.randint(1, most))


def flipped(dice: Random, raw: bytes) -> bytes:
    """Turn one bit over."""
    at = dice.randrange(max(len(raw), 1))
    return raw[:at] + bytes([raw[at] ^ 1 << dice.randrange(8)]) + raw[at + 1 :] if raw else raw


def overwritten(dice: Random, raw: bytes) -> bytes:
    """Put extreme or random bytes over some."""
    first, end = span(dice, raw, 16)
    size = end - first
    return raw[:first] + dice.choice((bytes(size), b"\xff" * size, dice.randbytes(size))) + raw[end:]


def removed(dice: Random, raw: bytes) -> bytes:
    """Cut a piece out."""
    first, end = span(dice, raw, 256)
    return raw[:first] + raw[end:]


def doubled(dice: Random, raw: bytes) -> bytes:
    """Say a piece twice."""
    first, end = span(dice, raw, 1024)
    return raw[:end] + raw[first:end] + raw[end:]


def inserted(dice: Random, raw: bytes) -> bytes:
    """Put random bytes between."""
    first, end = span(dice, raw)
    return raw[:first] + dice.randbytes(end - first) + raw[first:]


def truncated(dice: Random, raw: bytes) -> bytes:
    """Cut the end off."""
    return raw[: dice.randrange(len(raw) + 1)]


def swapped(dice: Random, raw: bytes) -> bytes:
    """Exchange two pieces that follow each other."""
    first, end = span(dice, raw, 512)
    middle = (first + end) // 2
    return raw[:first] + raw[middle:end] + raw[first:middle] + raw[end:]


BYTES = (flipped, overwritten, removed, doubled, inserted, truncated, swapped)


def of_bytes(dice: Random, raw: bytes) -> tuple[str, bytes]:
    """Spoil bytes, whatever they mean."""
    way = dice.choice(BYTES)
    return way.__name__, way(dice, raw)


def replaced(dice: Random, raw: bytes, pattern: re.Pattern[bytes], others: tuple[str, ...]) -> bytes:
    """Put another text in the place of one that a pattern finds."""
    found = list(pattern.finditer(raw))
    if not found:
        return truncated(dice, raw)
    one = dice.choice(found)
    return raw[: one.start()] + dice.choice(others).encode("utf-8", "surrogateescape") + raw[one.end() :]


def lines_changed(dice: Random, raw: bytes) -> bytes:
    """Remove, double, exchange or join lines."""
    lines = raw.splitlines(keepends=True) or [b""]
    first, other = dice.randrange(len(lines)), dice.randrange(len(lines))
    way = dice.randrange(4)
    if way == 0:
        del lines[first]
    elif way == 1:
        lines.insert(other, lines[first])
    elif way == 2:
        lines[first], lines[other] = lines[other], lines[first]
    else:
        lines[first] = lines[first].rstrip(b"\r\n")
    return b"".join(lines)


def of_text(dice: Random, raw: bytes) -> tuple[str, bytes]:
    """Spoil text: numbers, words, lines, or bytes."""
    way = dice.randrange(5)
    if way < 2:
        return "number", replaced(dice, raw, NUMBER, NUMBERS)
    if way == 2:
        return "word", replaced(dice, raw, WORD, WORDS)
    if way == 3:
        return "lines", lines_changed(dice, raw)
    return of_bytes(dice, raw)


def of_xml(dice: Random, raw: bytes) -> tuple[str, bytes]:
    """Spoil XML: an attribute's value or the attribute, a tag, or as text."""
    attributes, tags = list(ATTRIBUTE.finditer(raw)), list(TAG.finditer(raw))
    way = dice.randrange(5)
    if way < 2 and attributes:
        one = dice.choice(attributes)
        value = dice.choice(NUMBERS + WORDS).encode("utf-8", "surrogateescape")
        return "attribute", raw[: one.start(2)] + value + raw[one.end(2) :]
    if way == 2 and attributes:
        one = dice.choice(attributes)
        return "no attribute", raw[: one.start()] + raw[one.end() :]
    if way == 3 and tags:
        one, other = dice.choice(tags), dice.choice(tags)
        return "tag", raw[: one.start()] + dice.choice((b"", other[0], one[0] * 2)) + raw[one.end() :]
    return of_text(dice, raw)


def of_json(dice: Random, raw: bytes) -> tuple[str, bytes]:
    """Spoil JSON: a node becomes something else or goes; or spoil it as text."""
    if dice.random() < 0.2:
        return of_text(dice, raw)
    tree = json.loads(raw)
    places = list(nodes(tree))
    if not places:
        return "value", json.dumps(dice.choice(VALUES)).encode()
    parent, key = dice.choice(places)
    if dice.random() < 0.3:
        del parent[key]
        return "no value", json.dumps(tree).encode()
    parent[key] = dice.choice(VALUES)
    return "value", json.dumps(tree).encode()


def nodes(tree: Any) -> "list[tuple[Any, Any]]":
    """All values of a tree, each as what holds it and where."""
    keys = list(tree) if isinstance(tree, dict) else list(range(len(tree))) if isinstance(tree, list) else []
    return [(tree, key) for key in keys] + [one for key in keys for one in nodes(tree[key])]


def of_member(pattern: str, spoil: Spoil) -> Spoil:
    """Spoil one member of an archive, and pack it well."""

    def spoilt(dice: Random, raw: bytes) -> tuple[str, bytes]:
        out, made = io.BytesIO(), ""
        with zipfile.ZipFile(io.BytesIO(raw)) as given, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as packed:
            chosen = dice.choice([name for name in given.namelist() if re.search(pattern, name)])
            for name in given.namelist():
                content = given.read(name)
                if name == chosen:
                    made, content = spoil(dice, content)
                packed.writestr(name, content)
        return made, out.getvalue()

    return spoilt


def of_archive(dice: Random, raw: bytes) -> tuple[str, bytes]:
    """Spoil an archive itself: its directory, its members' names, or its bytes."""
    way = dice.randrange(4)
    if way == 0:  # a field of a member's entry in the directory: versions, flags, packing, times, CRC, sizes, lengths
        at = raw.rfind(b"PK\x01\x02", 0, dice.randrange(len(raw) // 2, len(raw)))
        place = max(at, 0) + dice.randrange(6, 44, 2)
        return "directory", raw[:place] + struct.pack("<H", dice.randrange(65536)) + raw[place + 2 :]
    if way == 1:
        return "member", renamed(dice, raw)
    return of_bytes(dice, raw)


def renamed(dice: Random, raw: bytes) -> bytes:
    """Give a member another name, or leave it out, or put it in twice."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(raw)) as given, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as packed:
        chosen = dice.choice(given.namelist())
        word = dice.choice([one for one in WORDS if one and "\x00" not in one and "\udcff" not in one])
        for name in given.namelist():
            if name != chosen:
                packed.writestr(name, given.read(name))
            elif dice.random() < 0.7:
                packed.writestr(dice.choice((word, f"{name}{word}", f"{word}/{name}", name.upper())), given.read(name))
    return out.getvalue()
