"""Friction that grows with the load on the bearing."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import casadi as ca

from pyfmi_models.effects.base import FrictionEffect, Main, Motion
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
    equation: ClassVar[str] = "F + c |load|"
    main: ClassVar[Main] = Main("coulomb_per_Nm", 100.0, "% of the load")
    to_record: ClassVar[str] = "record with two different loads"
    rivals: ClassVar[tuple[str, ...]] = ("position_friction", "gravity_unbalance")
    told_apart_by: ClassVar[str] = "it follows the load when the load is changed; a rough track stays where it is"
    action: ClassVar[str] = "Balance the axis; a bearing or gear that is loaded less rubs less."
    action_linear: ClassVar[str] = "Relieve the guides; a guide or nut that is loaded less rubs less."
    coulomb_per_Nm: Scalar = parameter("1", "Rise of the friction level per N m of load", low=0, high=10)

    def level(self, level: Scalar, motion: Motion) -> Scalar:
        """`level + c |payload|`."""
        return level + self.coulomb_per_Nm * ca.fabs(motion.payload)

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        return f"Friction rises by {self.coulomb_per_Nm:.2g} {unit} for each {unit} of load on the axis."


@dataclass(frozen=True, kw_only=True)
class LoadScaledFriction(LoadDependentFriction):
    """The whole friction level grows with the load, its Stribeck part too: level (1 + c |payload| / Fc).

    The same as `LoadDependentFriction` where nothing falls with speed. `at_level` is the Fc at which c is told; it is
    not fitted.
    Reference: Bittencourt and Gunnarsson, "Static friction in a robot joint - modeling and identification of load and
    temperature effects", J. Dyn. Sys. Meas. Control 134 (2012) 051013: Coulomb and Stribeck parts both rise with load.
    """

    at_level: Scalar = parameter(
        "N.m", "Coulomb level at which the rise is told", low=1e-9, nominal=1, tunable=False, fitted=False
    )

    def level(self, level: Scalar, motion: Motion) -> Scalar:
        """`level (1 + c |payload| / at_level)`."""
        return level * (1 + self.coulomb_per_Nm * ca.fabs(motion.payload) / self.at_level)

    def told_at(self, level: float) -> Self:
        """Return the same friction, its rise given at another Coulomb level [N m]."""
        rise = float(self.coulomb_per_Nm) * level / float(self.at_level)
        return replace(self, coulomb_per_Nm=rise, at_level=level)
