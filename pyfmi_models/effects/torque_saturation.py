"""A drive that gives less than it is asked for."""

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca

from pyfmi_models.effects.base import DriveEffect, Main
from pyfmi_models.model import Recorded, Scalar, Variable, parameter

SOFTNESS = 0.02
"""Width of the knee, as a share of the knee torque."""
LEAST_KNEE = 0.1
"""A drive that saturates does so above this share of the command that is hardly ever exceeded (98 %). Past a knee the
command outgrows the need: a drive that bends at 0.3 of what is needed, with a slope of 0.4, does so at 0.15 of it."""
LEAST_SLOPE = 0.02
"""... and gives at least this share of what more is asked for, else no command gives what is needed."""


@dataclass(frozen=True, kw_only=True)
class TorqueSaturation(DriveEffect):
    """Beyond a knee only part of the commanded torque arrives, as magnets and amplifiers saturate.

        applied = command - (1 - slope) [s(command - knee) - s(-command - knee)],   s(x) = w ln(1 + exp(x/w))

    with w = 0.02 knee: the identity far below the knee, slope `slope` far above, smooth between. Beside
    `torque_limit`, which the controller knows and keeps, this is what it does not know.
    Reference: soft maximum s(x): Dugas et al., Advances in Neural Information Processing Systems 13 (2000) 472.
    """

    id: ClassVar[str] = "torque_saturation"
    at_once: ClassVar[bool] = True
    title: ClassVar[str] = "Torque saturation"
    equation: ClassVar[str] = "the drive gives less above the knee"
    main: ClassVar[Main] = Main("knee_torque", is_size=False)
    to_record: ClassVar[str] = "record the hardest acceleration that is allowed"
    rivals: ClassVar[tuple[str, ...]] = ("inertia_variation", "quadratic_drag")
    told_apart_by: ClassVar[str] = "torque is missing only where much is asked for, at any speed and position"
    action: ClassVar[str] = "Check current limit, supply voltage and torque constant of the drive at high current."
    knee_torque: Scalar = parameter("N.m", "Torque from which on the drive gives less than asked for", low=1e-6)
    slope: Scalar = parameter("1", "Share of the command that arrives beyond the knee", default=0.0, low=0, high=1)

    def applied(self, state: Any, command: Scalar) -> Scalar:
        """The equation above."""
        over, under = (soft(side * command - self.knee_torque, SOFTNESS * self.knee_torque) for side in (1, -1))
        return command - (1 - self.slope) * (over - under)

    def fit_bounds(self, variable: Variable, recorded: Recorded) -> tuple[float, float]:
        """Else a model that needs no torque at all would fit a drive that gives none."""
        low = {"knee_torque": LEAST_KNEE * recorded.torque, "slope": LEAST_SLOPE}.get(variable.name, variable.low)
        return low, variable.high

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        share = f"{100 * self.slope:.0f} % of what is asked for beyond it arrives" if self.slope else "no more arrives"
        return f"The drive saturates at {self.knee_torque:.3g} {unit}: {share}."


def soft(x: Scalar, width: Scalar) -> Scalar:
    """`width ln(1 + exp(x / width))`, without overflow."""
    return (x + ca.fabs(x)) / 2 + width * ca.log1p(ca.exp(-ca.fabs(x) / width))
