"""Tables whose rows hold some of the channels each: sensors that report at their own times, in one table.

An outer join of topics writes a row for each time at which any of them had a value, and leaves the others empty. Where
a column that is needed is empty in more than `SPARSE` of the rows, each column has its own times: those of its values.

Where less is empty, these are rows without a sample. Rows of a table that hold no value at all are left out; so are
those before the first and after the last in which all that is needed has a value, as of a logger that starts before
the devices that it asks. Others are left out, a gap in time, if the user says so.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from cosim.data.assign import assign
from cosim.data.checks import chosen
from cosim.data.columns import Columns, Request
from cosim.data.joining import LEAST, on_one_time
from cosim.data.limits import LARGEST, listed, several
from cosim.data.order import order_of
from cosim.data.questions import EMPTY, PERIOD
from cosim.data.times import clock_of

SPARSE = 0.2
"""Share of the rows without a value from which on they are no invalid samples: the column has times of its own."""


def filled(request: Request, found: Columns) -> Columns:
    """Return a table whose rows are full: one with own times of its columns is put on one time base.

    Raises:
        RecordingError: as `assign`, `read_clock` and `on_one_time`.
    """
    if not any(_is_sparse(one) for one in found.values.values()):
        return found
    served, units = assign(request, found), request.units
    needed = chosen(served.values, request.required) or tuple(one for one in served.values if one != "t")
    if "t" not in served.values or not any(_is_sparse(served.values[name]) for name in needed):
        return found
    name = served.sources["t"]
    clock = clock_of(request.path, served, servo=bool(request.required))
    if clock.values.dtype.kind not in "iuf":
        return found
    t = clock.seconds
    there = {key: np.isfinite(one) for key, one in found.values.items() if key != name and one.dtype.kind in "fiub"}
    if any(_begins_again(t, found, served.sources[one], there) for one in needed):
        return found  # several recordings: each is filled when it is taken
    parted = replace(
        found,
        values={key: found.values[key][rows] for key, rows in there.items()},
        units={key: text for key, text in found.units.items() if key in there},
        clocks={key: t if rows.all() else t[rows] for key, rows in there.items()},
        start=found.start or clock.start,
        notes=(*found.notes, *clock.notes),
    )
    said = {key: text for key, text in request.columns.items() if key != "t"}
    scales = {key: text for key, text in units.items() if key != "t"}
    joined = on_one_time(replace(request, columns=said, units=scales), parted)
    if "t" not in joined.values:
        return found
    own = joined.values["t"] / clock.size if "t" in units else joined.values["t"]
    values = {name: own} | {key: one for key, one in joined.values.items() if key != "t"}
    return replace(joined, values=values, units=joined.units | {name: clock.unit if "t" in units else "s"})


def without_empty(request: Request, found: Columns) -> Columns:
    """Return a table without rows that hold no sample, with a note.

    With `nan=gap` those between others are left out too in which a column that is needed has no value, or one beyond
    any axis; with a `period` time is none of the file's values.

    Raises:
        RecordingError: as `assign`.
    """
    path, layout = request.path, request.layout
    empty = {name: _is_empty(column, EMPTY in layout) for name, column in found.values.items()}
    if not any(rows.any() for name, rows in empty.items() if found.values[name].dtype != object):
        return found
    served = assign(request, found)
    made = served.sources.get("t") if PERIOD in layout else None
    others = [rows for name, rows in empty.items() if name != made]
    blank = np.logical_and.reduce(others) if others else np.zeros(len(next(iter(empty.values()))), bool)
    needed = [name for name in ("t", *chosen(served.values, request.required)) if name in served.values]
    lacks = {theirs: empty[theirs] for theirs in (served.sources[name] for name in needed)}
    bad = np.logical_or.reduce([*lacks.values()]) if lacks else blank
    whole = np.flatnonzero(~bad)
    if not len(whole):
        return found
    ends = (np.arange(len(bad)) < whole[0]) | (np.arange(len(bad)) > whole[-1])
    between = bad & ~blank & ~ends
    left = blank | ends | between
    if not left.any() or (between.any() and EMPTY not in layout):
        return found  # it is asked what becomes of rows between others, by their number in the file
    notes = [_dropped_note(path, "without any value", blank)] if blank.any() else []
    lacking = [name for name, rows in lacks.items() if (rows & ~blank).any()]
    if lacking:
        said = listed(tuple(f'"{name}"' for name in lacking))
        notes.append(_dropped_note(path, f"in which {said} has no value", bad & ~blank))
    values = {name: column[~left] for name, column in found.values.items()}
    restarts = tuple(row - int(left[:row].sum()) for row in found.restarts)
    start = "" if left[0] else found.start
    return replace(found, values=values, notes=(*found.notes, *notes), start=start, restarts=restarts)


def _dropped_note(path: Path, which: str, rows: np.ndarray) -> str:
    said = several(int(rows.sum()), f"row {which} was", f"rows {which} were")
    return f"{path.stem}: {said} left out; the first is row {int(np.argmax(rows)) + 1:,}."


def _begins_again(t: np.ndarray, found: Columns, name: str, there: Mapping[str, np.ndarray]) -> bool:
    """Whether time falls in the samples of a column, however they are put in order."""
    rows = np.flatnonzero(there.get(name, np.zeros(len(t), bool)) & np.isfinite(t))
    return bool((np.diff(order_of(t[rows], {name: found.values[name][rows]}).t) < 0).any())


def _is_empty(column: np.ndarray, or_garbled: bool) -> np.ndarray:
    """Which rows of a column hold nothing, or what no axis has."""
    if column.dtype.kind == "f" and or_garbled:
        return np.asarray(~(np.abs(column) <= LARGEST), bool)
    if column.dtype.kind in "fmM":
        return np.array(column != column, bool)
    return np.array([one is None for one in column], bool) if column.dtype == object else np.zeros(len(column), bool)


def _is_sparse(column: np.ndarray) -> bool:
    """Whether a column has values, and none in many rows."""
    if column.dtype.kind != "f":
        return False
    empty = np.isnan(column)
    return bool(empty.mean() > SPARSE and len(column) - empty.sum() >= LEAST)
