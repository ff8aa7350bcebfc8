"""A load off the axis."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from pyfmi_models.effects.base import Main, Motion, PayloadEffect
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class GravityUnbalance(PayloadEffect):
    """Weight of a load off the axis: torque = mgl sin(angle + phase), resisting."""

    id: ClassVar[str] = "gravity_unbalance"
    title: ClassVar[str] = "Gravity unbalance"
    equation: ClassVar[str] = "mgl sin(q + φ)"
    main: ClassVar[Main] = Main("mgl")
    to_record: ClassVar[str] = "record at least half a turn, slowly, with stops"
    rivals: ClassVar[tuple[str, ...]] = ("torque_offset", "encoder_eccentricity", "cable_wrap", "cogging")
    told_apart_by: ClassVar[str] = (
        "an off-centre load needs holding torque at standstill; an off-centre encoder does not"
    )
    action: ClassVar[str] = "Balance the axis until it stays where it is left; otherwise use the improved model."
    action_linear: ClassVar[str] = "Look for what hangs on the carriage; otherwise use the improved model."
    says: ClassVar[str] = "The axis is out of balance by {0.mgl:.3g} {unit}."
    mgl: Scalar = parameter("N.m", "Weight times lever arm", low=0)
    phase: Scalar = parameter("rad", "Phase at position zero", default=0.0)

    def load(self, motion: Motion) -> Scalar:
        """`mgl sin(angle + phase)`."""
        return self.mgl * ca.sin(motion.angle + self.phase)
