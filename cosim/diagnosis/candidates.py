"""Which effects are tried, from where: small versions of each effect and the columns they would add.

A `Candidate` is one effect with its nonlinear numbers (a frequency, a place, a speed, a time) fixed by a grid or a
periodogram; its linear numbers start at zero, so its columns are the exact derivatives of the plant's own equations.
`start` turns fitted coefficients into an effect from which a joint nonlinear fit goes on.
"""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from math import atan2, hypot, pi
from typing import Any

import numpy as np

from cosim.diagnosis.inverse import Inverse, stacked
from cosim.diagnosis.prepare import Array, Prepared
from pyfmi_models.effects import (
    ActuatorLag,
    Cogging,
    Delay,
    DriveEffect,
    Effect,
    FrictionAsymmetry,
    GravityUnbalance,
    LocalFriction,
    PeriodicFriction,
    StribeckEffect,
    TorqueOffset,
)
from pyfmi_models.model import Pair
from pyfmi_models.mount import Mount

TRIED = (
    *("stribeck", "friction_asymmetry", "position_friction", "cogging", "gravity_unbalance", "torque_offset"),
    *("actuator_lag", "delay"),
)
"""Effects that a diagnosis can name; the catalogue holds more, for cards and FMUs."""
PEAKS = 3
"""Periodogram peaks that become candidates, for each periodic effect."""


@dataclass(frozen=True)
class Candidate:
    """One effect to try: zero-size instances, their linear numbers, and how to start from those."""

    effect: str
    instances: tuple[Effect, ...]
    linear: tuple[str, ...]
    start: Callable[[Array], Effect]
    shapes_excluded: bool = False
    """Whether the bank's speed shapes must make room, because they are this effect."""


@dataclass(frozen=True)
class Span:
    """What the recordings visit: enough to choose grids."""

    angle: Array
    q: Array
    v: Array
    level: Array
    residual: Array
    cutoff: float

    @property
    def top(self) -> float:
        """Highest speed."""
        return float(np.abs(self.v).max())


def candidates(
    mount: Mount, prepared: Prepared, residual: Array, level: Array, only: Collection[str] = TRIED
) -> list[Candidate]:
    """List what is worth trying of `only` these effects, given the torque residual at the kept rows."""
    q, v = prepared.stacked("q"), prepared.stacked("v")
    angle = np.asarray(mount.at(0.0, q, v).angle)
    span = Span(angle, q, v, level, residual, prepared.cutoff)
    makers = [(ids, maker) for ids, maker in _MAKERS if prepared.has_position or maker in _WITHOUT_POSITION]
    found = [c for ids, maker in makers if set(ids) & set(only) for c in maker(mount, span)]
    return [candidate for candidate in found if candidate.effect in only]


def columns_of(mount: Mount, found: Sequence[Candidate], prepared: Prepared, values: Array) -> list[Array]:
    """Columns (rows, n) of each candidate at the kept rows; `values` are the mount's own fitted numbers."""
    bent = [c for c in found if not isinstance(c.instances[0], DriveEffect)]
    extended = replace(mount, effects=(*mount.effects, *(i for c in bent for i in c.instances)))
    added = list(extended.components())[2 + len(mount.effects) :]
    names = [[f"{next_name}.{name}" for name in c.linear] for c, next_name in _labelled(bent, added)]
    flat = tuple(name for group in names for name in group)
    inverse = Inverse(extended, flat)
    start = np.array([dict(zip(inverse.names, inverse.start, strict=True))[name] for name in flat])
    slopes = stacked(inverse, prepared.pieces, start)[1] if flat else np.zeros((0, 0))
    ready = iter(_groups(slopes, bent))
    now = stacked(Inverse(mount, ()), prepared.pieces, np.zeros(0))[0]
    return [_finite(mount, c, prepared, now) if isinstance(c.instances[0], DriveEffect) else next(ready) for c in found]


def _labelled(found: Sequence[Candidate], added: Sequence[str]) -> Iterator[tuple[Candidate, str]]:
    labels = iter(added)
    for candidate in found:
        for _ in candidate.instances:
            yield candidate, next(labels)


