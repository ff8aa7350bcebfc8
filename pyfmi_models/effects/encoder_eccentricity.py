"""An encoder disc off its centre."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from pyfmi_models.effects.base import Main, Motion, SensorEffect, times, words
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class EncoderEccentricity(SensorEffect):
    """Reading error once and twice per encoder turn.

        reading = q + A sin(a) + second A sin(2 a),   a = cycles angle + phase

    The output `q` is the reading, `q_true` the position. With the loop closed the machine follows the wrong reading,
    so the torque carries J A (cycles v)^2. A disc of radius R that is off by e errs by A = e/R.
    Reference: Heidenhain, Angle Encoders without Integral Bearing, on measuring accuracy.
    """

    id: ClassVar[str] = "encoder_eccentricity"
    title: ClassVar[str] = "Encoder eccentricity"
    equation: ClassVar[str] = "reading = q + e₁ sin(N q + φ) + e₂ sin 2(N q + φ)"
    main: ClassVar[Main] = Main("amplitude_rad", unit="rad")
    to_record: ClassVar[str] = "record at least one whole turn at two speeds"
    rivals: ClassVar[tuple[str, ...]] = ("cogging", "inertia_variation", "gravity_unbalance")
    told_apart_by: ClassVar[str] = "its torque grows with the square of the speed; that of cogging does not"
    action: ClassVar[str] = "Centre the encoder disc, or add a second read head opposite the first."
    action_linear: ClassVar[str] = "Check how the encoder sits on the screw or motor shaft, or read a linear scale."
    cycles_per_rev: Scalar = parameter(
        "1", "Encoder turns per axis turn (per metre of a linear axis)", low=0, fitted=False
    )
    amplitude_rad: Scalar = parameter("rad", "Amplitude of the error once per encoder turn", low=0, nominal=1e-4)
    phase: Scalar = parameter("rad", "Phase at position zero", default=0.0)
    second: Scalar = parameter("1", "Error twice per encoder turn, relative", default=0.0, low=-10, high=10)

    def reading(self, reading: Scalar, motion: Motion) -> Scalar:
        """`reading + A sin(a) + second A sin(2 a)`."""
        a = self.cycles_per_rev * motion.angle + self.phase
        return reading + self.amplitude_rad * (ca.sin(a) + self.second * ca.sin(2 * a))

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        known, often = words(unit), times(self.cycles_per_rev)
        return f"The encoder errs by {self.amplitude_rad:.2g} {known['way']} either way, {often} per {known['turn']}."
