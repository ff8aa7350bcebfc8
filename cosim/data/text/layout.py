"""How a table is laid out as text: found out from its first lines, or stated.

Every pair of separator and decimal sign is tried; the one that cuts most of the lines into equally many values wins.
The first such line is the first sample; the line of words above it names the columns, and a line of units may stand
between. What is above that is a preamble.
"""

from collections import Counter
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

from cosim.data.limits import short
from cosim.data.text.fields import NOTHING, is_value, split
from cosim.data.text.header import LABEL, header_of, is_row_of_units, words_of_line
from cosim.data.text.unit_words import is_unit
from cosim.support.errors import RecordingError
from cosim.support.numbers import whole

SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "blank": " ", "bar": "|"}
DECIMALS = {"point": ".", "comma": ","}
DIALECTS = (",.", ";.", ";,", "\t.", "\t,", "|.", "|,", " .", " ,", ",,")
"""Separator and decimal sign, those that are preferred first."""
WINDOW = 6
"""Lines of which all but one are samples where the samples begin; a preamble may hold a line or two like them."""
MANY_SHORT = 0.02
"""Share of rows that lack the last column beyond which it is one that is not always written."""
SAMPLES = 50
"""Samples that tell what columns hold: whether one numbers the rows, and which grows."""
FILLED = 0.75
"""Share of the fullest column's values from which on a column tells samples: a row may hold some channels only."""
NAMED = 1.5
"""Advantage of a dialect in which a line of as many words names the columns."""


@dataclass(frozen=True)
class Layout:
    """Where the columns of a text are: `first` is the line of the first sample, counted from 0."""

    separator: str
    decimal: str
    count: int
    first: int
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    labels: tuple[str, ...] = ()
    """Units, column by column, that a line of the preamble gives: LabVIEW's Y_Unit_Label, an oscilloscope's units."""
    line: str = ""
    """The line above the samples where its names do not fit the columns."""
    sample: str = ""
    """The first row, where it stands in one line with the names."""
    torn: bool = False
    """Whether names and first row are one line that cannot be parted: the row is left out."""

    def __str__(self) -> str:
        separator = next(name for name, sign in SEPARATORS.items() if sign == self.separator)
        decimal = next(name for name, sign in DECIMALS.items() if sign == self.decimal)
        above = self.first - bool(self.names) - bool(self.units)
        parts = [f"separator {separator}, decimal {decimal}", f"{above} lines above the names" if above > 0 else ""]
        parts += ["" if self.names else "no names of columns", "a row of units" if self.units else ""]
        return ", ".join(part for part in parts if part)


def find_layout(path: Path, lines: Sequence[str], stated: Mapping[str, str]) -> Layout | None:
    """Find out how a table is laid out.

    Args:
        path: the file, for messages.
        lines: its first lines.
        stated: what `--layout` says: separator, decimal, header (line of the names from 1, 0 for none).

    Returns:
        The layout, or None if no line holds two values.

    Raises:
        RecordingError: what is stated is not known, or the text can be read in two ways.
    """
    tried = [_judged(lines, one[0], one[1], stated.get("header", "")) for one in _dialects(stated)]
    score, layout = max(tried, key=lambda one: one[0])
    if layout and not layout.names and layout.separator == "," and "header" not in stated:
        _check_decimal_commas(path, lines, layout)
    return layout if score else None


def _dialects(stated: Mapping[str, str]) -> list[str]:
    """Return the pairs of separator and decimal sign that are left by what was stated."""
    separator = _named(stated, "separator", SEPARATORS)
    decimal = _named(stated, "decimal", DECIMALS)
    left = [one for one in DIALECTS if separator in ("", one[0]) and decimal in ("", one[1])]
    return left or [separator + decimal]


def _named(stated: Mapping[str, str], key: str, choices: Mapping[str, str]) -> str:
    value = stated.get(key, "")
    sign = choices.get(value, value)
    if sign and sign not in choices.values():
        text = f'--layout {key}={value}: "{value}" is none; choices are: {", ".join(choices)}.'
        raise RecordingError(text, culprit=key, value=value, choices=tuple(choices))
    return sign


def _judged(lines: Sequence[str], separator: str, decimal: str, header: str) -> tuple[float, Layout | None]:
    """Return how well the lines fit a dialect, and the layout that they then have."""
    rows = [split(line, separator) for line in lines]
    values = [[is_value(field, decimal) for field in row] for row in rows]
    sizes = Counter(len(row) for row, found in zip(rows, values, strict=True) if len(row) > 1 and any(found))
    if not sizes:
        return 0.0, None
    count = max(sizes, key=lambda size: (sizes[size] * size, size))
    least = count
    if sizes[count + 1] > MANY_SHORT * sum(sizes.values()):  # more rows lack the last column than have it
        count += 1
    body = [index for index, row in enumerate(rows) if least <= len(row) <= count and any(values[index])]
    score = sum(sum(values[index]) ** 2 / max(1, sum(map(bool, rows[index]))) for index in body)
    first = _first(rows, values, body)
    if not header:
        first = _below_names(lines, rows, first, separator, count)
    if header == "0":
        return score, Layout(separator, decimal, count, first)
    if header:
        return score, _stated(lines, rows, Layout(separator, decimal, count, first), header)
    found = header_of(lines[:first], _samples(rows, first, count), separator, count)
    labels = () if found.units else _labels(rows[:first], count)
    layout = Layout(separator, decimal, count, first, labels=labels, **vars(found))
    return score * (NAMED if found.names else 1.0), layout


