"""Friction that grows with the load on the bearing."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from pyfmi_models.effects.base import FrictionEffect, Motion
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class LoadDependentFriction(FrictionEffect):
    """Friction level plus c |payload|, payload being the torque of the weights on the axis at this position.

    Weights are the card's `[unbalance]` and its `gravity_unbalance` effects. Cogging, cables and the `disturbance`
    input do not count: their torque does not press on the bearing.
    Reference: Hamon, Gautier, Garrec, "Dynamic identification of robots with a dry friction model depending on load and
    velocity", IROS 2010, without its dependence on speed.
    """

    id: ClassVar[str] = "load_dependent_friction"
    title: ClassVar[str] = "Load-dependent friction"
    rivals: ClassVar[tuple[str, ...]] = ("position_friction", "gravity_unbalance")
    told_apart_by: ClassVar[str] = "it follows the load when the load is changed; a rough track stays where it is"
    action: ClassVar[str] = "Balance the axis; a bearing or gear that is loaded less rubs less."
    coulomb_per_Nm: Scalar = parameter("1", "Rise of the friction level per N m of load", low=0, high=10)

    def level(self, level: Scalar, motion: Motion) -> Scalar:
        """`level + c |payload|`."""
        return level + self.coulomb_per_Nm * ca.fabs(motion.payload)

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        return f"Friction rises by {self.coulomb_per_Nm:.2g} {unit} for each {unit} of load on the axis."
