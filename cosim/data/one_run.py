"""The rows of one recording: what a file holds on one time base, and of many recordings the one that is named.

`many.parquet:run=3` names it by a column, `many.csv:#3` by its number.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cosim.data.assign import assign
from cosim.data.columns import Columns
from cosim.data.joining import on_one_time
from cosim.data.limits import listed, short
from cosim.data.order import in_order
from cosim.data.questions import EMPTY, REPEATED
from cosim.data.runs import equal, split, starts, text_of
from cosim.data.spacing import with_time
from cosim.data.sparse import filled, without_empty
from cosim.data.times import read_clock
from cosim.support.errors import RecordingError
from cosim.support.numbers import whole

MANY = 1000
"""Values of a column beyond which it is a measurement, and no name of a recording."""


def rows_of_one(
    path: Path,
    found: Columns,
    columns: Mapping[str, str],
    units: Mapping[str, str],
    layout: Mapping[str, str],
    required: Sequence[str],
) -> Columns:
    """Return what a file holds as a table with one row for each time, and of many recordings the one that is named.

    Args:
        path: the file, and which recording of it.
        found: all that the file holds.
        columns: what the user says of names, as `assign` takes it.
        units: what the user says of units.
        layout: what the user says of rows: `period`, their distance where there is no time; `nan`, `repeated`.
        required: columns that are needed; see `on_one_time`.

    Raises:
        RecordingError: as `on_one_time`, `with_time` and `one_run`.
    """
    rows = timed(path, found, columns, units, layout, required)
    one = one_run(path, rows, columns, units)
    return rows if one is rows else _full(path, one, columns, units, layout, required)


def timed(
    path: Path,
    found: Columns,
    columns: Mapping[str, str],
    units: Mapping[str, str],
    layout: Mapping[str, str],
    required: Sequence[str],
) -> Columns:
    """Return all rows of a table or file, as `rows_of_one` does of one recording of it."""
    _check_layout(layout)
    found = with_time(on_one_time(path, found, columns, units, required, layout.get(REPEATED, "")), layout)
    found = _full(path, found, columns, units, layout, required)
    return in_order(path, found, columns, units, required, layout.get(REPEATED, ""))


def _full(
    path: Path,
    found: Columns,
    columns: Mapping[str, str],
    units: Mapping[str, str],
    layout: Mapping[str, str],
    required: Sequence[str],
) -> Columns:
    """Return a table whose rows have what is needed, as far as that is known."""
    found = filled(path, found, columns, units, required, layout.get(REPEATED, ""))
    return without_empty(path, found, columns, units, required, layout)


def _check_layout(layout: Mapping[str, str]) -> None:
    for key, choices in ((EMPTY, ("gap",)), (REPEATED, ("first", "last"))):
        if layout.get(key, choices[0]) not in choices:
            text = f"--layout {key}={short(layout[key])}: it is {' or '.join(choices)}."
            raise RecordingError(text, culprit=key, value=layout[key], choices=choices)


def one_run(path: Path, found: Columns, columns: Mapping[str, str], units: Mapping[str, str]) -> Columns:
    """Return the rows of the recording that a path names, all rows where it names a whole file.

    Args:
        path: the file, and which recording of it: `column=value`, several with commas, `#number`, or both.
        found: all rows of the file.
        columns: what the user says of names, as `assign` takes it: which column is the time.
        units: what the user says of units.

    Raises:
        RecordingError: there is no such column, value or number.
    """
    file, which = split(path)
    if file == path:
        return found
    rows, told_by = np.arange(len(next(iter(found.values.values())))), set()
    for part in which.split(","):
        name, _, text = part.partition("=")
        number, within = part.startswith("#"), _at(found, rows)
        rows = rows[_numbered(path, within, part, columns, units) if number else _chosen(path, within, name, text)]
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


def _numbered(
    path: Path, found: Columns, number: str, columns: Mapping[str, str], units: Mapping[str, str]
) -> np.ndarray:
    """Return the rows of a recording by its number, `#3`; a new one begins where time runs backwards."""
    begins = np.append(_begins(path, found, columns, units), len(next(iter(found.values.values()))))
    count, wanted = len(begins) - 1, whole(number[1:]) or 0
    if not 0 < wanted <= count:
        have = f"{count:,} recordings, #1 to #{count}" if count > 1 else "one recording"
        rule = "another begins where time runs backwards"
        message = f"{path}: there is no {short(number)}; the file holds {have} ({rule})."
        raise RecordingError(message, culprit=str(path), value=number)
    return np.arange(begins[wanted - 1], begins[wanted])


def _begins(path: Path, found: Columns, columns: Mapping[str, str], units: Mapping[str, str]) -> Sequence[int]:
    served = assign(path, found, columns, units, ())
    if "t" not in served.values:
        return [0]
    t = read_clock(path, served.values["t"], served.sources["t"], served.units.get("t", ""), servo=False).values
    return [0] if t.dtype == object else starts(t).tolist()
