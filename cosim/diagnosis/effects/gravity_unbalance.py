"""A load off the axis."""

from collections.abc import Iterator
from math import atan2, hypot, pi
from typing import ClassVar

from cosim.diagnosis.answer.result import Where
from cosim.diagnosis.effects.base import Hypothesis, Reach, visited
from cosim.diagnosis.effects.candidates import Candidate, Span
from cosim.estimation.prepare import Array, Prepared
from pyfmi_models.effects import Effect, GravityUnbalance
from pyfmi_models.mount import Mount


class Unbalance(Hypothesis[GravityUnbalance]):
    """A weight, once per turn."""

    forms = (GravityUnbalance,)
    tables = ("position", "position over the turn")
    rank: ClassVar[float] = 10
    view = "slow and fast"

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Sine and cosine of the angle."""

        def start(c: Array) -> Effect:
            return GravityUnbalance(mgl=hypot(*c), phase=atan2(c[1], c[0]))

        pair = (GravityUnbalance(mgl=0.0, phase=0.0), GravityUnbalance(mgl=0.0, phase=pi / 2))
        yield Candidate("gravity_unbalance", pair, ("mgl",), start)

    def where(self, effect: GravityUnbalance, reach: Reach) -> Where:
        """At all positions."""
        return visited(reach)

    def is_settled(self, mount: Mount) -> bool:
        """It needs a rotary axis, and a card without one."""
        return mount.motion == "linear" or super().is_settled(mount)

    def why_not(self, mount: Mount, prepared: Prepared) -> str:
        """It needs a rotary axis."""
        return "a linear axis has no unbalance" if mount.motion == "linear" else super().why_not(mount, prepared)
