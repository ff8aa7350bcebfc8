"""The rows of one recording: what a file holds on one time base, and of many recordings the one that is named.

`many.parquet:run=3` names it by a column, `many.csv:#3` by its number.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cosim.data.assign import assign
from cosim.data.columns import Columns, Request
from cosim.data.joining import on_one_time
from cosim.data.limits import listed, short
from cosim.data.order import in_order
from cosim.data.questions import EMPTY, PERIOD, REPEATED
from cosim.data.runs import equal, split, starts, text_of
from cosim.data.sparse import filled, without_empty
from cosim.data.times import clock_of
from cosim.support.errors import RecordingError
from cosim.support.numbers import whole
from cosim.support.units import unit

MANY = 1000
"""Values of a column beyond which it is a measurement, and no name of a recording."""
SPACED = re.compile(r"([\d.]+(?:[eE][+-]?\d+)?)\s*(s|ms|us|ns)?")
"""How far apart rows without a time are."""


def rows_of_one(request: Request, found: Columns) -> Columns:
    """Return what a file holds as a table with one row for each time, and of many recordings the one that is named.

    Raises:
        RecordingError: as `on_one_time` and `one_run`; or a period is none, or rows are missing.
    """
    rows = timed(request, found)
    one = one_run(request, rows)
    return rows if one is rows else _full(request, one)


def timed(request: Request, found: Columns) -> Columns:
    """Return all rows of a table or file, as `rows_of_one` does of one recording of it."""
    _check_layout(request.layout)
    return in_order(request, _full(request, _with_time(on_one_time(request, found), request.layout)))


def _full(request: Request, found: Columns) -> Columns:
    """Return a table whose rows have what is needed, as far as that is known."""
    return without_empty(request, filled(request, found))


def _with_time(columns: Columns, layout: Mapping[str, str]) -> Columns:
    """Return columns with a time `t` from 0, if `layout` has a period: rows without a time that were taken evenly."""
    if PERIOD not in layout:
        return columns
    stated = layout[PERIOD]
    found = SPACED.fullmatch(stated.strip())
    period = float(found[1]) * unit(found[2] or "s").factor if found and found[1].count(".") < 2 else 0.0
    if not 0 < period < np.inf:
        text = f"--layout period={stated}: it is the time between two rows, for example 1ms or 0.001."
        raise RecordingError(text, culprit=PERIOD, value=stated)
    if columns.missing:
        text = f"--layout period={stated} needs evenly spaced rows: {' '.join(columns.missing)}"
        raise RecordingError(text, culprit=PERIOD, value=stated)
    rows = len(next(iter(columns.values.values())))
    values = {"t": np.arange(rows) * period} | {name: column for name, column in columns.values.items() if name != "t"}
    return replace(columns, values=values, units=columns.units | {"t": "s"})


def _check_layout(layout: Mapping[str, str]) -> None:
    for key, choices in ((EMPTY, ("gap",)), (REPEATED, ("first", "last"))):
        if layout.get(key, choices[0]) not in choices:
            text = f"--layout {key}={short(layout[key])}: it is {' or '.join(choices)}."
            raise RecordingError(text, culprit=key, value=layout[key], choices=choices)


def one_run(request: Request, found: Columns) -> Columns:
    """Return the rows of the recording that a path names, all rows where it names a whole file.

    Behind the file's name stands `column=value`, several with commas, `#number`, or both.

    Raises:
        RecordingError: there is no such column, value or number.
    """
    path, (file, which) = request.path, split(request.path)
    if file == path:
        return found
    rows, told_by = np.arange(len(next(iter(found.values.values())))), set()
    for part in which.split(","):
        name, _, text = part.partition("=")
        number, within = part.startswith("#"), _at(found, rows)
        rows = rows[_numbered(request, within, part) if number else _chosen(path, within, name, text)]
        told_by |= {name}
    cut = _at(found, rows)
    values = {name: column for name, column in cut.values.items() if name not in told_by}
    return replace(cut, values=values, rows=f"{rows[0] + 1:,} to {rows[-1] + 1:,}", start="" if rows[0] else cut.start)


def _at(found: Columns, rows: np.ndarray) -> Columns:
    return replace(found, values={name: column[rows] for name, column in found.values.items()})


def _chosen(path: Path, found: Columns, name: str, text: str) -> np.ndarray:
    """Return the rows at which a column has a value."""
    have = tuple(found.values)
    if not (name and text):
        rule = "after the colon stands which recording of the file is meant, column=value or #number"
        raise RecordingError(f"{path}: {rule}; columns are: {listed(have)}.", culprit=str(path), value=name)
    if name not in found.values:
        message = f'{path}: there is no column "{short(name)}" to tell recordings by; there are: {listed(have)}.'
        raise RecordingError(message, culprit=str(path), value=name, choices=have)
    rows = np.flatnonzero(equal(found.values[name], text))
    if not len(rows):
        have = tuple(dict.fromkeys(map(text_of, found.values[name])))
        held = listed(have) if len(have) <= MANY else f"{len(have):,} values; it tells no recordings apart"
        message = f'{path}: "{short(name)}" is nowhere {short(text)}; it holds: {held}.'
        raise RecordingError(message, culprit=str(path), value=text, choices=have)
    return rows


def _numbered(request: Request, found: Columns, number: str) -> np.ndarray:
    """Return the rows of a recording by its number, `#3`; a new one begins where time runs backwards."""
    begins = np.append(_begins(request, found), len(next(iter(found.values.values()))))
    count, wanted = len(begins) - 1, whole(number[1:]) or 0
    if not 0 < wanted <= count:
        have = f"{count:,} recordings, #1 to #{count}" if count > 1 else "one recording"
        rule = "another begins where time runs backwards"
        message = f"{request.path}: there is no {short(number)}; the file holds {have} ({rule})."
        raise RecordingError(message, culprit=str(request.path), value=number)
    return np.arange(begins[wanted - 1], begins[wanted])


def _begins(request: Request, found: Columns) -> Sequence[int]:
    served = assign(replace(request, required=()), found)
    if "t" not in served.values:
        return [0]
    t = clock_of(request.path, served).values
    return [0] if t.dtype == object else starts(t).tolist()