def _groups(slopes: Array, found: Sequence[Candidate]) -> Iterator[Array]:
    first = 0
    for candidate in found:
        width = len(candidate.linear) * len(candidate.instances)
        yield slopes[:, first : first + width]
        first += width


def _finite(mount: Mount, candidate: Candidate, prepared: Prepared, now: Array) -> Array:
    """Column of a drive effect: what it does to the predicted torque as a whole."""
    changed = replace(mount, effects=(*mount.effects, *candidate.instances))
    return (stacked(Inverse(changed, ()), prepared.pieces, np.zeros(0))[0] - now)[:, None]


def _has(mount: Mount, kind: type[Any]) -> bool:
    return any(isinstance(effect, kind) for effect in mount.effects)


def _asymmetry(mount: Mount, span: Span) -> Iterator[Candidate]:
    if _has(mount, FrictionAsymmetry) or mount.friction.key == "none":
        return
    linear = ("level_asymmetry", "viscous_asymmetry")
    neutral = FrictionAsymmetry(level_asymmetry=0.0, viscous_asymmetry=0.0)

    def start(c: Array) -> Effect:
        a, b = (float(np.clip(x, -0.9, 0.9)) for x in c)
        return FrictionAsymmetry(level_asymmetry=a, viscous_asymmetry=b)

    yield Candidate("friction_asymmetry", (neutral,), linear, start)


def _offset(mount: Mount, span: Span) -> Iterator[Candidate]:
    if not _has(mount, TorqueOffset):
        start = lambda c: TorqueOffset(torque=float(c[0]))  # noqa: E731
        yield Candidate("torque_offset", (TorqueOffset(torque=0.0),), ("torque",), start)


def _unbalance(mount: Mount, span: Span) -> Iterator[Candidate]:
    if _has(mount, GravityUnbalance) or mount.motion == "linear":
        return

    def start(c: Array) -> Effect:
        return GravityUnbalance(mgl=hypot(*c), phase=atan2(c[1], c[0]))

    pair = (GravityUnbalance(mgl=0.0, phase=0.0), GravityUnbalance(mgl=0.0, phase=pi / 2))
    yield Candidate("gravity_unbalance", pair, ("mgl",), start)


def _cogging(mount: Mount, span: Span) -> Iterator[Candidate]:
    for cycles in _peaks(span, span.residual):

        def start(c: Array, cycles: float = cycles) -> Effect:
            return Cogging(cycles_per_rev=cycles, amplitude=hypot(*c), phase=atan2(-c[1], c[0]))

        pair = tuple(Cogging(cycles_per_rev=cycles, amplitude=0.0, phase=phase) for phase in (0.0, -pi / 2))
        yield Candidate("cogging", pair, ("amplitude",), start)


def _periodic_friction(mount: Mount, span: Span) -> Iterator[Candidate]:
    if mount.friction.key == "none":
        return
    for cycles in _peaks(span, span.residual * np.sign(span.v), lowest=0.3):

        def start(c: Array, cycles: float = cycles) -> Effect:
            return PeriodicFriction(
                cycles_per_rev=cycles, relative_amplitude=min(hypot(*c), 0.9), phase=atan2(-c[1], c[0])
            )

        pair = tuple(PeriodicFriction(cycles_per_rev=cycles, relative_amplitude=0.0, phase=p) for p in (0.0, -pi / 2))
        yield Candidate("position_friction", pair, ("relative_amplitude",), start)


def _rough_spot(mount: Mount, span: Span) -> Iterator[Candidate]:
    if mount.friction.key == "none" or _has(mount, LocalFriction):
        return
    low, high = np.quantile(span.q, [0.01, 0.99])
    for share in (0.03, 0.08):
        width = share * (high - low)
        for center in np.arange(low + width, high - width / 2, 1.7 * width):
            spot = LocalFriction(q_center=float(center), width=float(width), relative_amplitude=0.0)

            def start(c: Array, spot: LocalFriction = spot) -> Effect:
                return replace(spot, relative_amplitude=float(np.clip(c[0], -0.9, 15)))

            yield Candidate("position_friction", (spot,), ("relative_amplitude",), start)


