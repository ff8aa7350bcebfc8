"""What stands beside numbers in a text: units and lists in cells, comments, and MATLAB's brackets.

A cell may hold a number with its unit, `12.3 deg`, or a list, `[0.1, 0.2]`, as pandas writes it.
"""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cosim.data.limits import check_cells, several, short
from cosim.data.text.unit_words import is_unit, spelled
from cosim.support.errors import RecordingError

SEPARATORS = (b";", b"\t", b",", b"|")
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
COMMA = NUMBER.replace(r"\.", ",")
MEASURED = re.compile(rf"({NUMBER}|{COMMA})[ \t]*([^\d\s+-][^,;\t|\n\d]*\d?)?")
"""A number, and behind it a unit."""
MOST = 0.8
"""Share of the lines whose cells must all be such for a table to be one of measures."""
LEAST = 5
"""Lines of measures that a table needs."""
LIST = re.compile(r"[\[(]+\s*[-+.\d][-+.\deE,;\s]*[\])]+")
BARE = re.compile(rb"(?<=[,;\t])[ \t]*(\[+[ \t]*[-+.\d][-+.\deE, \t]*\]+)")
"""A list in a cell that no quotes keep together."""
COMMENT = re.compile(rb"^[ \t]*(?:#(?!N|V|\d)|%|//)[^\n]*\n?", re.MULTILINE)
"""A line that is a comment; `#N/A` and `#NV` stand for no value, and `#3` is no comment either."""
BEHIND = re.compile(rb"^([ \t]*[+-]?\.?\d[^%#\n]*?)[ \t]+(?:%|//|#)[ \t]*[A-Za-z][^\n]*", re.MULTILINE)
"""A comment behind the numbers of a row."""
ENDS = re.compile(rb";[ \t]*(?=\r?$)", re.MULTILINE)
OPENS = re.compile(rb"^([ \t]*)[\w.]+[ \t]*=[ \t]*\[[ \t]*(?:\.\.\.)?", re.MULTILINE)
"""A matrix begins: `log = [`."""
CLOSES = re.compile(rb"\][ \t]*;?[ \t]*(?=\r?$)", re.MULTILINE)
SEPARATED = re.compile(r"\S[ \t,]+\S")
ENDED = 0.8
"""Share of the lines with digits that must end with a semicolon for it to end rows and not to part columns."""


def with_quotes(data: bytes, lines: Sequence[str]) -> bytes:
    """Return a text whose cells hold lists with quotes around these: their commas part no columns."""
    return BARE.sub(rb'"\1"', data) if any(BARE.search(line.encode()) for line in lines) else data


def without_units(path: Path, data: bytes, lines: Sequence[str]) -> tuple[bytes, tuple[str, ...]]:
    """Return a text whose cells hold numbers with units without these, and the unit of each column; else as it is.

    Raises:
        RecordingError: cells of one column have several units.
    """
    for separator in SEPARATORS:
        rows = [_cells(line, separator.decode()) for line in lines if separator.decode() in line]
        whole = [row for row in rows if row and any(text for _, text in row)]
        if len(whole) < LEAST or len(whole) < MOST * len(rows):
            continue
        columns = zip(*(row for row in whole if len(row) == len(whole[0])), strict=True)
        units = tuple(next((spelled(text) for _, text in column if text), "") for column in columns)
        return _numbers(path, data, separator, units), units
    return data, ()


def _cells(line: str, separator: str) -> list[tuple[str, str]]:
    """Return number and unit of each cell of a line; nothing if one is no measure."""
    found = [MEASURED.fullmatch(cell.strip().strip('"')) for cell in line.strip().split(separator)]
    pairs = [(one[1], (one[2] or "").strip()) for one in found if one]
    return pairs if len(pairs) == len(found) and all(not text or is_unit(text) for _, text in pairs) else []


def _numbers(path: Path, data: bytes, separator: bytes, units: tuple[str, ...]) -> bytes:
    sign = separator.decode()
    kept: list[str] = []
    for number, line in enumerate(data.decode("utf-8", "replace").split("\n"), 1):
        row = _cells(line, sign) if sign in line else []
        for k, (_, text) in enumerate(row[: len(units)]):
            if text and spelled(text) != units[k]:
                above = units[k] or "no unit"
                said = f'line {number:,} holds "{short(text)}" in column {k + 1}, which is in {above} above'
                raise RecordingError(f"{path}: {said}; a column has one unit.", culprit=str(path), value=text)
        kept.append(sign.join(one for one, _ in row) if row else line)
    return "\n".join(kept).encode()


def lists_of(path: Path, column: np.ndarray) -> list[np.ndarray]:
    """Return the columns that lists of one length make, in cells of a column of text; none of any other."""
    if column.dtype != object or not all(isinstance(text, str) and LIST.fullmatch(text.strip()) for text in column):
        return []
    rows = [re.split(r"[,;\s]+", text.strip().strip("[]() ").strip(",; ")) for text in column]
    check_cells(path, len(rows), len(rows[0]))
    if len(rows[0]) < 1 or any(len(row) != len(rows[0]) for row in rows):
        return []
    try:
        return [*np.array(rows, np.float64).T]
    except ValueError:
        return []


def without_comments(path: Path, body: bytes) -> tuple[bytes, tuple[str, ...]]:
    """Leave out lines between samples that are comments, with a note."""
    if not any(sign in body for sign in (b"#", b"%", b"//")):
        return body, ()
    lines = [found.group().decode("utf-8", "replace").strip() for found in COMMENT.finditer(body)]
    body = COMMENT.sub(b"", body)
    if not lines:
        return body, ()
    said = several(len(lines), "comment was", "comments were")
    return body, (f"{path.stem}: {said} left out between the samples, such as {short(lines[-1])!r}.",)


def without_remarks(data: bytes) -> bytes:
    """Return a text without the comments behind the numbers of its rows."""
    return BEHIND.sub(rb"\1", data) if any(sign in data for sign in (b" %", b" #", b" //", b"\t%", b"\t#")) else data


def without_brackets(data: bytes, lines: Sequence[str]) -> bytes:
    """Return a text whose rows end with a semicolon, as those of MATLAB, without it and the brackets of a matrix."""
    rows = [
        line.strip() for line in lines if any(sign.isdigit() for sign in line) and not line.lstrip().startswith("%")
    ]
    ended = [row for row in rows if row.endswith(";") and row.count(";") == 1 and SEPARATED.search(row)]
    if len(ended) < 2 or len(ended) < ENDED * len(rows):
        return data
    return ENDS.sub(b"", CLOSES.sub(b"", OPENS.sub(rb"\1", data)))
