"""An encoder disc off its centre."""

from collections.abc import Iterator
from dataclasses import replace
from math import pi
from typing import Any, ClassVar

import numpy as np

from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects.base import Cyclic, Evidence
from cosim.diagnosis.effects.candidates import Candidate, Span, wave
from cosim.diagnosis.effects.periodogram import peaks
from cosim.diagnosis.effects.tuning import in_cycles, restarted
from cosim.estimation.fit import Fit
from cosim.estimation.problem import Problem
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity
from pyfmi_models.mount import Mount

MOST_SLOPE = 0.25
"""Error of the reading for a way, relative to it: a disc of radius R off by e errs by e/R of the way, twice that with
an oval one; a quarter is no disc any more, but a ripple whose torque the reading would have to make. Unit: 1."""


class Eccentricity(Cyclic[EncoderEccentricity]):
    """A false reading once a turn of the disc."""

    forms = (EncoderEccentricity,)
    shown: ClassVar[tuple[float, float]] = (1.0, 40.0)
    """Bearing and disc make no more."""
    rank: ClassVar[float] = 22
    view = "slow and fast"

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Cycles over angle of what grows with the square of the speed."""
        fast = replace(span, residual=span.residual * (span.v / span.top) ** 2)
        for cycles in peaks(fast, fast.residual):
            yield wave(EncoderEccentricity(cycles_per_rev=cycles, amplitude_rad=0.0))

    def tuned(self, problem: Problem, found: Fit, start: EncoderEccentricity, evidence: Evidence) -> Fit:
        """Ask a disc of half the turns whether what was found is its error twice a turn.

        The torque of that error is four times as large as that of one once a turn, so a search begins with it, and no
        step leads from there to half the turns. It must be ahead by the margin that a rival needs. Once a turn is a
        sixteenth of the energy: where twice a turn has less than any effect must have, both together have it no more.
        """
        found = super().tuned(problem, found, start, evidence)
        if evidence(found) < POLICY.clear:
            return found
        starts = halved(problem, found.mount.effects[-1])
        best = in_cycles(problem, max((restarted(problem, found, one) for one in starts), key=evidence))
        return best if evidence(best) > evidence(found) + POLICY.fair else found

    def is_plausible(self, effect: EncoderEccentricity, mount: Mount) -> bool:
        """The reading goes on where the axis does: it errs by less of the way than `MOST_SLOPE`."""
        slope = effect.amplitude_rad * effect.cycles_per_rev * (1 + 2 * abs(effect.second))
        return bool(slope < MOST_SLOPE)


def halved(problem: Problem, disc: Any) -> list[EncoderEccentricity]:
    """Discs of half the turns, that is whole ones of an axis that turns, whose error twice a turn is that of `disc`.

    It is so in the middle of what was visited; the error once a turn starts half as large, either way.
    """
    half = disc.cycles_per_rev / 2
    cycles, around = (half, 2 * pi) if problem.mount.motion == "linear" else (max(1.0, float(round(half))), 1.0)
    middle = around * float(np.mean(problem.prepared.ranges["q"]))
    phase = disc.phase / 2 + (half - cycles) * middle
    return [
        replace(disc, cycles_per_rev=cycles, amplitude_rad=disc.amplitude_rad / 2, second=2.0, phase=phase + turn)
        for turn in (0.0, pi)
    ]
