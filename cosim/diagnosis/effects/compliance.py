"""A spring in the drive: with the encoder on the motor, or on the load."""

from collections.abc import Iterator
from dataclasses import replace
from math import sqrt
from typing import Any, ClassVar

import numpy as np

from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects.base import Evidence, Form, Hypothesis, Seen
from cosim.diagnosis.effects.candidates import SHARE, Candidate, Span, has
from cosim.diagnosis.effects.tuning import refound
from cosim.estimation.fit import Fit
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Array
from cosim.estimation.problem import Problem
from pyfmi_models.effects import Effect
from pyfmi_models.effects.compliance import Compliance, LoadSideCompliance
from pyfmi_models.friction import Frictionless
from pyfmi_models.mount import Mount

RESONANCES = np.geomspace(0.6, 4.0, 5)
"""Resonances that are looked at with the encoder on the load, relative to the cutoff of the filter ..."""
EVEN = 0.5
"""... with this share of the inertia at the encoder, which recordings hardly tell, ..."""
SOFTER = (0.1, 4.0)
"""... and how much softer than that a fit may start."""
MOST_DAMPING = 0.2
"""Damping ratio above which a spring is none: joints of machines have 0.01 to 0.1 (Ewins, Modal Testing, 2000)."""
SLOWER = (1.0, 0.6)
"""Antiresonances, relative to the start's, from which a spring is tried again, with a smaller mass on it: a fit does
not cross a peak."""
SMALL_MASS = 0.1
"""Share of the inertia that is then on the spring."""


class _AnySpring(Hypothesis[Form]):
    easiest: ClassVar[int] = -1
    must_stand_out: ClassVar[bool] = True
    view = "spectrum"

    def may_come(self, mount: Mount) -> bool:
        """Where there is no other."""
        return not (has(mount, Compliance) or has(mount, LoadSideCompliance))

    def looked(self, seen: Seen, mount: Mount) -> str:
        """Lower resonances."""
        return f"with a resonance below {seen.high:.3g} Hz; not testable above"

    def is_degenerate(self, problem: Problem, effect: Any) -> bool:
        """What is damped that much does not spring."""
        return bool(effect.damping_ratio > MOST_DAMPING)


class Spring(_AnySpring[Compliance]):
    """With the encoder on the motor."""

    forms = (Compliance,)
    rank: ClassVar[float] = 19

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Antiresonances inside the band and a little above."""
        for hertz in np.geomspace(min(6.0, span.cutoff / 2), 1.2 * span.cutoff, 7):
            middling = _spring(float(hertz), SHARE)

            def start(c: Array, hertz: float = float(hertz)) -> Effect:
                return _spring(hertz, float(np.clip(SHARE * c[0], 0.02, 0.8)))

            yield Candidate("compliance", (middling,), (), start, positive=True)

    def tuned(self, problem: Problem, found: Fit, start: Compliance, evidence: Evidence) -> Fit:
        """Start from a smaller mass, and from a slower one, too."""
        others = [_spring(times * float(start.antiresonance_hz), SMALL_MASS) for times in SLOWER]
        return refound(problem, found, evidence, others)


class LoadSideSpring(_AnySpring[LoadSideCompliance]):
    """With the encoder on the load: below the resonance the torque goes with the inverse of its square."""

    forms = (LoadSideCompliance,)
    rank: ClassVar[float] = 20

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Resonances around the band and above."""
        for hertz in span.cutoff * RESONANCES:
            middling = LoadSideCompliance(resonance_hz=float(hertz), encoder_share=EVEN)

            def start(c: Array, middling: LoadSideCompliance = middling) -> Effect:
                times = 1 / sqrt(np.clip(c[0], *SOFTER))
                return replace(middling, resonance_hz=middling.resonance_hz * times)

            yield Candidate("compliance", (middling,), (), start, positive=True)

    def is_degenerate(self, problem: Problem, effect: LoadSideCompliance) -> bool:
        """What is damped that much does not spring; what shows in friction and hardly in acceleration is friction.

        In friction that turns round a law errs as a spring does: where .02 and .77 of what is added came from
        acceleration, springs were found that are not there; machines with one have 1.0.
        """
        if super().is_degenerate(problem, effect):
            return True
        bare = replace(problem.mount, friction=Frictionless(), effects=())
        whole, inertial = (_added(problem, mount, effect) for mount in (problem.mount, bare))
        return inertial < POLICY.nearly_all * whole


def _spring(hertz: float, share: float) -> Compliance:
    return Compliance(antiresonance_hz=hertz, resonance_hz=hertz / sqrt(1 - share))


def _added(problem: Problem, mount: Mount, effect: Effect) -> float:
    """Size of what an effect adds to the torque that a mount needs, over the rows that count [N m]."""
    mounts, pieces = (mount, replace(mount, effects=(*mount.effects, effect))), problem.prepared.pieces
    before, after = (stacked(Inverse(one, ()), pieces, np.zeros(0))[0] for one in mounts)
    return float(np.linalg.norm(problem.weight * (after - before)))
