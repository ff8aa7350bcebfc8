"""Inertia that depends on where the axis is."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from pyfmi_models.effects.base import InertiaEffect, Main, Motion, percent, times, words
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class InertiaVariation(InertiaEffect):
    """Inertia times 1 + r cos(cycles angle + phase).

    The plant adds what belongs to it: d/dt (J q') = torque + J'(q) q'^2 / 2, so that energy is kept.
    Reference: Goldstein, Classical Mechanics, section 1.4 (Lagrange's equations).
    """

    id: ClassVar[str] = "inertia_variation"
    title: ClassVar[str] = "Inertia variation"
    equation: ClassVar[str] = "J (1 + r cos(N q + φ))"
    main: ClassVar[Main] = Main("relative_amplitude", 100.0, "%")
    to_record: ClassVar[str] = "record hard accelerations at several positions"
    rivals: ClassVar[tuple[str, ...]] = ("encoder_eccentricity", "compliance", "torque_saturation")
    told_apart_by: ClassVar[str] = "it scales with the acceleration at a place; an eccentric encoder with speed squared"
    action: ClassVar[str] = "Nothing needs repair: a payload off the axis does this. Use the improved model."
    action_linear: ClassVar[str] = "Nothing needs repair: a linkage does this. Use the improved model."
    relative_amplitude: Scalar = parameter("1", "Relative amplitude of the inertia", low=0, high=0.95)
    cycles_per_rev: Scalar = parameter(
        "1", "Cycles per turn (per metre of a linear axis)", default=1.0, low=0, fitted=False
    )
    phase: Scalar = parameter("rad", "Phase at position zero", default=0.0)

    def inertia(self, inertia: Scalar, motion: Motion) -> Scalar:
        """`J (1 + r cos(cycles angle + phase))`."""
        return inertia * (1 + self.relative_amplitude * ca.cos(self.cycles_per_rev * motion.angle + self.phase))

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        known, size, often = words(unit), percent(self.relative_amplitude), times(self.cycles_per_rev)
        return f"The {known['inertia']} rises and falls by {size}, {often} per {known['turn']}."
