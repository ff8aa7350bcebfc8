"""Torques beside friction, and what a drive withholds."""

from collections.abc import Iterator
from math import atan2, hypot, pi

import numpy as np

from cosim.diagnosis.candidates import Candidate, Span, has
from cosim.diagnosis.families.periodogram import peaks, tones
from cosim.diagnosis.prepare import Array
from pyfmi_models.effects import Cogging, Effect, GravityUnbalance, TorqueOffset
from pyfmi_models.effects.cable_wrap import CableWrap
from pyfmi_models.effects.periodic_disturbance import PeriodicDisturbance
from pyfmi_models.effects.quadratic_drag import QuadraticDrag
from pyfmi_models.effects.torque_saturation import TorqueSaturation
from pyfmi_models.mount import Mount


def offset(mount: Mount, span: Span) -> Iterator[Candidate]:
    """A constant."""
    if not has(mount, TorqueOffset):
        start = lambda c: TorqueOffset(torque=float(c[0]))  # noqa: E731
        yield Candidate("torque_offset", (TorqueOffset(torque=0.0),), ("torque",), start)


def unbalance(mount: Mount, span: Span) -> Iterator[Candidate]:
    """Once per turn."""
    if has(mount, GravityUnbalance) or mount.motion == "linear":
        return

    def start(c: Array) -> Effect:
        return GravityUnbalance(mgl=hypot(*c), phase=atan2(c[1], c[0]))

    pair = (GravityUnbalance(mgl=0.0, phase=0.0), GravityUnbalance(mgl=0.0, phase=pi / 2))
    yield Candidate("gravity_unbalance", pair, ("mgl",), start)


def cogging(mount: Mount, span: Span) -> Iterator[Candidate]:
    """Strongest cycles of the torque."""
    for cycles in peaks(span, span.residual):

        def start(c: Array, cycles: float = cycles) -> Effect:
            return Cogging(cycles_per_rev=cycles, amplitude=hypot(*c), phase=atan2(-c[1], c[0]))

        pair = tuple(Cogging(cycles_per_rev=cycles, amplitude=0.0, phase=phase) for phase in (0.0, -pi / 2))
        yield Candidate("cogging", pair, ("amplitude",), start)


def disturbance(mount: Mount, span: Span) -> Iterator[Candidate]:
    """Tones that stand out most from the torque; their phase is each recording's own."""
    for hertz in tones(span, span.residual):

        def start(c: Array, hertz: float = hertz) -> Effect:
            return PeriodicDisturbance(frequency_hz=hertz, amplitude=max(float(c[0]), 1e-12))

        still = PeriodicDisturbance(frequency_hz=hertz, amplitude=0.0)
        yield Candidate("periodic_disturbance", (still,), ("amplitude",), start)


def cable(mount: Mount, span: Span) -> Iterator[Candidate]:
    """A spring, even or hardening, whose home is where its torque vanishes: two homes span them all."""
    if has(mount, CableWrap):
        return
    homes = [float(home) for home in np.quantile(span.q, [0.1, 0.9])]
    for hardening in (0.0, 4.0 / span.reach**2):

        def start(c: Array, hardening: float = hardening) -> Effect:
            stiffness = float(c[0] + c[1])
            home = float(c @ homes) / stiffness if stiffness > 0 else float(np.mean(homes))
            home = float(np.clip(home, *_beside(span)))
            return CableWrap(stiffness=max(stiffness, 1e-9), home=home, hardening=hardening)

        pair = tuple(CableWrap(stiffness=0.0, home=home, hardening=hardening) for home in homes)
        yield Candidate("cable_wrap", pair, ("stiffness",), start)


def _beside(span: Span) -> tuple[float, float]:
    """Positions visited, and as much again on either side."""
    return float(span.q.min()) - span.reach, float(span.q.max()) + span.reach


def drag(mount: Mount, span: Span) -> Iterator[Candidate]:
    """Torque over the square of the speed."""
    if not has(mount, QuadraticDrag):
        start = lambda c: QuadraticDrag(coefficient=max(float(c[0]), 1e-9))  # noqa: E731
        yield Candidate("quadratic_drag", (QuadraticDrag(coefficient=0.0),), ("coefficient",), start)


def saturation(mount: Mount, span: Span) -> Iterator[Candidate]:
    """Knees below the highest torques that were asked for."""
    if has(mount, TorqueSaturation):
        return
    for share in (0.8, 0.9, 0.96, 0.985):
        knee = float(np.quantile(np.abs(span.tau), share))
        if knee > 0:

            def start(c: Array, knee: float = knee) -> Effect:
                return TorqueSaturation(knee_torque=knee, slope=float(np.clip(1 + c[0], 0.02, 0.98)))

            yield Candidate("torque_saturation", (TorqueSaturation(knee_torque=knee, slope=1.0),), ("slope",), start)