def _stribeck(mount: Mount, span: Span) -> Iterator[Candidate]:
    law = mount.friction
    if mount.friction.key == "none" or getattr(law, "Fs", None) is not None or _has(mount, StribeckEffect):
        return
    level = getattr(law, "Fc", None)
    base = float(np.mean(level)) if isinstance(level, Pair) else float(level or 0.0)
    for share in (0.01, 0.03, 0.07, 0.15, 0.3):
        Vs = share * span.top

        def start(c: Array, Vs: float = Vs) -> Effect:
            return StribeckEffect(Fs=max(base + float(c[0]), 0.05 * base), Vs=Vs)

        yield Candidate("stribeck", (StribeckEffect(Fs=base, Vs=Vs),), ("Fs",), start, shapes_excluded=True)


def _timing(mount: Mount, span: Span) -> Iterator[Candidate]:
    for ms in (0.3, 1.0, 3.0, 8.0):
        for effect in (Delay(delay_ms=ms), ActuatorLag(time_constant_ms=ms)):
            if not _has(mount, type(effect)):

                def start(c: Array, effect: Effect = effect, ms: float = ms) -> Effect:
                    return _timed(effect, ms * float(c[0]))

                yield Candidate(effect.id, (effect,), ("",), start)


def _timed(effect: Effect, ms: float) -> Effect:
    ms = float(np.clip(ms, 0.03, 40))
    return Delay(delay_ms=ms) if isinstance(effect, Delay) else ActuatorLag(time_constant_ms=ms)


def _peaks(span: Span, signal: Array, lowest: float = 1.0) -> list[float]:
    """Strongest cycles per turn of a signal over angle, from a periodogram; at most `PEAKS`, well apart."""
    reach = float(np.ptp(span.angle))
    if reach <= 0:
        return []
    step, speed = 0.35 * 2 * pi / reach, float(np.median(np.abs(span.v)[np.abs(span.v) > 0.02 * span.top]))
    ratio = float(np.ptp(span.angle) / max(np.ptp(span.q), 1e-300))
    top = min(2 * pi * span.cutoff / max(speed * ratio, 1e-12), 3000 * step)
    cycles = np.arange(max(2 * pi / reach * lowest, step), max(top, 10 * step), step)
    power = np.array([_power(span, signal, float(n), ratio) for n in cycles])
    found: list[float] = []
    for index in np.argsort(power)[::-1]:
        if all(abs(cycles[index] - other) > 6 * step for other in found):
            found.append(_sharpened(span, signal, float(cycles[index]), step, ratio))
        if len(found) == PEAKS:
            break
    return found


def _power(span: Span, signal: Array, cycles: float, ratio: float) -> float:
    """Power of a signal at a number of cycles per turn, over the rows slow enough for the filter to pass them."""
    passed = np.abs(span.v) * ratio * cycles < 2 * pi * span.cutoff * 0.8
    if passed.sum() < 50:
        return 0.0
    part = signal[passed] - signal[passed].mean()
    return float(np.abs(np.exp(-1j * cycles * span.angle[passed]) @ part) ** 2 / passed.sum())


def _sharpened(span: Span, signal: Array, cycles: float, step: float, ratio: float) -> float:
    fine = cycles + step * np.linspace(-1, 1, 21)
    best = float(fine[np.argmax([_power(span, signal, float(n), ratio) for n in fine])])
    near = float(round(best))
    # Slots, teeth and rolling elements come in whole numbers: prefer one that the data cannot tell from the best.
    close = near > 0 and abs(near - best) < 0.6 * step
    return near if close and _power(span, signal, near, ratio) > 0.9 * _power(span, signal, best, ratio) else best


_Maker = Callable[[Mount, Span], Iterator[Candidate]]
_MAKERS: tuple[tuple[tuple[str, ...], _Maker], ...] = (
    (("friction_asymmetry",), _asymmetry),
    (("torque_offset",), _offset),
    (("stribeck",), _stribeck),
    (("delay", "actuator_lag"), _timing),
    (("gravity_unbalance",), _unbalance),
    (("cogging",), _cogging),
    (("position_friction",), _periodic_friction),
    (("position_friction",), _rough_spot),
)
_WITHOUT_POSITION = (_asymmetry, _offset, _stribeck, _timing)
