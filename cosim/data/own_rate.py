"""A recording whose slower column repeats its readings (`held`), in rows that are new.

    t      when the slower one of torque and motion is new
    tau    mean over the time from half an interval before to half an interval after, where it is read more often
    rest   as it was in these rows

Between two readings nothing is invented, none of them is late, and the interval is the sample time of what follows:
it sets the widest band, and what is late by half of it is no delay.
"""

from dataclasses import replace

import numpy as np

from cosim.data.columns import Array
from cosim.data.held import Index, held_columns, new_rows
from cosim.data.recording import GAP, Recording
from cosim.data.single_readings import cleaned
from cosim.data.start_up import settled

SMOOTH = ("q", "v", "q_d")
"""Columns that are read between rows by a cubic spline; others are those of the nearest row."""
EVEN = 1e-3
"""Share of the interval within which new readings come evenly and are taken as they are."""
LEAST_READINGS = 8
"""New readings that a stretch between two gaps must have to be kept."""


def as_analysed(recording: Recording) -> Recording:
    """Return the recording as analyses take it: in new rows, without a loop that settles and single false readings."""
    return cleaned(settled(at_own_rate(recording)))


def at_own_rate(recording: Recording) -> Recording:
    """Return the recording with one row for each new reading of the slower one of torque and motion.

    It is returned as it is where both are new in every row. New readings that do not come evenly are put on an even
    grid in each stretch between two gaps.
    """
    held = held_columns(recording.table)
    slowest = max(("tau", "q" if "q" in recording else "v"), key=lambda name: held.get(name, 1.0))
    if slowest not in held:
        return recording
    longest = GAP * held[slowest] * recording.sample_time
    ends = [gap.row for gap in recording.gaps if gap.end - gap.start > longest]
    spans = [slice(first, last) for first, last in zip([0, *ends], [*ends, len(recording)], strict=True)]
    grids = [_grid(recording, span, slowest, held[slowest]) for span in spans]
    stretches = [(span, grid) for span, grid in zip(spans, grids, strict=True) if len(grid) >= LEAST_READINGS]
    if not stretches:
        return recording
    parts = [_at(recording, span, grid, held) for span, grid in stretches]
    table = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    rows = np.concatenate([span.start + _nearest(recording.t[span], grid) for span, grid in stretches])
    return replace(recording, table=table, others={name: column[rows] for name, column in recording.others.items()})


def _grid(recording: Recording, span: slice, slowest: str, every: float) -> Array:
    """Times of the new readings of a column in a stretch; evenly apart where they are not by themselves."""
    t = recording.t[span][new_rows(recording[slowest][span], every)]
    if len(t) < LEAST_READINGS:
        return t
    steps = np.diff(t)
    return t if np.ptp(steps) < EVEN * steps.mean() else np.linspace(t[0], t[-1], len(t))


def _at(recording: Recording, span: slice, grid: Array, held: dict[str, float]) -> dict[str, Array]:
    """All columns of a stretch at the times of a grid."""
    t, interval = recording.t[span], float(np.mean(np.diff(grid)))
    table = {}
    for name in recording:
        values = recording[name][span]
        rows = new_rows(values, held[name]) if name in held else np.arange(len(t))
        if name == "t":
            table[name] = grid
        elif name == "tau":
            table[name] = _mean(t[rows], values[rows], grid, interval)
        elif name in SMOOTH:
            table[name] = _between(t[rows], values[rows], grid)
        else:
            table[name] = values[_nearest(t, grid)]
    return table


def _mean(t: Array, values: Array, grid: Array, interval: float) -> Array:
    """Mean over an interval around each time of a grid, of values that hold around theirs; where as slow, a value."""
    if np.median(np.diff(t)) > interval / GAP:
        return np.interp(grid, t, values)
    middles = (t[1:] + t[:-1]) / 2
    edges = np.concatenate([[2 * t[0] - middles[0]], middles, [2 * t[-1] - middles[-1]]])
    total = np.concatenate([[0.0], np.cumsum(values * np.diff(edges))])
    low, high = (np.clip(grid + side * interval / 2, edges[0], edges[-1]) for side in (-1, 1))
    return np.asarray((np.interp(high, edges, total) - np.interp(low, edges, total)) / (high - low))


def _between(t: Array, values: Array, grid: Array) -> Array:
    """Values at the times of a grid: those that were read there, a cubic spline between."""
    rows = _nearest(t, grid)
    if np.array_equal(t[rows], grid):
        return values[rows]
    from scipy.interpolate import CubicSpline  # a tenth of a second that even recordings do not need

    return np.asarray(CubicSpline(t, values)(np.clip(grid, t[0], t[-1])))


def _nearest(t: Array, grid: Array) -> Index:
    after = np.clip(np.searchsorted(t, grid), 1, len(t) - 1)
    return np.asarray(after - (grid - t[after - 1] < t[after] - grid))
