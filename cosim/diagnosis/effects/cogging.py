"""Torque ripple locked to position."""

from collections.abc import Iterator
from typing import ClassVar

from cosim.diagnosis.effects.base import LEAST_CYCLES, Rippled
from cosim.diagnosis.effects.candidates import Candidate, Span, wave
from cosim.diagnosis.effects.periodogram import peaks
from cosim.estimation.problem import Problem
from pyfmi_models.effects import Cogging
from pyfmi_models.mount import Mount


class Ripple(Rippled[Cogging]):
    """Torque with so many cycles a turn."""

    forms = (Cogging,)
    tables = ("position", "position over the turn")
    rank: ClassVar[float] = 9

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Strongest cycles of the torque."""
        for cycles in peaks(span, span.residual):
            yield self.wave(cycles)

    def is_degenerate(self, problem: Problem, effect: Cogging) -> bool:
        """Once a turn it is an unbalance; on a carriage half a wave over all of its way is a slope, less a constant."""
        if problem.mount.motion == "rotary":
            return bool(effect.cycles_per_rev < LEAST_CYCLES)
        return bool(2 * effect.cycles_per_rev * problem.prepared.reach < 1)

    def wave(self, cycles: float) -> Candidate:
        """Torque with so many cycles."""
        return wave(Cogging(cycles_per_rev=cycles, amplitude=0.0), -1)
