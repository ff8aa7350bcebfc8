"""A torque, a friction level or viscous friction that has no name: tables over recorded quantities, as data.

The tables are those of `learned_base.py`; what a drive does not give of its command is in `learned_drive.py`.
"""

from dataclasses import dataclass, replace
from math import log
from typing import ClassVar, Self

import casadi as ca
import numpy as np

from pyfmi_models.effects.base import FrictionEffect, LoadEffect, Motion, percent
from pyfmi_models.effects.learned_base import MotionTable
from pyfmi_models.model import Scalar, parameter, structure

TINY = 1e-12
"""Torque [N m] that keeps a quotient of two torques finite at rest, far below any friction."""


@dataclass(frozen=True, kw_only=True)
class LearnedTorque(MotionTable, LoadEffect):
    """A torque that resists: the table of the module, of `torque` coefficients, over position, speed or inputs.

        torque = share sum_k c_k cos(pi k x)

    It may take or give energy over a round trip where it goes over the speed. Constant outside the range `seen`.
    """

    id: ClassVar[str] = "learned"
    kind: ClassVar[str] = "torque"
    filled: ClassVar[str] = "torque"
    torque: tuple[float, ...] = structure("N.m", "Coefficients of the waves", low=-1e9, high=1e9)

    def load(self, motion: Motion) -> Scalar:
        """The table."""
        return self.table(motion)


@dataclass(frozen=True, kw_only=True)
class LearnedFriction(MotionTable, FrictionEffect):
    """A friction level that depends on something: level exp(table), so friction never drives.

        level exp(share sum_k c_k cos(pi k x))

    To first order the table is the relative change of the level. Constant outside the range `seen`.
    """

    id: ClassVar[str] = "learned"
    kind: ClassVar[str] = "friction"
    filled: ClassVar[str] = "level_change"
    unit_value: ClassVar[float] = log(2.0)
    in_torque: ClassVar[bool] = False
    level_change: tuple[float, ...] = structure("1", "Coefficients of the waves", low=-5, high=5)

    def level(self, level: Scalar, motion: Motion) -> Scalar:
        """`level exp(table)`."""
        return level * ca.exp(self.table(motion))

    def _sized(self, unit: str) -> str:
        return f"{percent(float(np.expm1(self.size())))} of the friction"


@dataclass(frozen=True, kw_only=True)
class LearnedViscous(MotionTable, FrictionEffect):
    """Viscous friction that depends on something: so much more or less at the speed `at_speed`.

        viscous + m                      where m = table v / at_speed has the sign of v
        viscous^2 / (viscous - m)        where it has not

    To first order both are viscous + m; the second stays above zero, so friction never drives. Constant outside the
    range `seen`.
    """

    id: ClassVar[str] = "learned"
    kind: ClassVar[str] = "viscous"
    filled: ClassVar[str] = "viscous_torque"
    at_speed: Scalar = parameter(
        "rad/s", "Speed at which the torques are told", default=1.0, low=1e-9, tunable=False, fitted=False
    )
    viscous_torque: tuple[float, ...] = structure("N.m", "Coefficients of the waves", low=-1e9, high=1e9)

    def viscous(self, viscous: Scalar, motion: Motion) -> Scalar:
        """The equations above."""
        table = self.table(motion)
        more = table * motion.v / self.at_speed
        size = ca.fabs(viscous)
        return ca.if_else(table >= 0, viscous + more, viscous * size / (size + ca.fabs(more) + TINY))

    def of_one(self) -> Self:
        """One per speed everywhere, so that a value is a coefficient of drag [N m s/rad]."""
        first = (float(self.at_speed), *[0.0] * (len(self.coefficients()) - 1))
        return replace(self, viscous_torque=first)
