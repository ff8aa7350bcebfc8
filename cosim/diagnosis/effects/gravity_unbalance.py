"""A load off the axis."""

from collections.abc import Iterator
from typing import ClassVar

from cosim.diagnosis.answer.result import Where
from cosim.diagnosis.effects.base import Hypothesis, Reach, visited
from cosim.diagnosis.effects.candidates import Candidate, Span, wave
from cosim.estimation.prepare import Prepared
from pyfmi_models.effects import GravityUnbalance
from pyfmi_models.mount import Mount


class Unbalance(Hypothesis[GravityUnbalance]):
    """A weight, once per turn."""

    forms = (GravityUnbalance,)
    tables = ("position", "position over the turn")
    rank: ClassVar[float] = 10
    view = "slow and fast"

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Sine and cosine of the angle."""
        yield wave(GravityUnbalance(mgl=0.0))

    def where(self, effect: GravityUnbalance, reach: Reach) -> Where:
        """At all positions."""
        return visited(reach)

    def is_settled(self, mount: Mount) -> bool:
        """It needs a rotary axis, and a card without one."""
        return mount.motion == "linear" or super().is_settled(mount)

    def why_not(self, mount: Mount, prepared: Prepared) -> str:
        """It needs a rotary axis."""
        return "a linear axis has no unbalance" if mount.motion == "linear" else super().why_not(mount, prepared)
