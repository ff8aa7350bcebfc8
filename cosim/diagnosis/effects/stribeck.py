"""A Stribeck curve, for a law that has none."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, ClassVar

from cosim.diagnosis.answer.result import Where
from cosim.diagnosis.effects.base import Evidence, Hypothesis, Reach, Seen
from cosim.diagnosis.effects.candidates import Candidate, Span, contact_level, sized
from cosim.diagnosis.effects.tuning import at_bound, freed, restarted, with_last
from cosim.estimation.fit import Fit
from cosim.estimation.problem import Problem
from cosim.estimation.residuals import NO_BETTER
from pyfmi_models.effects import StribeckEffect
from pyfmi_models.friction.base import LEAST_VS
from pyfmi_models.mount import Mount

CURVES = (0.01, 0.03, 0.07, 0.15, 0.3)
"""Widths of Stribeck curves that are tried, and that fits start from, relative to the top speed. A fit does not cross
the gap between two recorded speeds: a curve narrower than that is flat at the next speed, and has no slope there."""
SHARP = 1.0
"""Exponent of the Stribeck curve of Bo and Pavelescu (Wear 82, 1982); that of Armstrong-Helouvry is 2."""


class StribeckCurve(Hypothesis[StribeckEffect]):
    """Curves of several widths."""

    forms = (StribeckEffect,)
    member: ClassVar[str] = "Vs"
    rank: ClassVar[float] = 1
    needs_position: ClassVar[bool] = False
    imitated_by: ClassVar[str] = "speeds"
    finds_its_way: ClassVar[bool] = True
    view = "keep turning"

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Five widths; a curve starts flat, at the level of the contact."""
        base = contact_level(mount)
        for share in CURVES:
            # Far from a level at rest the tangent says little: a fit that starts from half to twice finds its way.
            yield sized(StribeckEffect(Fs=base, Vs=share * span.top), 0.5 * base, 2 * base)

    def none(self, mount: Mount) -> float:
        """The level of the contact."""
        return contact_level(mount)

    def looked(self, seen: Seen, mount: Mount) -> str:
        """Break-away levels and the speeds over which they fall."""
        torque, speed = ("N", "m/s") if mount.motion == "linear" else ("N·m", "rad/s")
        return (
            f"with a break-away above {seen.size:.3g} {torque}, falling over {seen.low:.2g} to {seen.high:.2g} {speed}"
        )

    def tuned(self, problem: Problem, found: Fit, start: StribeckEffect, evidence: Evidence) -> Fit:
        """Start from every width, then try other shapes.

        A friction that was refitted without a curve lies somewhere on it: from a level that holds what falls, or from a
        slope that has gone, no step leads back. So these fits start from the card's friction.
        """
        rubbing = replace(found.mount, friction=problem.mount.friction)
        starts = [with_last(rubbing, replace(start, Vs=share * problem.top_speed)) for share in CURVES]
        return _shaped(problem, max((found, *(problem.fit(one, 36) for one in starts)), key=evidence))

    def is_degenerate(self, problem: Problem, effect: StribeckEffect) -> bool:
        """A curve narrower than recorded speeds can tell is a level."""
        return bool(effect.Vs < LEAST_VS * problem.top_speed)

    def is_plausible(self, effect: StribeckEffect, mount: Mount) -> bool:
        """A curve that rises from rest is no Stribeck curve."""
        return bool(effect.Fs > contact_level(mount))

    def where(self, effect: StribeckEffect, reach: Reach) -> Where:
        """Slower than twice its speed."""
        edge = min(2 * effect.Vs, reach.top)
        return Where(axis="speed", description=f"slower than {edge:.2g}", regions=((-edge, edge),))

    def is_settled(self, mount: Mount) -> bool:
        """A law may have the curve itself."""
        return getattr(mount.friction, "Fs", None) is not None or super().is_settled(mount)


def _shaped(problem: Problem, found: Fit) -> Fit:
    """Try the sharper Stribeck curve of the literature too, and any shape if that fits clearly better."""
    gauss: Any = found.mount.effects[-1]
    best = min((found, restarted(problem, found, replace(gauss, delta=SHARP))), key=problem.error)
    free = freed(problem, best, "delta")
    better = problem.error(free) * (1 + NO_BETTER) < problem.error(best)
    return free if better and not at_bound(free.mount.effects[-1]) else best
