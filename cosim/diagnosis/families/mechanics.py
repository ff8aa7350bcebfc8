"""Mechanics and sensor: inertia over position, a spring or play in the drive, an encoder off its centre."""

from collections.abc import Iterator
from dataclasses import replace
from math import atan2, hypot, pi, sqrt

import numpy as np

from cosim.diagnosis.candidates import Candidate, Span, has
from cosim.diagnosis.families.periodogram import peaks
from cosim.diagnosis.play import far_torques
from cosim.diagnosis.prepare import Array
from pyfmi_models.effects import Effect
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity
from pyfmi_models.effects.inertia_variation import InertiaVariation
from pyfmi_models.model import Pair
from pyfmi_models.mount import Mount

SHARE = 0.3
"""Share of the inertia that is behind the spring or the play of a middling candidate."""
GAPS = np.geomspace(1e-4, 1e-2, 10)
"""Gaps that are looked at, relative to the motion ..."""
COASTING = np.geomspace(0.03, 1.0, 11)
"""... and decelerations by its own friction of what is behind them, relative to the RMS of the acceleration: a far side
that slows down more than the near one never leaves its flank."""
PROPORTIONAL = ("load_share", "load_friction", "load_viscous")
"""Numbers of a play that its torque is proportional to: the motion of the far side stays."""
BEST = 4
"""Plays on that grid that become candidates."""


def inertia(mount: Mount, span: Span) -> Iterator[Candidate]:
    """Once and twice a turn."""
    if has(mount, InertiaVariation) or mount.motion == "linear":
        return
    for cycles in (1.0, 2.0):

        def start(c: Array, cycles: float = cycles) -> Effect:
            size = float(np.clip(hypot(*c), 1e-6, 0.9))
            return InertiaVariation(relative_amplitude=size, cycles_per_rev=cycles, phase=atan2(-c[1], c[0]))

        phases = (0.0, -pi / 2)
        pair = tuple(InertiaVariation(relative_amplitude=0.0, cycles_per_rev=cycles, phase=p) for p in phases)
        yield Candidate("inertia_variation", pair, ("relative_amplitude",), start)


def springs(mount: Mount, span: Span) -> Iterator[Candidate]:
    """Antiresonances inside the band and a little above."""
    if has(mount, Compliance):
        return
    for hertz in np.geomspace(min(6.0, span.cutoff / 2), 1.2 * span.cutoff, 7):
        middling = _spring(float(hertz), SHARE)

        def start(c: Array, hertz: float = float(hertz)) -> Effect:
            return _spring(hertz, float(np.clip(SHARE * c[0], 0.02, 0.8)))

        yield Candidate("compliance", (middling,), (), start)


def _spring(hertz: float, share: float) -> Compliance:
    return Compliance(antiresonance_hz=hertz, resonance_hz=hertz / sqrt(1 - share))


def plays(mount: Mount, span: Span) -> Iterator[Candidate]:
    """Plays of a grid that look most like the residual; it is fine, as what happens in a gap happens or does not."""
    if has(mount, Backlash):
        return
    level, viscous = (_mean(getattr(mount.friction, name, None)) for name in ("Fc", "sigma2"))
    ratio = float(f"{viscous / level:.1g}") if level else 0.0
    size = float(np.sqrt(np.mean(span.prepared.stacked("a") ** 2)))
    numbers = [(float(gap) * span.reach, float(slowing) * size) for gap in GAPS for slowing in COASTING]
    columns = far_torques(span.prepared, tuple(numbers), ratio)
    for index in np.argsort(_alike(columns, span))[: -BEST - 1 : -1]:
        gap, slowing = numbers[index]
        far = SHARE * float(mount.axis.inertia)
        middling = Backlash(
            gap_rad=gap, load_share=SHARE, load_friction=far * slowing, load_viscous=far * slowing * ratio
        )

        def start(c: Array, middling: Backlash = middling) -> Effect:
            times = float(np.clip(c[0], 0.1, 0.8 / SHARE))
            return replace(middling, **{name: times * getattr(middling, name) for name in PROPORTIONAL})

        yield Candidate("backlash", (middling,), (), start)


def _alike(columns: Array, span: Span) -> Array:
    """Share of the residual that each column explains, beyond what inertia and friction may."""
    v, a = span.v, span.prepared.stacked("a")
    base = np.column_stack([a, v, np.tanh(v / (0.01 * span.top)), np.ones_like(v)])
    own = columns - base @ np.linalg.lstsq(base, columns, rcond=None)[0]
    return np.asarray((own.T @ span.residual) ** 2 / np.maximum((own**2).sum(0), 1e-300))


def _mean(value: float | Pair | None) -> float:
    return float(np.mean(value)) if isinstance(value, Pair) else float(value or 0.0)


def eccentricity(mount: Mount, span: Span) -> Iterator[Candidate]:
    """Cycles over angle of what grows with the square of the speed."""
    if has(mount, EncoderEccentricity):
        return
    fast = replace(span, residual=span.residual * (span.v / span.top) ** 2)
    for cycles in peaks(fast, fast.residual):

        def start(c: Array, cycles: float = cycles) -> Effect:
            return EncoderEccentricity(cycles_per_rev=cycles, amplitude_rad=hypot(*c), phase=atan2(c[1], c[0]))

        pair = tuple(EncoderEccentricity(cycles_per_rev=cycles, amplitude_rad=0.0, phase=p) for p in (0.0, pi / 2))
        yield Candidate("encoder_eccentricity", pair, ("amplitude_rad",), start)
