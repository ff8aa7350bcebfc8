"""What neighbouring axes do to this one: by their acceleration, their speed and their position.

A neighbour's motion comes from outside: the plant's inputs are `neighbour_acceleration`, `neighbour_speed` and
`neighbour_position`, as far as a form reads them; of a second neighbour of the mount `neighbour_acceleration2` and so
on. In a recording they are columns of the neighbour that the word `neighbour` names; where it is empty, columns of
those names. A weight that hangs on two neighbours at once has both in that word, "q2 + q3", and reads the position of
the second one as `second_neighbour_position`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from math import sqrt
from typing import ClassVar

import casadi as ca

from pyfmi_models.effects.base import LoadEffect, Main, Motion, words
from pyfmi_models.model import Scalar, Variable, parameter, word

POSITION = Variable(name="neighbour_position", unit="rad", description="Position of the neighbouring axis")
SPEED = Variable(name="neighbour_speed", unit="rad/s", description="Speed of the neighbouring axis")
ACCELERATION = Variable(
    name="neighbour_acceleration", unit="rad/s2", description="Acceleration of the neighbouring axis"
)
SECOND = Variable(name="second_neighbour_position", unit="rad", description="Position of the second neighbouring axis")
AND = " + "
"""Between the columns of two neighbours in one word."""
PRODUCTS = tuple("".join(one) for one in product("sc", repeat=3))
"""Sine or cosine of this axis' angle, of the neighbour's and of the second one's."""


@dataclass(frozen=True, kw_only=True)
class Neighbouring(LoadEffect):
    """A torque that follows the motion of one neighbour, or of two."""

    title: ClassVar[str] = "Axis coupling"
    rivals: ClassVar[tuple[str, ...]] = ("inertia_variation", "gravity_unbalance", "periodic_disturbance")
    told_apart_by: ClassVar[str] = "hold the neighbour still: a coupling is gone then, all else stays"
    action: ClassVar[str] = "Nothing needs repair: feed the neighbour's motion forward, or use the improved model."
    to_record: ClassVar[str] = "record a neighbouring axis with it, both moving, each in its own way"
    neighbour: str = word("Column of recordings by which the neighbour is called; of two both: q2 + q3", default="")

    @property
    def neighbours(self) -> tuple[str, ...]:
        """The column of each neighbour; none where the word is empty."""
        return tuple(self.neighbour.split(AND)) if self.neighbour else ()

    def broken_rule(self) -> str:
        """The word names as many neighbours as the form has."""
        many = 1 + (SECOND in self.inputs())
        if len(self.neighbours) in (0, many):
            return ""
        return f'neighbour "{self.neighbour}" must name {("one neighbour", "two neighbours, as q2 + q3")[many - 1]}'

    def recorded_as(self) -> Mapping[str, str]:
        """The neighbours' motion, each under its name."""
        known = dict(zip(("neighbour_", "second_neighbour_"), self.neighbours, strict=False))
        return {
            one.name: f"{name} {one.name.removeprefix(start)}"
            for start, name in known.items()
            for one in self.inputs()
            if one.name.startswith(start)
        }

    @property
    def source(self) -> str:
        """The neighbour, or both."""
        return self.neighbour

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        who = "A neighbouring axis acts" if len(self.neighbours) < 2 else "Two neighbouring axes act"
        return f"{who} on this one: {', '.join(self.said(unit))}."

    def said(self, unit: str) -> list[str]:
        """Each torque in words."""
        raise TypeError(f"{type(self).__name__} says nothing")

    @property
    def called(self) -> str:
        """The neighbour in words."""
        return " and ".join(f"`{name}`" for name in self.neighbours) or "the neighbour"


