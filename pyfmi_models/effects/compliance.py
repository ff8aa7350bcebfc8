"""A flexible drive between two masses."""

from dataclasses import dataclass
from math import pi
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pyfmi_models.effects.base import Coupling
from pyfmi_models.model import Scalar, parameter

LEAST_DAMPING = 1e-4
"""Damping ratio that keeps the answer at the antiresonance finite."""


@dataclass(frozen=True, kw_only=True)
class Compliance(Coupling):
    """Part of the inertia hangs on a spring; the total is the card's.

        share = 1 - (fa/fr)^2,   k = J_far (2 pi fa)^2,   d = 2 zeta J_far 2 pi fa,   torque = k twist + d twist'

    From torque to encoder the axis has a zero pair at the antiresonance fa, where the far mass swings against the
    held motor, and a pole pair at the resonance fr > fa. Drive, friction, loads and encoder act on the near (motor)
    mass; the output `q_load` is the far one. Reference: Ellis, Control System Design Guide, on resonance.
    """

    id: ClassVar[str] = "compliance"
    title: ClassVar[str] = "Compliance"
    rivals: ClassVar[tuple[str, ...]] = ("delay", "actuator_lag", "backlash", "periodic_disturbance")
    told_apart_by: ClassVar[str] = "it resonates at one frequency and scales with acceleration; lag and delay do not"
    action: ClassVar[str] = "Stiffen couplings, pinion and pier; keep the controller well below the resonance."
    antiresonance_hz: Scalar = parameter(
        "Hz", "Frequency of the far mass against a held motor", low=0.1, high=1e4, tunable=False
    )
    resonance_hz: Scalar = parameter(
        "Hz", "Frequency of both masses against each other", low=0.1, high=1e4, tunable=False
    )
    damping_ratio: Scalar = parameter("1", "Damping of the antiresonance", default=0.02, low=0, high=2)

    def broken_rule(self) -> str:
        """The resonance is above the antiresonance."""
        return "" if self.resonance_hz > self.antiresonance_hz else "resonance_hz must be above antiresonance_hz"

    def share(self) -> Scalar:
        """`1 - (fa/fr)^2`."""
        return 1 - (self.antiresonance_hz / self.resonance_hz) ** 2

    def torque(self, twist: Scalar, rate: Scalar, far: Scalar) -> Scalar:
        """`k twist + d twist'`."""
        omega = 2 * pi * self.antiresonance_hz
        return far * omega * (omega * twist + 2 * self.damping_ratio * rate)

    def carried(self, omega: npt.NDArray[np.float64]) -> npt.NDArray[np.complex128]:
        """Acceleration of the far mass per near acceleration at angular frequencies omega: 1 where it is rigid."""
        own, s = 2 * pi * self.antiresonance_hz, 1j * omega
        spring = own**2 + 2 * max(float(self.damping_ratio), LEAST_DAMPING) * own * s
        return np.asarray(spring / (s**2 + spring))

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        name = "moving mass" if unit == "N" else "inertia"
        return f"{100 * self.share():.2g} % of the {name} hangs on a spring that rings at {self.resonance_hz:.3g} Hz."
