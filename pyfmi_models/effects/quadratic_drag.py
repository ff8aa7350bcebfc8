"""Drag that grows with the square of the speed."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from pyfmi_models.effects.base import LoadEffect, Main, Motion
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class QuadraticDrag(LoadEffect):
    """Turbulent drag of air or oil: torque = c v |v|.

    Reference: Hoerner, Fluid-Dynamic Drag, 1965, chapter 1; c holds density, area and lever arm.
    """

    id: ClassVar[str] = "quadratic_drag"
    title: ClassVar[str] = "Quadratic drag"
    equation: ClassVar[str] = "c v |v|"
    main: ClassVar[Main] = Main("coefficient", unit="N.m.s2/rad2")
    to_record: ClassVar[str] = "record the highest speed that is allowed"
    rivals: ClassVar[tuple[str, ...]] = ("thermal_viscosity", "stribeck")
    told_apart_by: ClassVar[str] = "drag is the same early and late; friction that warms up is not"
    action: ClassVar[str] = "Look at covers, fans and oil that is churned; at high speed use the improved model."
    action_linear: ClassVar[str] = "Look at bellows and covers that pump air; at high speed use the improved model."
    says: ClassVar[str] = "Drag grows with the square of the speed, {0.coefficient:.3g} {unit} at 1 {speed}."
    coefficient: Scalar = parameter("N.m.s2/rad2", "Torque per square of the speed", low=0)

    def load(self, motion: Motion) -> Scalar:
        """`c v |v|`."""
        return self.coefficient * motion.v * ca.fabs(motion.v)
