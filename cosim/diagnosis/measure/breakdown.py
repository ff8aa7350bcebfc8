"""Errors by part of the held-out recordings, and by second and place as pictures show them.

What is said about a part rests on a bootstrap and belongs to the diagnosis (`parts`); means and RMS values over bins of
a picture are worked out when it is drawn.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from cosim.diagnosis.answer.result import Part, Trace
from cosim.support.statistics import Z95, Array, Index, bootstrap_range, rms

Mask = npt.NDArray[np.bool_]
MOST_BARS = 120
"""Bars of a picture over time, at most."""


@dataclass(frozen=True)
class Samples:
    """Traces one after another; `second` numbers seconds across all of them."""

    t: Array
    q: Array
    v: Array
    tau: Array
    before: Array
    """Torque error of the base."""
    after: Array
    """Torque error with the missing physics."""
    second: Array

    def where(self, mask: Mask) -> "Samples":
        """Return the samples that a mask selects."""
        return Samples(*(getattr(self, name)[mask] for name in self.__dataclass_fields__))


def samples(traces: tuple[Trace, ...]) -> Samples:
    """Return the judged samples of these traces, in one piece."""
    parts = [_judged(trace) for trace in traces]
    if not parts:
        return Samples(*(np.empty(0) for _ in range(7)))
    starts = np.cumsum([0.0, *(part.second[-1] + 1 if part.second.size else 0 for part in parts[:-1])])
    shifted = [
        (*list(vars(part).values())[:-1], part.second + start) for part, start in zip(parts, starts, strict=True)
    ]
    return Samples(*(np.concatenate(columns) for columns in zip(*shifted, strict=True)))


def _judged(trace: Trace) -> Samples:
    """Return the rows of a trace that say something; the protocol has left out the ends, where filters settle."""
    keep = np.isfinite(trace.missing) & np.isfinite(trace.after)
    second = np.floor(trace.t - trace.t[0]) if trace.t.size else trace.t
    columns = (trace.t, trace.q, trace.v, trace.tau, trace.missing, trace.tau - trace.after, second)
    return Samples(*(np.asarray(column, dtype=float)[keep] for column in columns))


def part(label: str, chosen: Samples, speeds: tuple[float, float] | None = None) -> Part:
    """Judge one set of samples by drawing its seconds with replacement."""
    low, high = change_range(chosen)
    before, after = rms(chosen.before), rms(chosen.after)
    return Part(
        label=label,
        before=before,
        after=after,
        change="better" if low > 0 else "worse" if high < 0 else "no clear change",
        speeds=speeds,
    )


def change_range(chosen: Samples) -> tuple[float, float]:
    """Return the 95 % range of RMS before - RMS after over blocks of one second."""
    _, block = np.unique(chosen.second, return_inverse=True)
    sums = np.array([np.bincount(block, x) for x in (chosen.before**2, chosen.after**2, np.ones_like(chosen.t))])
    if sums.shape[1] < 3 or np.array_equal(chosen.before, chosen.after):
        return 0.0, 0.0

    def gained(drawn: Index) -> Array:
        before, after, count = sums[:, drawn].sum(axis=2)
        return np.asarray(np.sqrt(before / count) - np.sqrt(after / count))

    return bootstrap_range(gained, sums.shape[1])


def slow(v: Array) -> float:
    """Return the speed below which the machine counts as standing: 2 % of its fastest."""
    return 0.02 * float(np.quantile(np.abs(v), 0.995)) if v.size else 0.0


def speed_classes(v: Array) -> Array:
    """Return edges of three speed classes with equally many moving samples, from the least that is motion."""
    moving = np.abs(v)[np.abs(v) > slow(v)]
    if moving.size < 100:
        return np.empty(0)
    return np.unique(np.quantile(moving, [0, 1 / 3, 2 / 3, 1]))


def parts(traces: Sequence[Trace]) -> tuple[Part, ...]:
    """Return the held-out proof: every recording, then standing, speed classes and directions over all of them."""
    heldout = tuple(trace for trace in traces if trace.heldout)
    whole = samples(heldout)
    rows = [part(trace.name, samples((trace,))) for trace in heldout[:4]]
    chosen = [(label, whole.where(mask), speeds) for label, mask, speeds in _masks(whole.v)]
    return (*rows, *(part(*some) for some in chosen if len(np.unique(some[1].second)) >= 3))


def _masks(v: Array) -> Iterator[tuple[str, Mask, tuple[float, float] | None]]:
    """Yield label, rows and speeds of standing, of the classes of speed, and of the directions."""
    yield "standing", np.abs(v) <= slow(v), None
    for low, high in pairwise(speed_classes(v)):
        yield "speed", (np.abs(v) > low) & (np.abs(v) <= high), (float(low), float(high))
    yield "forward", v > slow(v), None
    yield "backward", v < -slow(v), None


def bars(trace: Trace) -> tuple[Array, Array, Array]:
    """Return (edges, RMS before, RMS after) per second, or per 2, 5, 10, ... s of long recordings."""
    length = float(trace.t[-1] - trace.t[0])
    width = next((w for w in (1, 2, 5, 10, 20, 60, 120, 300, 600) if length / w <= MOST_BARS), length / MOST_BARS)
    edges = trace.t[0] + width * np.arange(int(np.ceil(length / width)) + 1)
    count, _ = np.histogram(trace.t, edges)
    power = [_summed(trace.t, residual, edges) for residual in (trace.missing, trace.tau - trace.after)]
    with np.errstate(invalid="ignore", divide="ignore"):
        before, after = (np.sqrt(p / count) for p in power)
    return edges, before, after


def _summed(t: Array, residual: Array, edges: Array) -> Array:
    return np.histogram(t, edges, weights=np.nan_to_num(residual) ** 2)[0]


def worst(trace: Trace, residual: Array, length: float = 6.0) -> tuple[float, float]:
    """Return the span of `length` seconds with the largest error."""
    judged = _judged(trace)
    if judged.t.size < 2 or judged.t[-1] - judged.t[0] <= length:
        return float(trace.t[0]), float(trace.t[-1])
    edges = np.arange(judged.t[0], judged.t[-1], 0.5)
    power = np.cumsum(np.r_[0.0, _summed(trace.t, residual, edges)])
    steps = min(int(length / 0.5), len(power) - 1)
    start = float(edges[int(np.argmax(power[steps:] - power[:-steps]))])
    return start, start + length


@dataclass(frozen=True)
class Curve:
    """Mean over bins of a coordinate with its 95 % half width; NaN where fewer than 5 samples fell."""

    x: Array
    mean: Array
    half: Array


def curve(x: Array, y: Array, edges: Array) -> Curve:
    """Bin y over x in equal bins; the half width takes one sample in 30 as independent of its neighbours."""
    bins = len(edges) - 1
    place = np.floor((x - edges[0]) * (bins / (edges[-1] - edges[0]))).astype(int)
    inside = (place >= 0) & (place < bins)
    place, y = place[inside], y[inside]
    count, first, second = (np.bincount(place, weights, bins) for weights in (np.ones_like(y), y, y**2))
    centres = 0.5 * (edges[1:] + edges[:-1])
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(count >= 5, first / count, np.nan)
        spread = np.sqrt(np.maximum(second / count - mean**2, 0))
        return Curve(centres, mean, Z95 * spread / np.sqrt(np.maximum(count / 30, 1)))


def grid(chosen: Samples, residual: Array, q_edges: Array, v_edges: Array) -> Array:
    """Return the signed mean error, shape (speeds, positions); NaN where the machine never went."""
    count = np.histogram2d(np.abs(chosen.v), chosen.q, (v_edges, q_edges))[0]
    total = np.histogram2d(np.abs(chosen.v), chosen.q, (v_edges, q_edges), weights=residual)[0]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(count >= 5, total / count, np.nan)
