"""Where the missing torque lives: its mean over what was recorded, with bands.

Position, speed, direction, acceleration and time: the missing torque itself. Time since reversal, rest before a move
and user columns (temperature, load) act through friction: the part of it that resists the motion. Frequency: its RMS in
bands. A visit is a contiguous stay in a bin; visits, not samples, are independent, so the band comes from them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from cosim.diagnosis.answer.result import Region, Trace, Where
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.effects.base import Reach
from cosim.diagnosis.search.instrumental_variable import SEGMENT
from cosim.estimation.discrepancy_basis import since_reversal
from cosim.estimation.prepare import Array
from cosim.estimation.row_weights import least_speed
from cosim.support.statistics import Z95, hann
from pyfmi_models.effects import Effect

BINS = 40
MOVE = 1.0
"""Seconds of a move that are ascribed to the rest before it."""
LEAST_REST = 0.1
"""Shorter standstill [s] is a reversal."""
BANDS = np.geomspace(0.5, 32.0, 13)
"""Edges of the bands of frequency [Hz], half an octave each."""
UNITS = {"temperature": "°C", "load_torque": "N.m"}
"""Units of user columns that have one; of others nothing is known."""


def regions(traces: Sequence[Trace], after: bool, linear: bool) -> tuple[Region, ...]:
    """Mean missing torque over each coordinate, over all recordings."""
    missing = np.concatenate([t.tau - (t.after if after else t.before) for t in traces])
    found = [_region(*axis) for axis in _of_motion(traces, missing, linear)]
    resisting = [replace(_region(*axis), measure="mean resisting") for axis in _of_friction(traces, missing)]
    return (*found, *resisting, *_of_frequency(traces, missing))


Axis = tuple[str, str, Array, Array, Array]
"""Name, unit, coordinate (NaN: does not count), missing torque, edges of the bins."""


def _of_motion(traces: Sequence[Trace], missing: Array, linear: bool) -> Iterator[Axis]:
    length = "m" if linear else "rad"
    q, v = (np.concatenate([getattr(t, name) for t in traces]) for name in ("q", "v"))
    a = np.concatenate([np.gradient(t.v, t.t) for t in traces])
    time = np.concatenate([t.t - t.t[0] for t in traces])
    top, hard = float(np.abs(v).max()), float(np.quantile(np.abs(a), 0.999)) + 1e-300
    yield "position", length, q, missing, np.linspace(q.min(), q.max(), BINS + 1)
    yield "speed", f"{length}/s", v, missing, top * np.linspace(-1, 1, BINS // 2 + 1)
    yield "direction", "1", np.sign(v) * (np.abs(v) > 0.01 * top), missing, np.array([-1.5, -0.5, 0.5, 1.5])
    yield "acceleration", f"{length}/s²", a, missing, hard * np.linspace(-1, 1, BINS // 2 + 1)
    yield "time", "s", time, missing, np.linspace(0, float(time.max()), BINS // 2 + 1)


def _of_friction(traces: Sequence[Trace], missing: Array) -> Iterator[Axis]:
    v = np.concatenate([t.v for t in traces])
    resists, moves = missing * np.sign(v), np.abs(v) > least_speed(v)
    since = np.where(moves, np.concatenate([since_reversal(t.t, t.v) for t in traces]), np.nan)
    yield "time since reversal", "s", since, resists, np.geomspace(1e-2, max(float(np.nanmax(since)), 1.0), 17)
    rest = np.concatenate([_rest_before(t, least_speed(v)) for t in traces])
    if np.isfinite(rest).any():
        longest = max(float(np.nanmax(rest)), 2 * LEAST_REST)
        yield "rest before a move", "s", rest, resists, np.geomspace(LEAST_REST, longest, 9)
    for name in sorted(set.intersection(*(set(t.extras) for t in traces)) if traces else ()):
        column = np.concatenate([t.extras[name] for t in traces])
        if column.min() < column.max():
            edges = np.linspace(column.min(), column.max(), BINS // 2 + 1)
            yield name, UNITS.get(name, ""), np.where(moves, column, np.nan), resists, edges


def _of_frequency(traces: Sequence[Trace], missing: Array) -> Iterator[Region]:
    """RMS of the missing torque in bands of half an octave; its band from the segments of all recordings."""
    ends = np.cumsum([len(t.t) for t in traces])[:-1]
    parts = [_powers(t.t, one, BANDS) for t, one in zip(traces, np.split(missing, ends), strict=True)]
    powers = np.concatenate(parts)
    if len(powers) > 2:
        size = np.sqrt(powers.mean(0))
        band = Z95 * powers.std(0, ddof=1) / np.sqrt(len(powers)) / (2 * size + 1e-300)
        count = np.full(len(size), float(len(powers)))
        centres = np.sqrt(BANDS[1:] * BANDS[:-1])
        named = {"axis": "frequency", "unit": "Hz", "measure": "RMS of the missing"}
        yield Region(**named, centres=centres, mean=size, band=band, count=count)


def _powers(t: Array, missing: Array, edges: Array) -> Array:
    """Mean square of each segment of a recording in each band, (segments, bands)."""
    step = float(np.median(np.diff(t)))
    length = int(SEGMENT / step)
    whole = missing[: len(missing) // length * length].reshape(-1, length)
    window = hann(length)
    spectrum = np.abs(np.fft.rfft((whole - whole.mean(1, keepdims=True)) * window, axis=1)) ** 2
    scaled = 2 * spectrum / (length * float(window @ window))
    band = np.digitize(np.fft.rfftfreq(length, step), edges) - 1
    return np.column_stack([scaled[:, band == k].sum(1) for k in range(len(edges) - 1)])


def _rest_before(trace: Trace, least: float) -> Array:
    """Seconds of standstill before a move, at the rows of its first second; NaN elsewhere."""
    still = np.concatenate([[False], np.abs(trace.v) <= least, [False]])
    starts, ends = np.flatnonzero(~still[:-1] & still[1:]), np.flatnonzero(still[:-1] & ~still[1:])
    found = np.full(len(trace.t), np.nan)
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        if end < len(trace.t) and (rested := float(trace.t[end] - trace.t[start])) > LEAST_REST:
            last = int(np.searchsorted(trace.t, trace.t[end] + MOVE))
            found[end:last] = np.where(still[1:-1][end:last], np.nan, rested)
    return found


def _region(axis: str, unit: str, x: Array, missing: Array, edges: Array) -> Region:
    place = np.clip(np.digitize(x, edges) - 1, 0, len(edges) - 2)
    cells = [_cell((place == k) & np.isfinite(x), missing) for k in range(len(edges) - 1)]
    mean, band, count = (np.array(column) for column in zip(*cells, strict=True))
    return Region(axis=axis, unit=unit, centres=(edges[1:] + edges[:-1]) / 2, mean=mean, band=band, count=count)


def _cell(inside: Array, missing: Array) -> tuple[float, float, float]:
    if not inside.any():
        return np.nan, np.nan, 0.0
    starts = np.flatnonzero(np.diff(inside.astype(np.int8), prepend=0) == 1)
    ends = np.flatnonzero(np.diff(inside.astype(np.int8), append=0) == -1) + 1
    visits = np.array([missing[a:b].mean() for a, b in zip(starts, ends, strict=True)])
    lengths = np.array([b - a for a, b in zip(starts, ends, strict=True)], float)
    mean = float(visits @ lengths / lengths.sum())
    spread = float(missing[inside].std()) if len(visits) < 3 else float(visits.std(ddof=1) / np.sqrt(len(visits)))
    return mean, Z95 * spread, float(lengths.sum())


def where(effect: Effect, traces: Sequence[Trace]) -> Where:
    """Say where an effect acts, within what was visited."""
    q, v = (np.concatenate([getattr(t, name) for t in traces]) for name in ("q", "v"))
    low, high, top = float(q.min()), float(q.max()), float(np.abs(v).max())
    return hypothesis_of(effect).where(effect, Reach(low, high, top))