@dataclass(frozen=True, kw_only=True)
class AxisCoupling(Neighbouring):
    """Inertia that both axes accelerate: torque = h a_n, a_n the acceleration of the neighbour.

    h is an element beside the diagonal of the matrix of inertias; that it changes with the angle between both is left
    out. Reference: Siciliano, Sciavicco, Villani, Oriolo, Robotics (2009), section 7.1.
    """

    id: ClassVar[str] = "axis_coupling"
    equation: ClassVar[str] = "h aₙ"
    reads: ClassVar[tuple[Variable, ...]] = (ACCELERATION,)
    main: ClassVar[Main] = Main("inertia", unit="kg.m2")
    inertia: Scalar = parameter("kg.m2", "Torque per acceleration of the neighbour", default=0.0)

    def load(self, motion: Motion) -> Scalar:
        """`h a_n`."""
        return self.inertia * motion.inputs[ACCELERATION.name]

    def said(self, unit: str) -> list[str]:
        """Each torque in words."""
        return [f"{self.inertia:.3g} {unit} per {words(unit)['way']}/s² of {self.called}"] if self.inertia else []


@dataclass(frozen=True, kw_only=True)
class DampedCoupling(AxisCoupling):
    """Inertia that both axes accelerate, and drives that drag each other: torque = h a_n + d v_n, v_n its speed."""

    equation: ClassVar[str] = "h aₙ + d vₙ"
    reads: ClassVar[tuple[Variable, ...]] = (ACCELERATION, SPEED)
    main: ClassVar[Main] = Main("damping", unit="N.m.s/rad")
    damping: Scalar = parameter("N.m.s/rad", "Torque per speed of the neighbour")

    def load(self, motion: Motion) -> Scalar:
        """`h a_n + d v_n`."""
        return super().load(motion) + self.damping * motion.inputs[SPEED.name]

    def said(self, unit: str) -> list[str]:
        """Each torque in words."""
        return [*super().said(unit), f"{self.damping:.3g} {unit} per {words(unit)['way']}/s of {self.called}"]


@dataclass(frozen=True, kw_only=True)
class WeightCoupling(AxisCoupling):
    """Inertia and a weight that both axes carry: torque = h a_n + w sin(s q + q_n + phase).

    q and q_n are the angles of both axes; s = 1 where the weight turns with both (-1 where they count the other way
    round), 0 where the neighbour alone turns it.
    """

    equation: ClassVar[str] = "h aₙ + w sin(s q + qₙ + φ)"
    reads: ClassVar[tuple[Variable, ...]] = (ACCELERATION, POSITION)
    main: ClassVar[Main] = Main("weight")
    weight: Scalar = parameter("N.m", "Weight times lever arm", low=0)
    phase: Scalar = parameter("rad", "Phase at both positions zero", default=0.0)
    follows: Scalar = parameter("1", "Turns of the weight per turn of this axis", default=1.0, fitted=False)

    def load(self, motion: Motion) -> Scalar:
        """`h a_n + w sin(s q + q_n + phase)`."""
        angle = self.follows * motion.angle + motion.inputs[POSITION.name] + self.phase
        return super().load(motion) + self.weight * ca.sin(angle)

    def said(self, unit: str) -> list[str]:
        """Each torque in words."""
        name = "difference" if self.follows < 0 else "sum"
        by = f"the {name} of both angles, this axis' and {self.called}" if self.follows else f"the angle {self.called}"
        return [*super().said(unit), f"a weight of {self.weight:.3g} {unit} that goes with {by}"]


