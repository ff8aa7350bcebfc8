"""Tables whose rows hold some of the channels each: sensors that report at their own times, in one table.

An outer join of topics writes a row for each time at which any of them had a value, and leaves the others empty. Where
a column that is needed is empty in more than `SPARSE` of the rows, each column has its own times: those of its values.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cosim.data.assign import assign
from cosim.data.checks import chosen
from cosim.data.columns import Columns
from cosim.data.joining import LEAST, on_one_time
from cosim.data.times import read_clock
from cosim.support.units import unit

SPARSE = 0.2
"""Share of the rows without a value from which on they are no invalid samples: the column has times of its own."""


def filled(
    path: Path, found: Columns, columns: Mapping[str, str], units: Mapping[str, str], required: Sequence[str]
) -> Columns:
    """Return a table whose rows are full: one with own times of its columns is put on one time base.

    Args:
        path: the file, for messages and notes.
        found: its columns, of equal length.
        columns: what the user says of names, as `assign` takes it.
        units: what the user says of units.
        required: columns that are needed; the base is taken from them.

    Raises:
        RecordingError: as `assign`, `read_clock` and `on_one_time`.
    """
    if not any(_is_sparse(one) for one in found.values.values()):
        return found
    served = assign(path, found, columns, units, required)
    needed = chosen(served.values, tuple(required)) or tuple(one for one in served.values if one != "t")
    if "t" not in served.values or not any(_is_sparse(served.values[name]) for name in needed):
        return found
    name = served.sources["t"]
    clock = read_clock(path, served.values["t"], name, served.units.get("t", ""), servo=bool(required))
    if clock.values.dtype.kind not in "iuf":
        return found
    size = unit(clock.unit).factor if clock.unit else 1.0
    t = size * clock.values.astype(np.float64)
    there = {key: np.isfinite(one) for key, one in found.values.items() if key != name and one.dtype.kind in "fiub"}
    parted = replace(
        found,
        values={key: found.values[key][rows] for key, rows in there.items()},
        units={key: text for key, text in found.units.items() if key in there},
        clocks={key: t if rows.all() else t[rows] for key, rows in there.items()},
        start=found.start or clock.start,
        notes=(*found.notes, *clock.notes),
    )
    said = {key: text for key, text in columns.items() if key != "t"}
    joined = on_one_time(path, parted, said, {key: text for key, text in units.items() if key != "t"}, required)
    if "t" not in joined.values:
        return found
    own = joined.values["t"] / size if "t" in units else joined.values["t"]
    values = {name: own} | {key: one for key, one in joined.values.items() if key != "t"}
    return replace(joined, values=values, units=joined.units | {name: clock.unit if "t" in units else "s"})


def _is_sparse(column: np.ndarray) -> bool:
    """Whether a column has values, and none in many rows."""
    if column.dtype.kind != "f":
        return False
    empty = np.isnan(column)
    return bool(empty.mean() > SPARSE and len(column) - empty.sum() >= LEAST)
