"""A tone in time, from a machine beside the axis."""

from collections.abc import Iterable, Iterator, Sequence
from typing import ClassVar

import numpy as np

from cosim.diagnosis.answer.result import Where
from cosim.diagnosis.effects.base import PASSED, WAVES, Hypothesis, Reach, Seen, with_numbers
from cosim.diagnosis.effects.candidates import Candidate, Span, sized
from cosim.diagnosis.effects.periodogram import tones
from cosim.estimation.prepare import Prepared
from cosim.estimation.problem import Problem
from cosim.estimation.tonal_disturbance import detectable_band
from pyfmi_models.effects.periodic_disturbance import PeriodicDisturbance
from pyfmi_models.mount import Mount

TOO_SHORT = "these recordings hold too few waves of any tone"


class Tone(Hypothesis[PeriodicDisturbance]):
    """Tones that stand out most from the torque; their phase is each recording's own."""

    forms = (PeriodicDisturbance,)
    member: ClassVar[str] = "frequency_hz"
    is_fine: ClassVar[bool] = True
    rank: ClassVar[float] = 12
    needs_position: ClassVar[bool] = False
    has_own_phase: ClassVar[bool] = True
    view = "spectrum"
    caveat: ClassVar[str] = (
        "; its phase is fitted in each recording, in the held-out one too; card and FMU hold that of the first"
    )

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """A tone each."""
        for hertz in tones(span, span.residual):
            yield sized(PeriodicDisturbance(frequency_hz=hertz, amplitude=0.0), 1e-12)

    def is_degenerate(self, problem: Problem, effect: PeriodicDisturbance) -> bool:
        """Outside the detectable band it is drift, or noise."""
        slowest, fastest = detectable_band(problem.prepared)
        return not bool(slowest <= effect.frequency_hz <= fastest)

    def where(self, effect: PeriodicDisturbance, reach: Reach) -> Where:
        """At its frequency."""
        return Where(axis="frequency", description=f"everywhere, at {effect.frequency_hz:.4g} Hz", regions=())

    def further(self, waves: Sequence[PeriodicDisturbance]) -> str:
        """The other frequencies."""
        others = sorted(other.frequency_hz for other in waves)
        return f" Further tones: {', '.join(f'{hertz:.4g}' for hertz in others)} Hz." if others else ""

    def card_note(self, first: str) -> str:
        """Whose phase the card holds."""
        return f"The phase of the periodic disturbance is that of {first}."

    def concealed(self, mount: Mount, span: Span, tried: Sequence[Candidate]) -> Iterable[Candidate]:
        """All over the detectable band."""
        for first in tried[:1]:
            for hertz in np.geomspace(2 * span.detectable[0], PASSED * span.detectable[1], WAVES).tolist():
                yield with_numbers(first, frequency_hz=hertz)

    def looked(self, seen: Seen, mount: Mount) -> str:
        """Between which frequencies."""
        return f"between {seen.low:.2g} and {seen.high:.3g} Hz; not testable above {seen.cutoff:.3g} Hz"

    def is_settled(self, mount: Mount) -> bool:
        """Never: there may be further tones."""
        return False

    def why_not(self, mount: Mount, prepared: Prepared) -> str:
        """A motion that repeats itself makes tones of its own, and a short recording holds too few waves."""
        slowest, fastest = detectable_band(prepared)
        return TOO_SHORT if fastest < 2 * slowest else "the motion repeats itself, which looks like a tone"
