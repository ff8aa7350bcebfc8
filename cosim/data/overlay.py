"""Recordings on one time base: the rows of the first, the others interpolated to them, where all have samples.

Recordings whose clocks overlap are compared by their time stamps. Others begin at 0 each, and are moved by the lag at
which a signal that both have agrees best.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.data.columns import Array
from cosim.data.recording import GAP, Recording
from cosim.support.errors import RecordingError

SHARED = 0.5
"""Share of the shorter recording from which overlapping time stamps are those of one clock."""
BY = ("q_d", "q", "position", "v", "tau")
"""Signals by which recordings are laid over each other, the first that all have."""
GRID = 200_000
"""Rows at most on which a lag is sought."""


@dataclass(frozen=True)
class Aligned:
    """Columns that all recordings have, on the rows of the first: times (rows,), columns (recordings, rows)."""

    t: Array
    columns: dict[str, Array]
    units: dict[str, str]
    notes: tuple[str, ...]


def aligned(recordings: Sequence[Recording]) -> Aligned:
    """Lay recordings over the first.

    Raises:
        RecordingError: they have no column, or no span of time, in common.
    """
    first, *others = recordings
    shared = [name for name in first.columns if name != "t" and all(name in one for one in others)]
    notes = [note for name in shared for note in _units(name, recordings)]
    names = [name for name in shared if not any(_units(name, recordings))]
    if not names:
        have = "; ".join(f"{one.name}: {', '.join(one.columns)}" for one in recordings)
        raise RecordingError(f"The recordings have no column in common ({have}); --columns renames.", culprit="columns")
    times = [first.t]
    for one in others:
        t, note = _laid_over(first, one, names)
        times.append(t)
        notes += [note] if note else []
    low, high = max(t[0] for t in times), min(t[-1] for t in times)
    rows = (first.t >= low) & (first.t <= high)
    if rows.sum() < 2:
        spans = "; ".join(f"{one.name}: {t[0]:.6g} to {t[-1]:.6g} s" for one, t in zip(recordings, times, strict=True))
        raise RecordingError(f"The recordings have no time in common ({spans}).", culprit="t")
    grid = first.t[rows]
    columns = {
        name: np.array([_at(grid, t, one[name]) for t, one in zip(times, recordings, strict=True)]) for name in names
    }
    left = {name for one in recordings for name in one.columns} - {*names, "t"}
    notes += [f"Not in all of them, and left out: {', '.join(sorted(left))}."] if left else []
    return Aligned(grid, columns, {name: first.units.get(name, "") for name in names}, tuple(notes))


def _units(name: str, recordings: Sequence[Recording]) -> list[str]:
    stated = {one.units[name] for one in recordings if one.units.get(name)}
    return [] if len(stated) < 2 else [f"{name} is left out: its units are {' and '.join(sorted(stated))}."]


def _laid_over(first: Recording, one: Recording, names: Sequence[str]) -> tuple[Array, str]:
    """Times of a recording on the clock of the first, and a note where they were moved."""
    common = min(first.t[-1], one.t[-1]) - max(first.t[0], one.t[0])
    if common >= SHARED * min(first.duration, one.duration):
        return one.t, ""
    by = next((name for name in BY if name in names), names[0])
    began = one.t - one.t[0] + first.t[0]
    lag = _lag(first, one, by)
    moved = began[0] + lag - one.t[0]
    return began + lag, f"{one.name} has another clock: it is moved by {moved:.6g} s, at which {by} agrees best."


def _lag(first: Recording, one: Recording, by: str) -> float:
    """Time by which a recording that begins with the first must be moved so that a signal agrees best [s]."""
    step = max(first.sample_time, one.sample_time, (first.duration + one.duration) / GRID)
    a, b = (_at(np.arange(0, of.duration, step), of.t - of.t[0], of[by]) for of in (first, one))
    a, b = (np.nan_to_num(x - np.nanmean(x)) for x in (a, b))
    size, one_a, one_b = len(a) + len(b), np.ones_like(a), np.ones_like(b)
    count = _products(one_a, one_b, size)
    energy = _products(a**2, one_b, size) + _products(one_a, b**2, size) - 2 * _products(a, b, size)
    enough = count >= SHARED * min(len(a), len(b))
    distance = np.where(enough, energy / np.maximum(count, 1), np.inf)
    best = int(np.argmin(distance))
    return step * (best if best < len(a) else best - size)


def _products(one: Array, other: Array, size: int) -> Array:
    """The sum over rows of one[k + shift] other[k], by shift, negative ones at the end; by an FFT of `size` points."""
    found: Array = np.fft.irfft(np.fft.rfft(one, size) * np.conj(np.fft.rfft(other, size)), size)
    return found


def _at(grid: Array, t: Array, values: Array) -> Array:
    """Values at other times, by straight lines between samples; NaN in gaps and outside."""
    found = np.interp(grid, t, values, np.nan, np.nan)
    step = np.diff(t)
    wide = np.flatnonzero(step > GAP * np.median(step))
    after = np.searchsorted(t, grid, side="left")
    inside = np.isin(after - 1, wide) & (grid != t[np.minimum(after, len(t) - 1)])
    found[inside] = np.nan
    return found
