"""Single false readings: a value that leaves the motion for one to three rows and is back, which no machine can do.

A run of readings is false if it lies far from the curve through its neighbours and, put on that curve, leaves a motion
that is ordinary for the place: a jump away and back. A kink (an impact), a step that stays and noise are none of these.

    bend_k = |x_k - (x_k-1 + x_k+1) / 2|                how far a reading leaves the line between its neighbours
    false:   distance from the curve > limit,  > RATIO x the largest bend that is left,  and that below the limit

For a position the limit is what bends around there, and the step of the encoder. A torque may jump by command, so there
it is what only an error of the recording reaches. Reference for the idea: F. R. Hampel, JASA 69 (1974) 383.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from cosim.data.columns import Array
from cosim.data.recording import Recording
from cosim.data.resolution import resolution

READ = ("q", "v", "q_d", "temperature")
"""Columns that follow something that moves smoothly; each is judged by the bends around a place."""
LONGEST = 3
"""Rows of the longest run: a longer one is a signal that may be real, or a gap."""
STRETCH = 64
"""Rows over which ordinary bends are measured, and as many before and after ..."""
ORDINARY = 0.8
"""... as the value that this share of them does not exceed: a few false readings among them change nothing."""
FAR = 10.0
"""Limit in ordinary bends. Normal noise of any level reaches it once in 10^15 readings."""
STEPS = 3.0
"""Limit in steps of the encoder: what its rounding alone can do is one."""
RATIO = 4.0
"""A kink that is put on the curve through its neighbours leaves half of its distance as bends, a false reading none."""
ROUNDING = 1e-9
"""Share of the range of a column below which a change is one of its rounding in the file."""
ABSURD = 3.0
"""Limit of a torque, in sizes that 99.5 % of all its rows keep to: a command's kick is real and may be large."""
AT_AN_END = 10.0
"""There a run has neighbours on one side only, and a line through two of them says less: so many limits."""
MOST = 0.005
"""Share of the rows above which readings are not single any more: nothing is touched."""


@dataclass(frozen=True)
class Run:
    """A run of false readings: first row, rows, and the curve's values for them."""

    first: int
    values: Array

    @property
    def rows(self) -> slice:
        """Its rows, from 0."""
        return slice(self.first, self.first + len(self.values))


def cleaned(recording: Recording) -> Recording:
    """Return a recording whose single false readings are put on the curve through their neighbours and count for none.

    The table holds the curve's values there, `masked` the spans of time in which nothing is judged, `notes` a
    sentence for each column. A recording without any is returned as it is.
    """
    found = {name: runs for name in (*READ, "tau") if name in recording and (runs := false_runs(recording, name))}
    if not found:
        return recording
    table = dict(recording.table)
    for name, runs in found.items():
        table[name] = table[name].copy()
        for run in runs:
            table[name][run.rows] = run.values
    notes = tuple(_note(recording, name, runs) for name, runs in found.items())
    bridged = (run.rows for name, runs in found.items() for run in runs if name != "temperature")
    spans = sorted({(float(recording.t[rows.start]), float(recording.t[rows.stop - 1])) for rows in bridged})
    masked = (*recording.masked, *spans)
    return replace(recording, table=table, notes=(*recording.notes, *notes), masked=masked)


def false_runs(recording: Recording, name: str) -> list[Run]:
    """Find the runs of false readings in a column; none where there are too many to be single."""
    values = recording[name]
    limit = _absurd(values) if name == "tau" else _limits(values, max(resolution(values), _least_change(values)))
    suspects = np.flatnonzero(_bends(values) > limit / (2 if name == "tau" else 1))
    if not len(suspects) or len(suspects) > max(3 * LONGEST, 3 * MOST * len(values)):
        return []
    runs = list(_runs(values, limit, suspects))
    return runs if sum(len(run.values) for run in runs) <= max(LONGEST, MOST * len(values)) else []


def _least_change(values: Array) -> float:
    """Smallest change between two rows: a count of an encoder that hardly ever counts, else next to nothing."""
    changes = np.abs(np.diff(values))
    return float(np.min(changes, where=changes > ROUNDING * float(np.ptp(values)), initial=np.inf))


def _bends(values: Array) -> Array:
    """Distance of each reading from the line between its neighbours; the ends from that through the next two."""
    inner = np.abs(values[1:-1] - 0.5 * (values[:-2] + values[2:]))
    return np.concatenate([2 * inner[:1], inner, 2 * inner[-1:]])


def _limits(values: Array, step: float) -> Array:
    """Limit of each row: `FAR` times the ordinary bends around it, and never below what rounding can do."""
    bends = _bends(values)
    starts = np.linspace(0, len(bends), max(1, len(bends) // STRETCH) + 1).astype(int)
    parts = sliding_window_view(bends, min(STRETCH, len(bends)))[starts[:-1]]
    ordinary = np.quantile(parts, ORDINARY, axis=1)
    padded = np.concatenate([ordinary[:1], ordinary, ordinary[-1:]])
    around = np.maximum.reduce([padded[:-2], padded[1:-1], padded[2:]])
    least = max(STEPS * step, 1e-9 * float(np.ptp(np.quantile(values, (0.01, 0.99)))))
    return np.maximum(FAR * np.repeat(around, np.diff(starts)), least)


def _absurd(values: Array) -> Array:
    size = float(np.quantile(np.abs(values - np.median(values)), 0.995))
    return np.full(len(values), ABSURD * size)


def _runs(values: Array, limit: Array, suspects: npt.NDArray[np.int64]) -> Iterator[Run]:
    """Runs that begin at a suspect row, just after one or with the recording; each row in one at most, short first."""
    done = -1
    start = [0] if suspects[0] <= LONGEST else []
    for first in np.unique(np.concatenate([start, suspects, suspects + 1])).astype(int).tolist():
        if first <= done or first >= len(values):
            continue
        run = next((one for rows in range(1, LONGEST + 1) if (one := _judged(values, limit, first, rows))), None)
        if run:
            done = run.rows.stop
            yield run


def _judged(values: Array, limit: Array, first: int, rows: int) -> Run | None:
    """The run of so many rows from `first`, if it is false and what is around it is ordinary without it."""
    last = first + rows
    around = np.array([*range(max(0, first - 2), first), *range(last, min(len(values), last + 2))])
    if len(around) < 2 or last > len(values):
        return None
    degree = len(around) - 1 if len(around) == 4 else 1
    inside = np.arange(first, last)
    fitted = np.polynomial.polynomial.polyfit(around - first, values[around], degree)  # a cubic between four, or a line
    curve = np.polynomial.Polynomial(fitted)(inside - first)
    distance = np.abs(values[inside] - curve)
    beside = 3 if len(around) == 4 else 3 + LONGEST
    patch = values[max(0, first - beside) : last + beside].copy()
    patch[first - max(0, first - beside) :][:rows] = curve
    left = float(_bends(patch)[1:-1].max())
    most = float(limit[first]) * (1.0 if len(around) == 4 else AT_AN_END)
    is_false = distance.min() > max(most, RATIO * left) and left < limit[first]
    return Run(first, curve) if is_false else None


def _note(recording: Recording, name: str, runs: list[Run]) -> str:
    row, rows = runs[0].first, sum(len(run.values) for run in runs)
    where = f"{name} = {recording[name][row]:.6g} in row {row + 1:,} ({recording.t[row]:.6g} s)"
    if rows == 1:
        return f"{recording.name}: {where} is a false reading; it is left out and interpolated."
    return f"{recording.name}: {rows} false readings, the first {where}; they are left out and interpolated."
