"""Friction that differs between the two directions."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from pyfmi_models.effects.base import FrictionEffect, Motion
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class FrictionAsymmetry(FrictionEffect):
    """Friction level times (1 + a sign v), viscous torque times (1 + b sign v)."""

    id: ClassVar[str] = "friction_asymmetry"
    title: ClassVar[str] = "Friction asymmetry"
    rivals: ClassVar[tuple[str, ...]] = ("torque_offset", "gravity_unbalance")
    told_apart_by: ClassVar[str] = "an offset also acts at standstill and does not grow with speed"
    action: ClassVar[str] = "Check the clamp brake for drag, and the lip seal and bearing preload for tilt."
    level_asymmetry: Scalar = parameter("1", "Half the relative difference of the friction level", low=-0.95, high=0.95)
    viscous_asymmetry: Scalar = parameter(
        "1", "Half the relative difference of viscous friction", default=0.0, low=-0.95, high=0.95
    )

    def level(self, level: Scalar, motion: Motion) -> Scalar:
        """`level (1 + a sign v)`."""
        return level * (1 + self.level_asymmetry * ca.sign(motion.v))

    def viscous(self, viscous: Scalar, motion: Motion) -> Scalar:
        """`viscous (1 + b sign v)`."""
        return viscous * (1 + self.viscous_asymmetry * ca.sign(motion.v))

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        harder, easier = ("forward", "backward") if self.level_asymmetry > 0 else ("backward", "forward")
        return f"Friction is {200 * abs(self.level_asymmetry):.0f} % higher turning {harder} than {easier}."
