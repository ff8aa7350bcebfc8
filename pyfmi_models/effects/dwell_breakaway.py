"""Contacts that settle while the axis rests."""

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca

from pyfmi_models.effects.base import FrictionEffect, Main, Motion
from pyfmi_models.model import Scalar, Variable, parameter


@dataclass(frozen=True, kw_only=True)
class DwellBreakaway(FrictionEffect):
    """Friction level that grows with the logarithm of the contact's age, and is renewed by sliding.

        level + b ln(1 + age/onset),   age' = 1 - age |v| / memory

    At rest the age is the time of rest; in steady sliding it is memory/|v|. `age` starts at 0: a fresh contact.
    References: ageing law of Dieterich, J. Geophys. Res. 84 (1979) 2161, in the form of Ruina, ibid. 88 (1983) 10359.
    """

    id: ClassVar[str] = "dwell_breakaway"
    title: ClassVar[str] = "Dwell break-away"
    equation: ClassVar[str] = "F + c ln(1 + age / t₀)"
    main: ClassVar[Main] = Main("torque_per_efold")
    to_record: ClassVar[str] = "record stops of 1, 10 and 100 s before the same move"
    rivals: ClassVar[tuple[str, ...]] = ("stribeck", "presliding")
    told_apart_by: ClassVar[str] = "the same move costs more after a longer rest; a Stribeck curve knows no rest"
    action: ClassVar[str] = "Move the axis a little before fine positioning after a long rest."
    remembers: ClassVar[tuple[Variable, ...]] = (
        Variable(name="age", unit="s", description="Age of the contact", low=0.0),
    )
    torque_per_efold: Scalar = parameter("N.m", "Rise of the break-away torque per e-fold of rest time", low=0)
    onset_s: Scalar = parameter("s", "Rest time at which the rise begins", default=0.1, low=1e-6, fitted=False)
    memory_rad: Scalar = parameter("rad", "Slip that renews the contact", default=1e-3, low=1e-9, nominal=1e-3)

    def rate(self, motion: Motion) -> Any:
        """`1 - age |v| / memory`."""
        return 1 - motion.state[0] * ca.fabs(motion.v) / self.memory_rad

    def level(self, level: Scalar, motion: Motion) -> Scalar:
        """`level + b ln(1 + age/onset)`."""
        return level + self.torque_per_efold * ca.log1p(motion.state[0] / self.onset_s)

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        tenfold = 2.302585 * self.torque_per_efold
        return f"The longer the axis rests the harder it starts: {tenfold:.2g} {unit} more for ten times the rest."
