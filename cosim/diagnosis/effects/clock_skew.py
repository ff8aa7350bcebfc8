"""Two clocks: readings that are newer or older than the torque beside them, or that drift either way."""

from collections.abc import Iterable, Iterator, Sequence
from typing import ClassVar

import numpy as np

from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects.base import Hypothesis, Seen
from cosim.diagnosis.effects.candidates import Candidate, Span
from cosim.diagnosis.effects.delay_and_lag import NOTHING_ASKED, attributed
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.problem import Problem
from pyfmi_models.effects import Effect
from pyfmi_models.effects.clock_skew import ClockSkew
from pyfmi_models.mount import Mount

LEAST_DRIFT_MS = 1.0
"""A clock that drifts by less than this, or than a considerable share of its offset, is late like a delay."""


class Clocks(Hypothesis[ClockSkew]):
    """Offsets and drifts of the reading's clock."""

    forms = (ClockSkew,)
    sizes: ClassVar[tuple[str, ...]] = ("offset_ms", "drift_ppm")
    rank: ClassVar[float] = 17
    needs_position: ClassVar[bool] = False
    is_timing: ClassVar[bool] = True
    view = "clock"

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Two offsets and two drifts."""
        if not span.asked:
            return
        ways = [ClockSkew(offset_ms=ms) for ms in (1.0, 4.0)]
        # One drifts from nothing, one through nothing in the middle of a recording: together with an offset, any drift.
        ways += [ClockSkew(drift_ppm=4e3 / span.seconds, offset_ms=middle) for middle in (0.0, -2.0)]
        for way in ways:

            def start(c: Array, way: ClockSkew = way) -> Effect:
                size = float(np.copysign(np.clip(abs(c[0]), 0.03, 10), c[0]))
                return ClockSkew(offset_ms=size * way.offset_ms + 1e-3, drift_ppm=size * way.drift_ppm + 1e-3)

            yield Candidate("clock_skew", (way,), (), start)

    def concealed(self, mount: Mount, span: Span, tried: Sequence[Candidate]) -> Iterable[Candidate]:
        """Offsets alone: a drift is one that grows."""
        return [one for one in tried if getattr(one.instances[0], "drift_ppm", 0.0) == 0]

    def looked(self, seen: Seen, mount: Mount) -> str:
        """An offset."""
        return f"from {seen.size:.2g} ms"

    def late(self, problem: Problem, effect: ClockSkew) -> float | None:
        """Of a clock that drifts it is the middle of a recording that counts, if late by a sample at least."""
        offset, drift = float(effect.offset_ms), 1e-3 * float(effect.drift_ppm) * problem.seconds
        steady = abs(drift) < max(LEAST_DRIFT_MS, POLICY.considerable * abs(offset))
        late = -1e-3 * (offset + drift / 2)
        return late if late > (0 if steady else problem.sample_time) else None

    def is_degenerate(self, problem: Problem, effect: ClockSkew) -> bool:
        """A lag that lies in the drive."""
        late = self.late(problem, effect)
        return late is not None and attributed(problem.prepared, late, problem.sample_time) == "drive"

    def why_not(self, mount: Mount, prepared: Prepared) -> str:
        """Nothing asks."""
        asked = any(piece.is_asked for piece in prepared.pieces)
        return super().why_not(mount, prepared) if asked else NOTHING_ASKED
