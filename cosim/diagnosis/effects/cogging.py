"""Torque ripple locked to position."""

from collections.abc import Iterable, Iterator, Sequence
from math import atan2, hypot, pi
from typing import ClassVar

from cosim.diagnosis.answer.result import Where
from cosim.diagnosis.effects.base import (
    LEAST_CYCLES,
    Hypothesis,
    Reach,
    Seen,
    cycles_shown,
    in_cycles_a_turn,
    visited,
    with_cycles,
)
from cosim.diagnosis.effects.candidates import Candidate, Span
from cosim.diagnosis.effects.periodogram import peaks
from cosim.estimation.prepare import Array
from cosim.estimation.problem import Problem
from pyfmi_models.effects import Cogging, Effect
from pyfmi_models.mount import Mount


class Ripple(Hypothesis[Cogging]):
    """Torque with so many cycles a turn."""

    forms = (Cogging,)
    tables = ("position", "position over the turn")
    member: ClassVar[str] = "cycles_per_rev"
    rank: ClassVar[float] = 9
    view = "one pitch"

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Strongest cycles of the torque."""
        for cycles in peaks(span, span.residual):
            yield _wave(cycles)

    def multiple(self, ripple: Cogging, k: int) -> Candidate | None:
        """So many times the cycles."""
        return _wave(k * float(ripple.cycles_per_rev)) if ripple.cycles_per_rev > 0 else None

    def is_degenerate(self, problem: Problem, effect: Cogging) -> bool:
        """Once a turn it is an unbalance."""
        return problem.mount.motion == "rotary" and bool(effect.cycles_per_rev < LEAST_CYCLES)

    def concealed(self, mount: Mount, span: Span, tried: Sequence[Candidate]) -> Iterable[Candidate]:
        """All that a stroke holds and the band passes."""
        return with_cycles(tried, cycles_shown(mount, span))

    def looked(self, seen: Seen, mount: Mount) -> str:
        """Between which cycles."""
        return in_cycles_a_turn(seen, mount)

    def where(self, effect: Cogging, reach: Reach) -> Where:
        """At all positions."""
        return visited(reach)

    def is_settled(self, mount: Mount) -> bool:
        """Never: there may be further waves."""
        return False


def _wave(cycles: float) -> Candidate:
    def start(c: Array) -> Effect:
        return Cogging(cycles_per_rev=cycles, amplitude=hypot(*c), phase=atan2(-c[1], c[0]))

    pair = tuple(Cogging(cycles_per_rev=cycles, amplitude=0.0, phase=phase) for phase in (0.0, -pi / 2))
    return Candidate("cogging", pair, ("amplitude",), start)
