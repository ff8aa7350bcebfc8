"""A drive that gives less than it is asked for."""

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca

from pyfmi_models.effects.base import DriveEffect
from pyfmi_models.model import Scalar, parameter

SOFTNESS = 0.02
"""Width of the knee, as a share of the knee torque."""


@dataclass(frozen=True, kw_only=True)
class TorqueSaturation(DriveEffect):
    """Beyond a knee only part of the commanded torque arrives, as magnets and amplifiers saturate.

        applied = command - (1 - slope) [s(command - knee) - s(-command - knee)],   s(x) = w ln(1 + exp(x/w))

    with w = 0.02 knee: the identity far below the knee, slope `slope` far above, smooth between. Beside
    `torque_limit`, which the controller knows and keeps, this is what it does not know.
    Reference: soft maximum s(x): Dugas et al., Advances in Neural Information Processing Systems 13 (2000) 472.
    """

    id: ClassVar[str] = "torque_saturation"
    title: ClassVar[str] = "Torque saturation"
    rivals: ClassVar[tuple[str, ...]] = ("inertia_variation", "quadratic_drag")
    told_apart_by: ClassVar[str] = "torque is missing only where much is asked for, at any speed and position"
    action: ClassVar[str] = "Check current limit, supply voltage and torque constant of the drive at high current."
    knee_torque: Scalar = parameter("N.m", "Torque from which on the drive gives less than asked for", low=1e-6)
    slope: Scalar = parameter("1", "Share of the command that arrives beyond the knee", default=0.0, low=0, high=1)

    def applied(self, state: Any, command: Scalar) -> Scalar:
        """The equation above."""
        over, under = (_soft(side * command - self.knee_torque, SOFTNESS * self.knee_torque) for side in (1, -1))
        return command - (1 - self.slope) * (over - under)

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        share = f"{100 * self.slope:.0f} % of what is asked for beyond it arrives" if self.slope else "no more arrives"
        return f"The drive saturates at {self.knee_torque:.3g} {unit}: {share}."


def _soft(x: Scalar, width: Scalar) -> Scalar:
    """`width ln(1 + exp(x / width))`, without overflow."""
    return (x + ca.fabs(x)) / 2 + width * ca.log1p(ca.exp(-ca.fabs(x) / width))
