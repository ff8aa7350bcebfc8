"""What a neighbouring axis does to this one: by its acceleration, its speed and its position.

The neighbour's motion comes from outside: the plant's inputs are `neighbour_acceleration`, `neighbour_speed` and
`neighbour_position`, as far as a form reads them; of a second neighbour of the mount `neighbour_acceleration2` and so
on. In a recording they are columns of the neighbour that the word `neighbour` names; where it is empty, columns of
those names.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from pyfmi_models.effects.base import LoadEffect, Main, Motion
from pyfmi_models.model import Scalar, Variable, parameter, word

POSITION = Variable(name="neighbour_position", unit="rad", description="Position of the neighbouring axis")
SPEED = Variable(name="neighbour_speed", unit="rad/s", description="Speed of the neighbouring axis")
ACCELERATION = Variable(
    name="neighbour_acceleration", unit="rad/s2", description="Acceleration of the neighbouring axis"
)


@dataclass(frozen=True, kw_only=True)
class AxisCoupling(LoadEffect):
    """Inertia that both axes accelerate: torque = h a_n, a_n the acceleration of the neighbour.

    h is an element beside the diagonal of the matrix of inertias; that it changes with the angle between both is left
    out. Reference: Siciliano, Sciavicco, Villani, Oriolo, Robotics (2009), section 7.1.
    """

    id: ClassVar[str] = "axis_coupling"
    title: ClassVar[str] = "Axis coupling"
    equation: ClassVar[str] = "h aₙ"
    main: ClassVar[Main] = Main("inertia", unit="kg.m2")
    rivals: ClassVar[tuple[str, ...]] = ("inertia_variation", "gravity_unbalance", "periodic_disturbance")
    told_apart_by: ClassVar[str] = "hold the neighbour still: a coupling is gone then, all else stays"
    action: ClassVar[str] = "Nothing needs repair: feed the neighbour's motion forward, or use the improved model."
    to_record: ClassVar[str] = "record a neighbouring axis with it, both moving, each in its own way"
    inertia: Scalar = parameter("kg.m2", "Torque per acceleration of the neighbour", default=0.0)
    neighbour: str = word("Column of recordings by which the neighbour is called", default="")

    def inputs(self) -> tuple[Variable, ...]:
        """The neighbour's acceleration."""
        return (ACCELERATION,)

    def recorded_as(self) -> Mapping[str, str]:
        """The neighbour's motion, under its name."""
        names = {one.name: one.name.replace("neighbour_", f"{self.neighbour} ") for one in self.inputs()}
        return names if self.neighbour else {}

    @property
    def source(self) -> str:
        """The neighbour."""
        return self.neighbour

    def load(self, motion: Motion) -> Scalar:
        """`h a_n`."""
        return self.inertia * motion.inputs[ACCELERATION.name]

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        return f"A neighbouring axis acts on this one: {', '.join(self.said(unit))}."

    def said(self, unit: str) -> list[str]:
        """Each torque in words."""
        return [f"{self.inertia:.3g} {unit} per {_angle(unit)}/s² of {self.called}"] if self.inertia else []

    @property
    def called(self) -> str:
        """The neighbour in words."""
        return f"`{self.neighbour}`" if self.neighbour else "the neighbour"


@dataclass(frozen=True, kw_only=True)
class DampedCoupling(AxisCoupling):
    """Inertia that both axes accelerate, and drives that drag each other: torque = h a_n + d v_n, v_n its speed."""

    equation: ClassVar[str] = "h aₙ + d vₙ"
    main: ClassVar[Main] = Main("damping", unit="N.m.s/rad")
    damping: Scalar = parameter("N.m.s/rad", "Torque per speed of the neighbour")

    def inputs(self) -> tuple[Variable, ...]:
        """The neighbour's acceleration and speed."""
        return (ACCELERATION, SPEED)

    def load(self, motion: Motion) -> Scalar:
        """`h a_n + d v_n`."""
        return super().load(motion) + self.damping * motion.inputs[SPEED.name]

    def said(self, unit: str) -> list[str]:
        """Each torque in words."""
        return [*super().said(unit), f"{self.damping:.3g} {unit} per {_angle(unit)}/s of {self.called}"]


@dataclass(frozen=True, kw_only=True)
class WeightCoupling(AxisCoupling):
    """Inertia and a weight that both axes carry: torque = h a_n + w sin(s q + q_n + phase).

    q and q_n are the angles of both axes; s = 1 where the weight turns with both (-1 where they count the other way
    round), 0 where the neighbour alone turns it.
    """

    equation: ClassVar[str] = "h aₙ + w sin(s q + qₙ + φ)"
    main: ClassVar[Main] = Main("weight")
    weight: Scalar = parameter("N.m", "Weight times lever arm", low=0)
    phase: Scalar = parameter("rad", "Phase at both positions zero", default=0.0)
    follows: Scalar = parameter("1", "Turns of the weight per turn of this axis", default=1.0, fitted=False)

    def inputs(self) -> tuple[Variable, ...]:
        """The neighbour's acceleration and position."""
        return (ACCELERATION, POSITION)

    def load(self, motion: Motion) -> Scalar:
        """`h a_n + w sin(s q + q_n + phase)`."""
        angle = self.follows * motion.angle + motion.inputs[POSITION.name] + self.phase
        return super().load(motion) + self.weight * ca.sin(angle)

    def said(self, unit: str) -> list[str]:
        """Each torque in words."""
        name = "difference" if self.follows < 0 else "sum"
        by = f"the {name} of both angles, this axis' and {self.called}" if self.follows else f"the angle {self.called}"
        return [*super().said(unit), f"a weight of {self.weight:.3g} {unit} that goes with {by}"]


def _angle(unit: str) -> str:
    return "m" if unit == "N" else "rad"
