"""Mechanics and sensor: inertia over position, a spring in the drive, an encoder off its centre."""

from collections.abc import Iterator
from dataclasses import replace
from math import atan2, hypot, pi, sqrt

import numpy as np

from cosim.diagnosis.candidates import Candidate, Span, has
from cosim.diagnosis.families.periodogram import peaks
from cosim.diagnosis.prepare import Array
from pyfmi_models.effects import Effect
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity
from pyfmi_models.effects.inertia_variation import InertiaVariation
from pyfmi_models.mount import Mount

SHARE = 0.3
"""Share of the inertia that hangs on the spring of a middling candidate."""


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
