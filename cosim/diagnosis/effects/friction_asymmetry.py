"""Friction that differs between the two directions."""

from collections.abc import Iterator
from typing import ClassVar

from cosim.diagnosis.answer.result import Where
from cosim.diagnosis.effects.base import RESTLESS, Hypothesis
from cosim.diagnosis.effects.candidates import Candidate, Span, has, sized
from cosim.estimation.prepare import Prepared
from pyfmi_models.effects import FrictionAsymmetry, TorqueOffset
from pyfmi_models.effects.constant_force import ConstantForce
from pyfmi_models.mount import Mount


class Asymmetry(Hypothesis[FrictionAsymmetry]):
    """Level and viscous friction at once."""

    forms = (FrictionAsymmetry,)
    sizes: ClassVar[tuple[str, ...]] = ("level_asymmetry", "viscous_asymmetry")
    rank: ClassVar[float] = 2
    needs_position: ClassVar[bool] = False
    view = "keep turning"
    acts = Where(axis="direction", description="both directions, differently", regions=((-1, -1), (1, 1)))

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Both directions alike, their two differences as columns; beside an offset only where rest tells them apart.

        Levels of two directions and an offset are two numbers of an axis that moves: with all three, one direction may
        lose its friction altogether, and whatever the other has is explained by a name that it is not.
        """
        if not _is_alike(mount):
            neutral = FrictionAsymmetry(level_asymmetry=0.0, viscous_asymmetry=0.0)
            yield sized(neutral, -0.5, 0.5, self.sizes)  # inside of what a fit may say

    def why_not(self, mount: Mount, prepared: Prepared) -> str:
        """A law that says nothing of rest cannot tell it from an offset."""
        if _is_alike(mount) and not has(mount, FrictionAsymmetry):
            return f"{RESTLESS} the torque offset that was found"
        if prepared.ranges["v"][0] >= 0 or prepared.ranges["v"][1] <= 0:
            return "these recordings hold no reversals"
        return super().why_not(mount, prepared)


def _is_alike(mount: Mount) -> bool:
    """Whether a constant torque is there already, and friction of two directions no more than that."""
    return not mount.friction.states() and (has(mount, TorqueOffset) or has(mount, ConstantForce))
