"""Held readings: a column that is new only every few rows, as where a fast logger repeats what a slow device says.

    new values in rows c_1 < c_2 < ...,    c_k+1 - c_k = n P,    n = 1 except where a new value equals the last one

The repeated rows are late by half of P on average, and the jumps between them look like the steps of an encoder.

A coarse encoder in slow motion repeats its readings too. But each of its jumps is one step and comes when the motion
makes it; a held reading jumps by whatever the motion did meanwhile, at times that the device sets.
"""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from cosim.data.columns import Array

Index = npt.NDArray[np.int64]
READ = ("tau", "q", "v", "q_d")
"""Columns that are judged; any other may change as seldom as it likes."""
LEAST_INTERVALS = 30
"""Intervals between new readings below which nothing is concluded."""
LONGEST = 0.25
"""Interval [s] above which a value is a command that stays: steps of a torque test, corners of a set point."""
NEXT_ROW = 0.05
"""Share of the readings that may be new in the very next row; a column that is read in each row has most of its so."""
REGULAR, SINGLE = 0.95, 0.5
"""Share of the intervals that must be multiples of P, and share that must be P itself."""
OFF, LATE = 1.1, 0.25
"""Rows, or share of P, by which an interval may miss a multiple of P: two clocks beat, and a computer comes late."""
SHORT = 3.5
"""Rows of P up to which it must miss it by less than one."""
ON_TIME, ALONE = 0.99, 0.9
"""Share of the readings that must be new within a row of a clock's ticks, and of those that come one tick after the
last, where all jumps are alike, as in steady motion: a coarse encoder is never as regular."""
ALIKE, MOSTLY = 1e-3, 0.8
"""Jumps within this share of each other are alike; where so many are, they may be the step of a coarse reading."""


def rows_held(values: Array) -> float:
    """Rows from one new reading to the next, on average; 1 where any row may be new."""
    changed = np.flatnonzero(np.diff(values)) + 1
    intervals = np.diff(changed)
    if len(intervals) < LEAST_INTERVALS or np.mean(intervals == 1) > NEXT_ROW:
        return 1.0
    usual = float(np.median(intervals))
    every = float(intervals[np.abs(intervals - usual) <= max(OFF, LATE * usual)].mean())
    counts = np.maximum(np.rint(intervals / every), 1)
    missed, single = np.abs(intervals - every * counts), float(np.mean(counts == 1))
    if _alike(np.abs(values[changed] - values[changed - 1])) > MOSTLY:
        return usual if _on_time(changed, round(usual)) >= ON_TIME and single >= ALONE else 1.0
    regular = float(np.mean(missed <= max(OFF, LATE * every) if every > SHORT else missed < 1))
    return every if regular >= REGULAR and single >= SINGLE else 1.0


def _alike(jumps: Array) -> float:
    """Largest share of the jumps that are alike."""
    jumps = np.sort(jumps)
    return float(np.max(np.searchsorted(jumps, (1 + ALIKE) * jumps, "right") - np.arange(len(jumps)))) / len(jumps)


def _on_time(rows: Index, every: int) -> float:
    """Share of the rows that are ticks of a clock of so many rows, or next to one."""
    ticks = np.bincount(rows % every, minlength=every) / len(rows)
    return float(np.max(ticks + np.roll(ticks, 1) + np.roll(ticks, -1) if every > SHORT else ticks))


def new_rows(values: Array, every: float) -> Index:
    """Rows of the new readings of a column that holds each for `every` rows; one that equals the last is counted in."""
    changed = np.flatnonzero(np.diff(values)) + 1
    edges = np.concatenate([[changed[0] % every - every] if len(changed) else [0.0], changed, [len(values)]])
    rows = [
        first + np.arange(max(1, round((last - first) / every))) * every for first, last in pairwise(edges.tolist())
    ]
    found = np.unique(np.rint(np.concatenate(rows)).astype(np.int64))
    return found[(found >= 0) & (found < len(values))]


def held_columns(table: Mapping[str, Array]) -> dict[str, float]:
    """Rows for which each column of a table with time `t` [s] holds a reading, of those that hold theirs."""
    row = float(np.median(np.diff(table["t"])))
    rows = {name: rows_held(table[name]) for name in READ if name in table}
    return {name: every for name, every in rows.items() if 1 < every <= LONGEST / row}


def notes(name: str, table: Mapping[str, Array]) -> tuple[str, ...]:
    """Say which columns of the recording `name` hold their readings, and for how long."""
    row = float(np.median(np.diff(table["t"])))
    return tuple(
        f"{name}: {column} is new every {1e3 * every * row:.3g} ms, while rows come every {1e3 * row:.3g} ms; "
        f"an analysis takes its new readings alone, {1 / (every * row):.3g} a second."
        for column, every in held_columns(table).items()
    )
