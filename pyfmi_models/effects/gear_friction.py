"""Friction of a gear, which grows with the torque through its teeth."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from pyfmi_models.effects.base import FrictionEffect, Main, Motion
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class GearFriction(FrictionEffect):
    """A strain-wave or cycloid gear: friction level plus c |load|, another c when it drives and when it is driven.

        level + [driving (|load| + load s) + driven (|load| - load s)] / 2,   s = sign v

    It drives where the load resists the motion (lifting), and is driven where the load helps it (lowering); at rest
    the level is the mean of both. Slowly lifting, 1 / (1 + driving) of the drive's work arrives; slowly lowering, 1 -
    driven of the load's; from driven = 1 on the gear holds its load by itself. With both alike it is
    `LoadDependentFriction`. The load is the torque of the weights on the axis and of a known load; what accelerates
    the axis passes the teeth too and is left out, as in experiments at steady speed.
    References: Dohring, Lee, Newman, "A load-dependent transmission friction model: theory and experiments", ICRA
    1993; by direction: Duclusaud, Passault, Padois, Ly, "Extended friction models for the physics simulation of servo
    actuators", arXiv 2410.08650 (2024).
    """

    id: ClassVar[str] = "gear_friction"
    title: ClassVar[str] = "Gear friction"
    equation: ClassVar[str] = "F + c |load|, c by whether it drives or is driven"
    main: ClassVar[Main] = Main("driving", 100.0, "% of the load")
    to_record: ClassVar[str] = "record lifting and lowering at the same steady speeds, with two different loads"
    rivals: ClassVar[tuple[str, ...]] = ("load_dependent_friction", "friction_asymmetry", "gravity_unbalance")
    told_apart_by: ClassVar[str] = "lifting and lowering differ, whichever way that is; an asymmetry keeps its way"
    action: ClassVar[str] = "Balance the axis; look at the gear's lubrication, preload and wear."
    driving: Scalar = parameter("1", "Rise of the friction level per N m that the gear lifts", low=0, high=10)
    driven: Scalar = parameter("1", "Rise of the friction level per N m that the gear lowers", low=0, high=10)

    def level(self, level: Scalar, motion: Motion) -> Scalar:
        """The equation above."""
        load, along = ca.fabs(motion.payload), motion.payload * ca.sign(motion.v)
        return level + (self.driving * (load + along) + self.driven * (load - along)) / 2

    def leading(self) -> Main:
        """The larger of the two."""
        return self.main._replace(parameter="driven") if self.driven > self.driving else self.main

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        rise = f"by {self.driving:.2g} {unit} for each {unit} that it lifts and {self.driven:.2g} that it lowers"
        holds = "; it holds its load by itself" if self.driven >= 1 else ""
        return f"The gear's friction rises {rise}{holds}."
