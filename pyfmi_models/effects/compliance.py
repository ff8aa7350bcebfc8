"""A flexible drive between two masses, with the encoder on the motor or on the load."""

from dataclasses import dataclass
from math import pi
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pyfmi_models.effects.base import Coupling, Effect, Main, Transmission, percent, words
from pyfmi_models.model import Scalar, parameter

LEAST_DAMPING = 1e-4
"""Damping ratio that keeps the answer at the antiresonance finite."""
LEAST_SHARE = 0.01
"""A fit keeps at least this share of the inertia on the spring: below it there is none, and fr = fa."""


@dataclass(frozen=True, kw_only=True)
class _Compliance(Effect):
    id: ClassVar[str] = "compliance"
    title: ClassVar[str] = "Compliance"
    equation: ClassVar[str] = "two masses on a spring: antiresonance, resonance"
    main: ClassVar[Main] = Main("resonance_hz", unit="Hz", is_size=False)
    to_record: ClassVar[str] = "record fast sweeps up to 40 Hz"
    rivals: ClassVar[tuple[str, ...]] = ("delay", "actuator_lag", "backlash", "periodic_disturbance")
    told_apart_by: ClassVar[str] = "it resonates at one frequency and scales with acceleration; lag and delay do not"
    action: ClassVar[str] = "Stiffen coupling, gear and frame; keep the controller well below the resonance."
    action_linear: ClassVar[str] = "Stiffen coupling, screw bearings and nut; keep the controller below the resonance."


@dataclass(frozen=True, kw_only=True)
class Compliance(_Compliance, Coupling):
    """The encoder is on the motor: part of the inertia hangs behind it on a spring; the total is the card's.

        share = 1 - (fa/fr)^2,   k = J_far (2 pi fa)^2,   d = 2 zeta J_far 2 pi fa,   torque = k twist + d twist'

    From torque to encoder the axis has a zero pair at the antiresonance fa, where the far mass swings against the
    held motor, and a pole pair at the resonance fr > fa. Drive, friction, loads and encoder act on the near (motor)
    mass; the output `q_load` is the far one. With the encoder on the far mass take `LoadSideCompliance`.
    Reference: Ellis, Control System Design Guide, on resonance.
    """

    ordered: ClassVar[tuple[tuple[str, str, float], ...]] = (
        ("antiresonance_hz", "resonance_hz", (1 - LEAST_SHARE) ** -0.5),
    )
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
        hangs = f"{percent(self.share())} of the {words(unit)['inertia']} hangs on a spring"
        return f"{hangs} that rings at {self.resonance_hz:.3g} Hz."


@dataclass(frozen=True, kw_only=True)
class LoadSideCompliance(_Compliance, Transmission):
    """The encoder is on the load: the motor drives the axis through a spring; both together have the card's inertia.

        J_axis = encoder_share J,   J_motor = J - J_axis,   twist = motor - axis,   w = 2 pi fr
        torque = k (twist + (2 zeta / w) twist'),   k = w^2 J_motor J_axis / J
        J_motor motor'' = applied - torque,   J_axis q'' = torque - friction - loads

    The drive acts on the motor, all else on the axis, where the encoder is; the output `q_motor` is the motor. From
    torque to encoder there is no zero pair, only the pole pair at the resonance fr. Slow motion needs
    J q'' + J q'''' / w^2, whatever the shares: a recording tells the resonance. The share of the axis, and with it the
    antiresonance fr sqrt(1 - encoder_share), is told only by what friction and loads add to that, (friction)'' /
    (encoder_share w^2), so a fit leaves it as it is; one half is a fair guess. With the encoder on the motor take
    `Compliance`. Reference: Ellis, Control System Design Guide, on resonance.
    """

    says: ClassVar[str] = (
        "The motor turns the axis through a spring: both ring against each other at {0.resonance_hz:.3g} Hz."
    )
    resonance_hz: Scalar = parameter(
        "Hz", "Frequency of both masses against each other", low=0.1, high=1e4, tunable=False
    )
    encoder_share: Scalar = parameter(
        "1",
        "Share of the inertia on the side of the encoder",
        low=0.05,
        high=0.95,
        nominal=0.5,
        tunable=False,
        fitted=False,
    )
    damping_ratio: Scalar = parameter("1", "Damping of the resonance", default=0.02, low=0, high=2)

    def share(self) -> Scalar:
        """`encoder_share`."""
        return self.encoder_share

    def antiresonance_hz(self) -> Scalar:
        """Frequency of the axis against a held motor, `fr sqrt(1 - encoder_share)`: a motor's encoder would see it."""
        return self.resonance_hz * (1 - self.encoder_share) ** 0.5

    def torque(self, twist: Scalar, rate: Scalar, far: Scalar) -> Scalar:
        """`k twist + d twist'`."""
        omega = 2 * pi * self.resonance_hz
        return far * (1 - self.encoder_share) * omega * (omega * twist + 2 * self.damping_ratio * rate)

    def demand(self, omega: npt.NDArray[np.float64]) -> npt.NDArray[np.complex128]:
        """`1 + J_motor s^2 / (k + d s)`."""
        s = 1j * omega / (2 * pi * self.resonance_hz)
        return np.asarray(1 + s**2 / (self.encoder_share * (1 + 2 * self.damping_ratio * s)))
