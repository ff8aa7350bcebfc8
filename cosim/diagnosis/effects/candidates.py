"""What a candidate is: small versions of an effect, the columns they would add, and how to start from those.

A `Candidate` is one effect with its nonlinear numbers (a frequency, a place, a speed, a time) fixed by a grid or a
periodogram; its linear numbers start at zero, so its columns are the exact derivatives of the plant's own equations.
Where an effect has no linear number (a delay, a spring) its column is what a middling size of it changes. `start` turns
fitted coefficients into an effect from which a joint nonlinear fit goes on. The folder `hypotheses` makes them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import atan2, hypot, inf, pi
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.tonal_disturbance import detectable_band
from pyfmi_models.effects import Effect, SensorEffect
from pyfmi_models.model import Pair
from pyfmi_models.mount import Mount

SHARE = 0.3
"""Share of the inertia that is behind the spring or the play of a middling candidate."""


@dataclass(frozen=True)
class Candidate:
    """One effect to try: instances, their linear numbers, and how to start from the coefficients of their columns.

    Without linear numbers there is one instance of middling size, and its coefficient counts in units of that size.
    """

    effect: str
    instances: tuple[Effect, ...]
    linear: tuple[str, ...]
    start: Callable[[Array], Effect]
    positive: bool = False
    """Whether a coefficient below zero is none of its effects, so that nothing may start from there."""

    @property
    def finite(self) -> bool:
        """Whether the column is that of a middling size."""
        return not self.linear


@dataclass(frozen=True)
class Span:
    """What the recordings visit: enough to choose grids; all at the kept rows."""

    piece: npt.NDArray[np.int64]
    """Number of the piece of each row."""
    t: Array
    angle: Array
    q: Array
    v: Array
    tau: Array
    level: Array
    residual: Array
    cutoff: float
    detectable: tuple[float, float]
    """Lowest and highest frequency [Hz] of a tone over time that could be told."""
    seconds: float
    extras: frozenset[str]
    """Columns that all recordings have beside the usual ones."""
    asked: bool
    """Whether any motion was asked for, which alone tells of timing."""
    prepared: Prepared

    @property
    def top(self) -> float:
        """Highest speed."""
        return float(np.abs(self.v).max())

    @property
    def reach(self) -> float:
        """Range of positions."""
        return self.prepared.reach


def sized(effect: Effect, low: float = -inf, high: float = inf, names: Sequence[str] = ()) -> Candidate:
    """A candidate whose coefficients are, within limits, what numbers of an effect (its main one) differ by from it."""
    linear, change = tuple(names) or (effect.main.parameter,), cast(Any, replace)

    def start(c: Array) -> Effect:
        numbers = [float(np.clip(getattr(effect, name) + one, low, high)) for name, one in zip(linear, c, strict=True)]
        return cast(Effect, change(effect, **dict(zip(linear, numbers, strict=True))))

    return Candidate(effect.id, (effect,), linear, start)


def wave(effect: Effect, sign: int = 1, low: float = 0.0, high: float = inf) -> Candidate:
    """A candidate of two phases of an effect, a quarter of a wave on or (`sign` -1) back: its size within limits."""
    size, change = effect.main.parameter, cast(Any, replace)

    def start(c: Array) -> Effect:
        found = float(np.clip(hypot(*c), low, high))
        return cast(Effect, change(effect, phase=atan2(sign * c[1], c[0]), **{size: found}))

    pair = tuple(change(effect, phase=phase, **{size: 0.0}) for phase in (0.0, sign * pi / 2))
    return Candidate(effect.id, pair, (size,), start)


def of_both_ways(value: float | Pair | None) -> float:
    """A number of a law, the mean of both directions; 0 if it has none."""
    return float(np.mean(value)) if isinstance(value, Pair) else float(value or 0.0)


def contact_level(mount: Mount) -> float:
    """Coulomb level of a friction law, the mean of both directions [N m]; 0 if it has none."""
    return of_both_ways(getattr(mount.friction, "Fc", None))


def at_own_level(effect: Effect, mount: Mount) -> Effect:
    """Return an effect with numbers relative to the level that the mount has; the fit began with the base's."""
    level = contact_level(mount)
    return effect.told_at(level) if level else effect


