"""A drive that passes little below a threshold of its command."""

from dataclasses import dataclass
from typing import Any, ClassVar

from pyfmi_models.effects.base import DriveEffect, Main
from pyfmi_models.effects.torque_saturation import soft
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class DeadBand(DriveEffect):
    """Small commands do not arrive, large ones less by the band, as where a bridge's switches wait for each other.

        applied = s(command - band) - s(-command - band),   s(x) = w ln(1 + exp(x/w)),   w = softness band

    Within the band a share 2 / (1 + exp(1/softness)) of the command arrives, so that each torque has its command.
    Reference: Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, 1996, chapter 2;
    s(x): Dugas et al., Advances in Neural Information Processing Systems 13 (2000) 472.
    """

    id: ClassVar[str] = "dead_band"
    at_once: ClassVar[bool] = True
    title: ClassVar[str] = "Dead band of the drive"
    equation: ClassVar[str] = "the drive gives nothing within the band"
    main: ClassVar[Main] = Main("band")
    to_record: ClassVar[str] = "record slow reversals and starts from rest, with the command"
    rivals: ClassVar[tuple[str, ...]] = ("torque_saturation", "stribeck", "backlash")
    told_apart_by: ClassVar[str] = "torque is missing by the same amount at every large command, whatever the motion"
    action: ClassVar[str] = "Look at the dead time of the bridge and the offset of the current sensor; compensate it."
    says: ClassVar[str] = (
        "The drive gives next to nothing for commands below {0.band:.3g} {unit}, and less by that above."
    )
    band: Scalar = parameter("N.m", "Command below which next to nothing arrives", low=1e-9)
    softness: Scalar = parameter("1", "Width of the edge, as a share of the band", default=0.25, low=0.2, high=2)

    def applied(self, state: Any, command: Scalar) -> Scalar:
        """The equation above."""
        over, under = (soft(side * command - self.band, self.softness * self.band) for side in (1, -1))
        return over - under
