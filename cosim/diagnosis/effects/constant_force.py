"""A weight on an axis that moves along: the other name of a constant torque there."""

from collections.abc import Iterable
from typing import ClassVar

from cosim.diagnosis.effects.base import HELD, Hypothesis
from cosim.diagnosis.effects.candidates import Candidate, Span, has
from cosim.diagnosis.effects.torque_offset import Offset
from cosim.estimation.prepare import Prepared
from pyfmi_models.effects import Effect, TorqueOffset
from pyfmi_models.effects.constant_force import ConstantForce
from pyfmi_models.mount import Mount


class Weight(Hypothesis[ConstantForce]):
    """A constant force, which is looked for as a torque offset: the columns are the same."""

    forms = (ConstantForce,)
    same_as: ClassVar[str] = "torque_offset"
    tables = ("position",)
    rank: ClassVar[float] = 11.5
    needs_position: ClassVar[bool] = False

    def candidates(self, mount: Mount, span: Span) -> Iterable[Candidate]:
        """None of its own."""
        return ()

    def renamed(self, effect: Effect, mount: Mount) -> ConstantForce | None:
        """The same force as a weight, on an axis that moves along."""
        if mount.motion != "linear":
            return None
        return ConstantForce(force=getattr(effect, effect.main.parameter))

    def is_settled(self, mount: Mount) -> bool:
        """It needs a linear axis, and a card without a constant."""
        return mount.motion != "linear" or super().is_settled(mount) or has(mount, TorqueOffset)

    def why_not(self, mount: Mount, prepared: Prepared) -> str:
        """What turns has no constant weight; else what is so of a torque offset."""
        if mount.motion != "linear":
            return "on an axis that turns a constant is called a torque offset"
        return HELD if self.is_settled(mount) else Offset().why_not(mount, prepared)