def has(mount: Mount, kind: type[Any]) -> bool:
    """Whether a mount holds an effect of a kind."""
    return any(isinstance(effect, kind) for effect in mount.effects)


def span_of(mount: Mount, prepared: Prepared, residual: Array, level: Array) -> Span:
    """Describe what was visited, given the torque residual and the friction level at the kept rows."""
    q, v = prepared.stacked("q"), prepared.stacked("v")
    common = frozenset.intersection(*(frozenset(piece.extras) for piece in prepared.pieces))
    return Span(
        piece=np.repeat(np.arange(len(prepared.pieces)), [len(piece.kept) for piece in prepared.pieces]),
        t=prepared.stacked("t"),
        angle=np.asarray(mount.at(0.0, q, v).angle),
        q=q,
        v=v,
        tau=prepared.stacked("tau"),
        level=level,
        residual=residual,
        cutoff=prepared.cutoff,
        detectable=detectable_band(prepared),
        seconds=max(float(piece.t[-1] - piece.t[0]) for piece in prepared.pieces),
        extras=common,
        asked=any(piece.is_asked for piece in prepared.pieces),
        prepared=prepared,
    )


def columns_of(mount: Mount, found: Sequence[Candidate], prepared: Prepared, values: Array) -> list[Array]:
    """Columns (rows, n) of each candidate at the kept rows; `values` are the mount's own fitted numbers."""
    ready: dict[int, Array] = {}
    groups: dict[str, list[int]] = {}
    for index, candidate in enumerate(found):
        if not candidate.finite:
            groups.setdefault(_group(candidate), []).append(index)
    for members in groups.values():
        columns = _derivatives(mount, [found[index] for index in members], prepared)
        ready |= dict(zip(members, columns, strict=True))
    changes = iter(_changes(mount, [candidate for candidate in found if candidate.finite], prepared))
    return [next(changes) if candidate.finite else ready[index] for index, candidate in enumerate(found)]


def _group(candidate: Candidate) -> str:
    """Effects of the moment are differentiated all at once; those with states or in the sensor by themselves.

    So are those whose inputs are other columns of the recording for each.
    """
    effect = candidate.instances[0]
    if recorded := effect.recorded_as():
        return ", ".join((candidate.effect, *recorded.values()))
    return candidate.effect if effect.states() or isinstance(effect, SensorEffect) else ""


def _derivatives(mount: Mount, found: Sequence[Candidate], prepared: Prepared) -> list[Array]:
    instances = [instance for candidate in found for instance in candidate.instances]
    extended = replace(mount, effects=(*mount.effects, *instances))
    labels = iter(list(extended.components())[2 + len(mount.effects) :])
    owners = [[next(labels) for _ in candidate.instances] for candidate in found]
    wanted = [[f"{own}.{n}" for own in group for n in c.linear] for group, c in zip(owners, found, strict=True)]
    flat = tuple(name for group in wanted for name in group)
    inverse = Inverse(extended, flat)
    slopes = stacked(inverse, prepared.pieces, inverse.present)[1]
    ends = np.cumsum([len(group) for group in wanted])[:-1]
    return np.split(slopes, ends, axis=1)


def _changes(mount: Mount, found: Sequence[Candidate], prepared: Prepared) -> list[Array]:
    """Columns of candidates without linear numbers: what each does to the predicted torque as a whole."""
    none, own = np.zeros(0), Inverse(mount, ())
    moments = [own.momentary(piece, none) for piece in prepared.pieces]
    now = _kept(prepared, [own.behind(p, m, none) for p, m in zip(prepared.pieces, moments, strict=True)])
    columns = []
    for candidate in found:
        inverse = Inverse(replace(mount, effects=(*mount.effects, *candidate.instances)), ())
        anew = candidate.instances[0].at_once
        own_moments = [inverse.momentary(piece, none) for piece in prepared.pieces] if anew else moments
        after = [inverse.behind(p, m, none) for p, m in zip(prepared.pieces, own_moments, strict=True)]
        columns.append(_kept(prepared, after) - now)
    return columns


def _kept(prepared: Prepared, columns: Sequence[Array]) -> Array:
    return np.concatenate([one[piece.kept] for piece, one in zip(prepared.pieces, columns, strict=True)])