def _labels(preamble: Sequence[list[str]], count: int) -> tuple[str, ...]:
    """Return the last line of a preamble that begins with a word of units and holds one, column by column."""
    for row in reversed(preamble):
        if row and LABEL.search(row[0].lower()) and any(is_unit(field) for field in row[1:]):
            return tuple(row[1:]) if len(row) == count + 1 else ("", *row[1:])
    return ()


def _first(rows: Sequence[list[str]], values: Sequence[list[bool]], body: Sequence[int]) -> int:
    """Return the first line that has values where most lines have them, and is followed by such lines.

    Rows right above it that hold values in some of the columns only, and nothing else, are samples too.
    """
    width = min(len(values[index]) for index in body)
    often = [sum(values[index][place] for index in body) for place in range(width)]
    places = [place for place, count in enumerate(often) if count > FILLED * max(often)]
    full = {index for index in body if sum(values[index][place] for place in places) > len(places) / 2}
    written = [index for index, row in enumerate(rows) if any(row)]
    for start, index in enumerate(written):
        window = written[start : start + WINDOW]
        if index in full and sum(one in full for one in window) >= len(window) - 1:
            return _before(rows, values, {*body}, written[: start + 1])
    return min(full, default=body[0])


def _before(rows: Sequence[list[str]], values: Sequence[list[bool]], body: Set[int], written: Sequence[int]) -> int:
    """Return the first of the lines that lead without a break to the last one and hold nothing but values."""
    first = written[-1]
    for index in reversed(written[:-1]):
        fields = zip(rows[index], values[index], strict=True)
        if index not in body or any(field not in NOTHING and not found for field, found in fields):
            break
        first = index
    return first


def _below_names(lines: Sequence[str], rows: Sequence[list[str]], first: int, separator: str, count: int) -> int:
    """Return the first sample where a preamble ends with lines of as many numbers: the line of names is below them."""
    body = _samples(rows, first, count)
    if header_of(lines[:first], body, separator, count).names:
        return first
    written = [index for index in range(first, len(rows)) if any(rows[index])][:WINDOW]
    pairs = pairwise(written)
    return next((after for index, after in pairs if header_of([lines[index]], body, separator, count).names), first)


def _samples(rows: Sequence[list[str]], first: int, count: int) -> list[list[str]]:
    """Return the fields of some samples."""
    return [row for row in rows[first:] if len(row) == count][:SAMPLES]


def _stated(lines: Sequence[str], rows: Sequence[list[str]], found: Layout, header: str) -> Layout:
    """Lay out with the line of names as stated, counted from 1."""
    line = whole(header)
    if line is None or line > len(rows):
        text = f"--layout header={short(header)}: it is the line of the names, from 1 to {len(rows)}, or 0 for none."
        raise RecordingError(text, culprit="header", value=header)
    names = words_of_line(lines[line - 1], _samples(rows, found.first, found.count), found.separator, found.count)
    if not names:
        have = f'line {line}, "{short(lines[line - 1])}", does not name {found.count} columns one by one'
        text = f"--layout header={line}: {have}; with header=0 they are called #1, #2 ... in --columns."
        raise RecordingError(text, culprit="header", value=header)
    has_units = line < len(rows) and len(rows[line]) == found.count and is_row_of_units(rows[line])
    first = max(found.first, line + has_units)
    return replace(found, first=first, names=names, units=tuple(rows[line]) if has_units else ())


def _check_decimal_commas(path: Path, lines: Sequence[str], layout: Layout) -> None:
    """Refuse a table whose commas may be decimal signs or separators: its rows have twice the fields of its header."""
    if any("." in line for line in lines[layout.first : layout.first + WINDOW]):
        return  # a point is the decimal sign
    above = [split(line, ",") for line in lines[: layout.first]]
    names = next((row for row in reversed(above) if len(row) > 1 and not any(is_value(one, ".") for one in row)), [])
    if names and layout.count >= 2 * len(names) - 1 > 1:
        text = (
            f"{path} has {len(names)} names of columns and {layout.count} fields in a row: its commas are separators "
            "and decimal signs alike, which no option can part. Export it with semicolons or tabs."
        )
        raise RecordingError(text, culprit=str(path), value=layout.count)
