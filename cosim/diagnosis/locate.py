"""Where the missing torque lives: its mean over position, speed, direction, time since reversal and time, with bands.

A visit is a contiguous stay in a bin; visits, not samples, are independent, so the band comes from them.
"""

from collections.abc import Sequence

import numpy as np

from cosim.diagnosis.prepare import Array
from cosim.diagnosis.result import Region, Trace, Where
from pyfmi_models.effects import (
    Cogging,
    DriveEffect,
    Effect,
    FrictionAsymmetry,
    GravityUnbalance,
    LocalFriction,
    PeriodicFriction,
    StribeckEffect,
)
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.periodic_disturbance import PeriodicDisturbance

BINS = 40
Z95 = 1.96


def regions(traces: Sequence[Trace], after: bool, linear: bool) -> tuple[Region, ...]:
    """Mean missing torque over each coordinate, over all recordings."""
    length = "m" if linear else "rad"
    missing = np.concatenate([t.tau - (t.after if after else t.before) for t in traces])
    q, v = (np.concatenate([getattr(t, name) for t in traces]) for name in ("q", "v"))
    time = np.concatenate([t.t - t.t[0] for t in traces])
    since = np.concatenate([_since_reversal(t) for t in traces])
    top = float(np.abs(v).max())
    return (
        _region("position", length, q, missing, np.linspace(q.min(), q.max(), BINS + 1)),
        _region("speed", f"{length}/s", v, missing, top * np.linspace(-1, 1, BINS // 2 + 1)),
        _region("direction", "1", np.sign(v) * (np.abs(v) > 0.01 * top), missing, np.array([-1.5, -0.5, 0.5, 1.5])),
        _region("time since reversal", "s", since, missing, np.geomspace(1e-2, max(float(since.max()), 1.0), 17)),
        _region("time", "s", time, missing, np.linspace(0, float(time.max()), BINS // 2 + 1)),
    )


def _since_reversal(trace: Trace) -> Array:
    turned = np.flatnonzero(np.diff(np.sign(trace.v), prepend=np.sign(trace.v[0])) != 0)
    last = np.searchsorted(turned, np.arange(len(trace.v)), side="right") - 1
    starts = np.where(last >= 0, trace.t[turned[np.maximum(last, 0)]] if len(turned) else trace.t[0], trace.t[0])
    return np.asarray(trace.t - starts)


def _region(axis: str, unit: str, x: Array, missing: Array, edges: Array) -> Region:
    place = np.clip(np.digitize(x, edges) - 1, 0, len(edges) - 2)
    cells = [_cell(place == k, missing) for k in range(len(edges) - 1)]
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
    if isinstance(effect, LocalFriction):
        span = (effect.q_center - 2 * effect.width, effect.q_center + 2 * effect.width)
        return Where(axis="position", description=f"around {effect.q_center:.4g}", regions=(span,))
    if isinstance(effect, StribeckEffect):
        edge = min(2 * effect.Vs, top)
        return Where(axis="speed", description=f"slower than {edge:.2g}", regions=((-edge, edge),))
    if isinstance(effect, FrictionAsymmetry):
        return Where(axis="direction", description="both directions, differently", regions=((-1, -1), (1, 1)))
    if isinstance(effect, Cogging | PeriodicFriction | GravityUnbalance):
        return Where(axis="position", description="everywhere that was visited", regions=((low, high),))
    if isinstance(effect, Backlash):
        return Where(axis="time since reversal", description="after each reversal, until the play is crossed")
    if isinstance(effect, PeriodicDisturbance):
        return Where(axis="frequency", description=f"everywhere, at {effect.frequency_hz:.4g} Hz", regions=())
    if isinstance(effect, DriveEffect):
        return Where(axis="frequency", description="wherever the torque changes quickly", regions=())
    return Where(axis="everywhere", description="everywhere", regions=())
