"""Torque ripple locked to position."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from pyfmi_models.effects.base import LoadEffect, Motion
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class Cogging(LoadEffect):
    """Torque periodic in position, the same in both directions and at every speed.

        torque = amplitude cos(cycles angle + phase)

    The angle repeats once per turn of a rotary axis and once per metre of a linear one. A further harmonic is a
    further effect of the same kind.
    """

    id: ClassVar[str] = "cogging"
    title: ClassVar[str] = "Cogging"
    rivals: ClassVar[tuple[str, ...]] = ("position_friction", "gravity_unbalance", "encoder_eccentricity")
    told_apart_by: ClassVar[str] = "friction that depends on position changes sign with the direction; cogging does not"
    action: ClassVar[str] = "Nothing needs repair: motors with slots and magnets do this. Use the improved model."
    cycles_per_rev: Scalar = parameter("1", "Ripple cycles per turn (per metre of a linear axis)", low=0)
    amplitude: Scalar = parameter("N.m", "Half the peak-to-peak torque", low=0)
    phase: Scalar = parameter("rad", "Phase at position zero", default=0.0)

    def load(self, motion: Motion) -> Scalar:
        """`amplitude cos(cycles angle + phase)`."""
        return self.amplitude * ca.cos(self.cycles_per_rev * motion.angle + self.phase)

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        per = "metre" if unit == "N" else "turn"
        return f"The motor tugs {self.cycles_per_rev:.5g} times per {per}, {self.amplitude:.3g} {unit} each way."
