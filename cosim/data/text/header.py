"""What the lines above the samples of a table say: the names of its columns, and their units.

The lowest line of as many words as there are columns names them; a line of units may stand below it or above, a line
of types (`REAL`) or of groups (`axis 1`, one for several columns) too. Names need not be parted as the samples are:
tabs, two blanks or brackets part names that have blanks in them. A line that does not fit is no line of names: what
it says is kept for a question.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from cosim.data.roles import is_named
from cosim.data.text.fields import is_value, split
from cosim.data.text.unit_words import is_unit

REMARKS = "Comment"
"""Name of a last column that LabVIEW writes where no row has a comment."""
COMMENTS = ("#", "%", "//", "!")
NO_UNIT = ("", "-", "--", "1", "none", "n/a", "[-]")
"""What stands in a row of units for a column without one."""
CLOCK_FORMAT = re.compile(r"(?:[hHmMsSdDyYfF]+[:./ -])+[hHmMsSdDyYfF]+")
"""How a row of units says what a time stamp looks like: hh:mm:ss."""
ENCLOSED = re.compile(r"\s*[\[(].*[\])]\s*")
TYPES = frozenset(
    (
        *("float", "double", "real", "lreal", "int", "dint", "uint", "udint", "bool", "string", "number", "datetime"),
        *(f"{kind}{bits}" for kind in ("float", "int", "uint") for bits in (8, 16, 32, 64)),
    )
)
"""Words of a line that says what kind of number each column holds."""
LABEL = re.compile(r"^(y_|vertical )?units?(_label)?\b|^einheit(en)?\b")
"""A line of a preamble that gives units, column by column."""
LINES = 6
"""Lines above the samples in which names and units are looked for."""
BLANKS = re.compile(r"\s{2,}|\t")
BEHIND = re.compile(r"\s*([^\[\]()]+?[\[(][^\[\]()]*[\])])[\s,;]*")
"""A name with its unit in brackets, by which names are parted that have blanks in them."""
FUSED = re.compile(r"(.*?[^\d.+-])[+-]?[\d.].*")
"""The last name and the first value, where no sign stands between them."""


@dataclass(frozen=True)
class Header:
    """Names and units of columns; `line` is what stands above the samples where its names do not fit them.

    `sample` is the first row where names and first row are one line; `torn` says that it could not be parted.
    """

    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    line: str = ""
    sample: str = ""
    torn: bool = False


def header_of(above: Sequence[str], body: Sequence[Sequence[str]], separator: str, count: int) -> Header:
    """Read the lines above the samples of a table.

    Args:
        above: all lines above the first sample.
        body: the fields of some samples, which tell a column of row numbers without a name.
        separator: sign between the fields of a sample.
        count: how many fields a sample has.
    """
    written = [line for line in above if any(sign.isalnum() for sign in line)][-LINES:]
    lines = [words_of_line(line, body, separator, count) or _headings(line, separator, count) for line in written]
    fitting: list[tuple[str, ...]] = []
    for words in reversed(lines):
        if words and LABEL.search(words[0].lower()):
            continue
        if not words or (not fitting and not _are_names(words, body)):
            break
        fitting.append(words)
    if fitting:
        return _chosen(fitting)
    return _one_line(written[-1], separator, count) if written else Header()


def _chosen(fitting: Sequence[tuple[str, ...]]) -> Header:
    """Choose names and units from the lines of as many words as there are columns, the lowest first."""
    units = next((words for words in fitting[:2] if is_row_of_units(words)), ())
    rest = [words for words in fitting if words is not units and not all(word.lower() in TYPES for word in words)]
    if not units and len(rest) > 1 and _may_be_units(rest[0], rest[1]):
        units, rest = rest[0], rest[1:]
    if not rest:
        return Header(units or fitting[0], units)
    place = 1 if len(rest) > 1 and _says_more(rest[1], rest[0]) else 0
    if len(rest) == place + 1:
        return Header(rest[place], units)
    groups = rest[place + 1]
    timed = [is_unit(name) and is_named(group, "time") for name, group in zip(rest[place], groups, strict=True)]
    names = tuple(
        group if is_time else name
        for name, group, is_time in zip(_grouped(rest[place], groups), groups, timed, strict=True)
    )
    alone = tuple(name if is_time else "" for name, is_time in zip(rest[place], timed, strict=True))
    return Header(names, units or (alone if any(timed) else ()))


def _says_more(upper: Sequence[str], lower: Sequence[str]) -> bool:
    """Whether the upper of two lines names more columns by what they are, or the lower names all of them alike."""
    told = [sum(map(is_named, words)) for words in (upper, lower)]
    return len(set(upper)) == len(upper) and (told[0] > told[1] or len(set(lower)) == 1)


def _may_be_units(lower: Sequence[str], upper: Sequence[str]) -> bool:
    """Whether the lower of two lines is one of units of which some are not known."""
    fields = [field for field in lower if field.strip("[]() ").lower() not in NO_UNIT]
    known = sum(is_unit(field.strip("[]() ")) for field in fields)
    enclosed = all(map(ENCLOSED.fullmatch, fields))
    return bool(fields) and not is_row_of_units(upper) and (enclosed or 2 * known >= len(fields))


def _grouped(names: tuple[str, ...], groups: Sequence[str]) -> tuple[str, ...]:
    """Put the name of its group in front of each name that stands in the line more than once."""
    often, filled, last = Counter(names), [], ""
    for group in groups:
        last = group or last
        filled.append(last)
    whole = tuple(
        f"{group}.{name}" if name and group and often[name] > 1 else name
        for name, group in zip(names, filled, strict=True)
    )
    return whole if len(set(whole)) > len(set(names)) else names


def words_of_line(line: str, body: Sequence[Sequence[str]], separator: str, count: int) -> tuple[str, ...]:
    """Return the fields of a line that may name `count` columns; a sign of a comment before them is taken off."""
    sign = next((sign for sign in COMMENTS if line.lstrip().startswith(sign)), "")
    bare = line.strip().lstrip(sign[0]) if sign else line
    for fields in _parted(bare, separator, count):
        if len(fields) == count + 1 and fields[-1] == REMARKS:
            fields = fields[:-1]
        while len(fields) > count and not fields[-1]:
            fields = fields[:-1]
        if len(fields) == count - 1:
            fields = _aligned(fields, body)
        if len(fields) == count and not any(is_value(field, ".") for field in fields) and _are_names(fields, body):
            return tuple(fields)
    return ()


def _are_names(fields: Sequence[str], body: Sequence[Sequence[str]]) -> bool:
    """Whether half of the fields at least hold something, of those above columns that do."""
    above = [any(len(row) > place and row[place] for row in body) for place in range(len(fields))]
    told = [bool(field) for field, has in zip(fields, above, strict=True) if has or not any(above)]
    return sum(told) * 2 >= len(told)


def _headings(line: str, separator: str, count: int) -> tuple[str, ...]:
    """Return the fields of a line that heads groups of columns, the name of a group above its first column."""
    fields = split(line, separator)
    fits = len(fields) == count and sum(map(bool, fields)) > 1 and not any(is_value(field, ".") for field in fields)
    return tuple(fields) if fits else ()


def _parted(line: str, separator: str, count: int) -> list[list[str]]:
    """Return the ways to part a line into names, the one of the samples first."""
    ways = [split(line, separator)]
    ways += [split(line, other) for other in ("\t", ";", ",", "|") if other != separator and other in line]
    ways += [BLANKS.split(line.strip()), BEHIND.findall(line) if BEHIND.sub("", line) == "" else []]
    ways += [line.split()] if separator != " " else []
    return [ways[0], *(way for way in ways[1:] if len(way) == count and all(way))]


def _aligned(fields: list[str], body: Sequence[Sequence[str]]) -> list[str]:
    """Give the column without a name its place where names are one less than columns; nothing where it has none.

    It is the last where that is empty in every sample, and the first where that numbers the rows and the name of the
    time, if any, stands above a column that grows.
    """
    if all(not row[-1] for row in body if len(row) > len(fields)):
        return [*fields, ""]
    times = [place for place, name in enumerate(fields) if is_named(name, "time")]
    shifted = all(_grows(body, place + 1) for place in times)
    above_numbers = any(place == 0 for place in times) and not _grows(body, 1)
    return ["", *fields] if _numbers_rows(body) and shifted and not above_numbers else []


def _numbers_rows(body: Sequence[Sequence[str]]) -> bool:
    numbers = [row[0].strip('"') for row in body if row]
    counted = [int(text) for text in numbers if text.isdigit() and len(text) < 18]
    return len(counted) == len(numbers) > 1 and all(b - a == 1 for a, b in pairwise(counted))


def _grows(body: Sequence[Sequence[str]], place: int) -> bool:
    texts = [row[place].replace(",", ".") for row in body if len(row) > place]
    values = [float(text) for text in texts if is_value(text, ".") and ":" not in text and text[:1].isdigit()]
    return len(values) == len(texts) > 1 and all(b > a for a, b in pairwise(values))


def _one_line(line: str, separator: str, count: int) -> Header:
    """Read a line that does not fit: names and first sample in one, or names that are more or fewer than columns."""
    fields = split(line, separator)
    words = [not is_value(field, ".") for field in fields]
    joined = all(words[:count]) and not any(words[count:])
    if joined and len(fields) == 2 * count:
        sign = "\t" if separator == " " else separator
        return Header(tuple(fields[:count]), sample=sign.join(fields[count:]))
    if joined and len(fields) == 2 * count - 1 and (last := FUSED.fullmatch(fields[count - 1])):
        return Header((*fields[: count - 1], last[1]), torn=True)
    return Header(line=line.strip()) if sum(words) > 1 else Header()


def is_row_of_units(fields: Sequence[str]) -> bool:
    """Whether every field is a unit or says that there is none, and one is a unit."""
    bare = [field.strip("[]() ") for field in fields]
    bare = ["" if CLOCK_FORMAT.fullmatch(field) else field for field in bare]
    return any(map(is_unit, bare)) and all(field.lower() in NO_UNIT or is_unit(field) for field in bare)
