"""Contacts that settle while the axis rests."""

from collections.abc import Iterator
from dataclasses import replace
from math import inf
from typing import Any, ClassVar

from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects.base import Evidence, Hypothesis
from cosim.diagnosis.effects.candidates import Candidate, Span, contact_level, sized
from cosim.diagnosis.effects.tuning import refound
from cosim.estimation.fit import Fit
from cosim.estimation.problem import Problem
from pyfmi_models.effects.dwell_breakaway import DwellBreakaway
from pyfmi_models.mount import Mount

ONSETS = (0.3, 1.0, 3.0)
"""Rests [s] at which the rise may begin, beside the .1 s of a start: rock and metal settle from .1 to a few seconds on
(Dieterich, J. Geophys. Res. 77 (1972) 3690). Where it begins too early, level and rise stand in for each other."""

MOST_RISE = 2.0
"""Rise per e-fold of rest relative to the card's friction level. Contacts rise by hundredths of it (Dieterich), wet
ones by some tenths; six times of it had another cause, numbers of a base that its own law could not tell. Concealed
ones were found at up to 1.01 of it, where the rise was read to begin late (a machine's was .6)."""


class Settling(Hypothesis[DwellBreakaway]):
    """A break-away torque that grows with the rest before it."""

    forms = (DwellBreakaway,)
    tables = ("time since reversal",)
    member: ClassVar[str] = "memory_rad"
    rank: ClassVar[float] = 6
    view = "rest before a start"

    def tuned(self, problem: Problem, found: Fit, start: DwellBreakaway, evidence: Evidence) -> Fit:
        """Go on from later beginnings of the rise."""
        found = super().tuned(problem, found, start, evidence)
        settling: Any = found.mount.effects[-1]
        later = [replace(settling, onset_s=onset) for onset in ONSETS]
        return refound(problem, found, evidence, later, 15) if evidence(found) > 0 else found

    def is_degenerate(self, problem: Problem, effect: DwellBreakaway) -> bool:
        """What a friction level wanders by, whatever rest was before, is no settling; nor is what no slip renews.

        Nor is a rise beyond twice the friction level. What bends before it slides is not renewed while it bends.
        """
        level = contact_level(problem.mount)
        bent = level / float(getattr(problem.mount.friction, "sigma0", inf))
        settles = POLICY.wander * level <= effect.torque_per_efold <= MOST_RISE * level
        return not settles or effect.memory_rad < bent

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Ages of the contact that a small or a larger slip renews."""
        for share in (1e-3, 4e-3):
            fresh = DwellBreakaway(torque_per_efold=0.0, onset_s=0.1, memory_rad=share * span.reach)
            yield sized(fresh, 1e-6 * contact_level(mount))
