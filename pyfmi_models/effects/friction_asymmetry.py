"""Friction that differs between the two directions."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from pyfmi_models.effects.base import FrictionEffect, Main, Motion, percent
from pyfmi_models.model import Recorded, Scalar, Variable, parameter

MOST = 0.6
"""Half the relative difference where one way has four times the friction of the other: (4 - 1) / (4 + 1)."""


@dataclass(frozen=True, kw_only=True)
class FrictionAsymmetry(FrictionEffect):
    """Friction level times (1 + a sign v), viscous torque times (1 + b sign v)."""

    id: ClassVar[str] = "friction_asymmetry"
    title: ClassVar[str] = "Friction asymmetry"
    equation: ClassVar[str] = "F (1 + a sign v) + σ₂ v (1 + b sign v)"
    main: ClassVar[Main] = Main("level_asymmetry", 200.0, "%")
    to_record: ClassVar[str] = "record the same speeds in both directions"
    rivals: ClassVar[tuple[str, ...]] = ("torque_offset", "gravity_unbalance")
    told_apart_by: ClassVar[str] = "an offset also acts at standstill and does not grow with speed"
    action: ClassVar[str] = "Check brake and shaft seal for drag one way, and the bearing preload for tilt."
    action_linear: ClassVar[str] = "Check wipers and covers for drag one way, and the preload of nut and carriages."
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

    def fit_bounds(self, variable: Variable, recorded: Recorded) -> tuple[float, float]:
        """One way at most four times the other, in a fit, which else takes it away for something; a card's is kept."""
        return min(-MOST, variable.start), max(MOST, variable.start)

    def leading(self) -> Main:
        """The larger of the two."""
        viscous = abs(self.viscous_asymmetry) > abs(self.level_asymmetry)
        return self.main._replace(parameter="viscous_asymmetry", unit="% viscous") if viscous else self.main

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        sliding = _percent("sliding friction", self.level_asymmetry)
        viscous = _percent("viscous friction", self.viscous_asymmetry)
        larger, smaller = sorted((sliding, viscous), key=lambda item: -item[0])
        return f"{larger[1]}." if smaller[0] < 0.1 * larger[0] else f"{larger[1]}, {smaller[1].lower()}."


def _percent(name: str, asymmetry: float) -> tuple[float, str]:
    """How far two directions differ, as a share of their mean, and in words."""
    harder = "forward" if asymmetry > 0 else "backward"
    size = 2 * abs(asymmetry)
    return size, f"{name.capitalize()} differs by {percent(size)} between directions (of the mean; higher {harder})"
