"""Viscous friction that rises less than linearly."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import ClassVar

import casadi as ca
import numpy as np

from cosim.diagnosis.answer.result import Where
from cosim.diagnosis.effects.base import Evidence, Hypothesis, Reach, Seen, of_that_size
from cosim.diagnosis.effects.candidates import Candidate, Span, contact_level, sized
from cosim.diagnosis.effects.tuning import refound
from cosim.estimation.fit import Fit
from cosim.estimation.least_squares import projected
from cosim.estimation.prepare import Prepared
from cosim.estimation.problem import Problem
from cosim.estimation.row_weights import far_from_turns
from pyfmi_models.effects.concave_viscous import ConcaveViscous
from pyfmi_models.mount import Mount

LEAST_BEND = 0.033
"""What the torque must bend by in clear motion, RMS beside a level and a line, relative to the friction level. Unit: 1.
Friction that is another law's leaves .032 of it at most (`policy.slight`)."""
THINNING = (0.03, 0.1, 0.3)
"""Speeds from which on grease thins that are tried, relative to the top speed: two a decade of what bends in sight."""

ROOT = 0.5
"""Exponent of a middling one."""


class ThinningGrease(Hypothesis[ConcaveViscous]):
    """A power of the speed below one, from three speeds on.

    A law of friction that is not quite the contact's own bends over the speed too, most of all next to rest: what is
    held there for too little makes the slope in motion too steep. So it needs the evidence of a common misfit, and must
    bend in clear motion: axes without it asked for it with bends of .4 and 2.3 % of the friction there, a machine whose
    friction falls toward rest (EMPS) with 3.7 %.
    """

    forms = (ConcaveViscous,)
    easiest: ClassVar[int] = -1
    member: ClassVar[str] = "thinning_speed"
    rank: ClassVar[float] = 14.5
    needs_position: ClassVar[bool] = False
    imitated_by: ClassVar[str] = "speeds"
    view = "keep turning"

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Three speeds; the curve starts straight, as the law's own line."""
        if not hasattr(mount.friction, "sigma2"):
            return
        for share in THINNING:
            yield sized(ConcaveViscous(thinning_speed=share * span.top, exponent=1.0), 0.0, 0.9)

    def tuned(self, problem: Problem, found: Fit, start: ConcaveViscous, evidence: Evidence) -> Fit:
        """Start from each speed: what thins early and little resembles what thins late and much."""
        starts = [replace(start, thinning_speed=share * problem.top_speed, exponent=ROOT) for share in THINNING]
        return refound(problem, found, evidence, starts)

    def shows(self, effect: ConcaveViscous, mount: Mount, prepared: Prepared) -> bool:
        """Whether it bends where the axis moves clearly."""
        v = prepared.stacked("v")[far_from_turns(prepared) > 0]
        if not len(v):
            return False
        torque = effect.viscous(ca.DM(mount.friction.viscous(v)), mount.at(0.0, 0.0, ca.DM(v)))
        bend = projected(np.asarray(torque).ravel(), np.column_stack([np.sign(v), v]))
        return bool(np.sqrt(np.mean(bend**2)) > LEAST_BEND * contact_level(mount))

    def is_degenerate(self, problem: Problem, effect: ConcaveViscous) -> bool:
        """What thins at lower speeds than are tried is level from there on: the contact's friction by another name."""
        return bool(effect.thinning_speed < THINNING[0] * problem.top_speed)

    def none(self, mount: Mount) -> float:
        """A straight line."""
        return 1.0

    def concealed(self, mount: Mount, span: Span, tried: Sequence[Candidate]) -> Iterable[Candidate]:
        """A root of the speed from each speed on."""
        return [of_that_size(one, exponent=ROOT) for one in tried]

    def looked(self, seen: Seen, mount: Mount) -> str:
        """Lower speeds, above which the viscous torque is a root of the speed."""
        return f"as a root of the speed from below {seen.high:.2g} {'m/s' if mount.motion == 'linear' else 'rad/s'} on"

    def where(self, effect: ConcaveViscous, reach: Reach) -> Where:
        """Above the speed at which it thins."""
        edge = min(effect.thinning_speed, reach.top)
        regions = ((-reach.top, -edge), (edge, reach.top))
        return Where(axis="speed", description=f"faster than {edge:.2g}", regions=regions)
