"""Friction that grows with the load on the bearing."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import casadi as ca

from pyfmi_models.effects.base import FrictionEffect, Main, Motion
from pyfmi_models.model import Scalar, parameter

LEAST_LEFT = 0.1
"""Of what goes through a gear friction takes 1 - this at most: with all of it the gear would lock."""


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
    says: ClassVar[str] = "Friction rises by {0.coulomb_per_Nm:.2g} {unit} for each {unit} of load on the axis."
    coulomb_per_Nm: Scalar = parameter("1", "Rise of the friction level per N m of load", low=0, high=10)

    def level(self, level: Scalar, motion: Motion) -> Scalar:
        """`level + c |payload|`."""
        return level + self.coulomb_per_Nm * ca.fabs(motion.payload)


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


@dataclass(frozen=True, kw_only=True)
class GearLoadFriction(LoadScaledFriction):
    """What accelerates the axis passes the teeth too: level' = level (1 + c |through| / Fc).

        through = payload + inertia_share J q'' + friction_share (friction' + all other loads)

    Both shares are 1 where the teeth feel the motor's torque, friction_share is 0 where they feel what arrives at the
    load. Neither is fitted. Friction is in `through` and `through` in friction; with a contact that slides and what
    accelerates the axis = push - taken level', which the balance of the moment gives, that is solved in closed form:

        through = given + taking c level / Fc |through|,   taking = friction_share sign v - inertia_share taken

    An effect further down the card that changes the level again is not in that balance.
    References: Wolf and Iskandar, "Extending a dynamic friction model with nonlinear viscous and thermal dependency
    for a motor and harmonic drive gear", ICRA 2018; Pagani, Legnani, Incerti, Gheza, "Evaluation and modeling of the
    friction in robotic joints considering thermal effects", J. Mechanisms Robotics 12 (2020) 021108.
    """

    equation: ClassVar[str] = "F (1 + c |torque through the gear| / Fc)"
    to_record: ClassVar[str] = "record quick starts and stops, and the same speeds without them"
    rivals: ClassVar[tuple[str, ...]] = ("torque_saturation", "position_friction", "gravity_unbalance")
    told_apart_by: ClassVar[str] = "it takes more of what brakes the axis too; a drive at its limit gives less of that"
    action: ClassVar[str] = "Look at the gear's lubrication, preload and wear; else keep it in the model."
    says: ClassVar[str] = (
        "Friction rises by {0.coulomb_per_Nm:.2g} {unit} for each {unit} through the gear, "
        "to hold a load or to move it."
    )
    feels_inertia: ClassVar[bool] = True
    coulomb_per_Nm: Scalar = parameter("1", "Rise of the friction level per N m of load", low=0, high=1 - LEAST_LEFT)
    inertia_share: Scalar = parameter("1", "Share of the axis' inertia behind the gear", low=0, high=1, fitted=False)
    friction_share: Scalar = parameter(
        "1", "Share of friction and of other loads behind the gear", default=0.0, low=0, high=1, fitted=False
    )

    def level(self, level: Scalar, motion: Motion) -> Scalar:
        """The equations above."""
        push, taken, others = motion.balance
        taking = self.friction_share * ca.sign(motion.v) - self.inertia_share * taken
        given = motion.payload + self.inertia_share * push + self.friction_share * others + taking * level
        rise = self.coulomb_per_Nm * level / self.at_level
        return level + rise * ca.fabs(given) / ca.fmax(1 - rise * taking * ca.sign(given), LEAST_LEFT)