@dataclass(frozen=True, kw_only=True)
class ChainCoupling(Neighbouring):
    """A weight behind three axes that turn about parallel lines: torque = w sin(s q + q_n + s2 q_m + phase).

    Each link of a chain in a plane turns with the sum of the angles before it; an axis that counts the other way round
    has -1, and s is 0 where this axis turns it no more. See sections 2.9.1 and 7.3.2 of what `AxisCoupling` refers to.
    """

    id: ClassVar[str] = AxisCoupling.id
    equation: ClassVar[str] = "w sin(s q + qₙ + s₂ qₘ + φ)"
    reads: ClassVar[tuple[Variable, ...]] = (POSITION, SECOND)
    main: ClassVar[Main] = Main("weight")
    weight: Scalar = parameter("N.m", "Weight times lever arm", low=0)
    phase: Scalar = parameter("rad", "Phase at all positions zero", default=0.0)
    follows: Scalar = parameter("1", "Turns of the weight per turn of this axis", default=1.0, fitted=False)
    follows_second: Scalar = parameter("1", "Turns of the weight per turn of the second neighbour", fitted=False)

    def load(self, motion: Motion) -> Scalar:
        """`w sin(s q + q_n + s2 q_m + phase)`."""
        first, second = (motion.inputs[one.name] for one in (POSITION, SECOND))
        return self.weight * ca.sin(self.follows * motion.angle + first + self.follows_second * second + self.phase)

    def said(self, unit: str) -> list[str]:
        """The torque in words."""
        first, second = (*(f"`{name}`" for name in self.neighbours), "the neighbour", "the second one")[:2]
        own = "" if not self.follows else "this axis + " if self.follows > 0 else "- this axis + "
        angle = f"{own}{first} {'-' if self.follows_second < 0 else '+'} {second}"
        return [f"a weight of {self.weight:.3g} {unit} that goes with the angle {angle}"]


@dataclass(frozen=True, kw_only=True)
class SpaceCoupling(Neighbouring):
    """A weight behind three axes that point anywhere: torque = sum over i, j, k of w_ijk f_i(q) f_j(q_n) f_k(q_m).

    f is sin or cos: each axis turns a weight's direction, so the torque is linear in sine and cosine of each angle. Of
    axes that are parallel it is a `ChainCoupling`. It is a product of rotations: section 7.3 there.
    """

    id: ClassVar[str] = AxisCoupling.id
    equation: ClassVar[str] = "Σ wᵢⱼₖ fᵢ(q) fⱼ(qₙ) fₖ(qₘ), f = sin, cos"
    reads: ClassVar[tuple[Variable, ...]] = (POSITION, SECOND)
    main: ClassVar[Main] = Main("sss")
    sss: Scalar = parameter("N.m", "Torque per sin q sin q_n sin q_m", default=0.0)
    ssc: Scalar = parameter("N.m", "Torque per sin q sin q_n cos q_m", default=0.0)
    scs: Scalar = parameter("N.m", "Torque per sin q cos q_n sin q_m", default=0.0)
    scc: Scalar = parameter("N.m", "Torque per sin q cos q_n cos q_m", default=0.0)
    css: Scalar = parameter("N.m", "Torque per cos q sin q_n sin q_m", default=0.0)
    csc: Scalar = parameter("N.m", "Torque per cos q sin q_n cos q_m", default=0.0)
    ccs: Scalar = parameter("N.m", "Torque per cos q cos q_n sin q_m", default=0.0)
    ccc: Scalar = parameter("N.m", "Torque per cos q cos q_n cos q_m", default=0.0)

    def load(self, motion: Motion) -> Scalar:
        """The sum of the eight products."""
        angles = (motion.angle, motion.inputs[POSITION.name], motion.inputs[SECOND.name])
        own, first, second = ({"s": ca.sin(one), "c": ca.cos(one)} for one in angles)
        return sum(getattr(self, i + j + k) * own[i] * first[j] * second[k] for i, j, k in map(tuple, PRODUCTS))

    def leading(self) -> Main:
        """The largest of the eight."""
        return self.main._replace(parameter=max(PRODUCTS, key=lambda one: abs(float(getattr(self, one)))))

    def said(self, unit: str) -> list[str]:
        """The largest torque that the eight can give, the root of the sum of their squares."""
        largest = sqrt(sum(float(getattr(self, one)) ** 2 for one in PRODUCTS))
        return [f"a weight of {largest:.3g} {unit} at most that goes with three angles, this axis', {self.called}"]
