"""A cable that winds up."""

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from cosim.diagnosis.effects.base import Evidence, Hypothesis
from cosim.diagnosis.effects.candidates import Candidate, Span
from cosim.diagnosis.effects.tuning import freed
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Array
from cosim.estimation.problem import Problem
from pyfmi_models.effects import Effect
from pyfmi_models.effects.cable_wrap import CableWrap
from pyfmi_models.mount import Mount

BESIDE = 0.25
"""A cable's home lies in the visited positions or beside them, by this share of their range at most: there it was
wound. Further away it pulls one way all along, as a weight does that a slope stands beside. Unit: 1."""


class Cable(Hypothesis[CableWrap]):
    """A spring, even or hardening."""

    forms = (CableWrap,)
    tables = ("position", "position over the turn")
    rank: ClassVar[float] = 13

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """A spring whose home is where its torque vanishes: two homes span them all."""
        homes, room = np.quantile(span.q, [0.1, 0.9]).tolist(), BESIDE * span.reach
        most = float(span.q.min()) - room, float(span.q.max()) + room
        for hardening in (0.0, 4.0 / span.reach**2):

            def start(c: Array, hardening: float = hardening) -> Effect:
                stiffness = float(c[0] + c[1])
                home = float(c @ homes) / stiffness if stiffness > 0 else float(np.mean(homes))
                home = float(np.clip(home, *most))
                return CableWrap(stiffness=max(stiffness, 1e-9), home=home, hardening=hardening)

            pair = tuple(CableWrap(stiffness=0.0, home=home, hardening=hardening) for home in homes)
            yield Candidate("cable_wrap", pair, ("stiffness",), start)

    def tuned(self, problem: Problem, found: Fit, start: CableWrap, evidence: Evidence) -> Fit:
        """Fit how it hardens."""
        return problem.fit(freed(problem, found, "hardening").mount, 12)

    def is_degenerate(self, problem: Problem, effect: CableWrap) -> bool:
        """Far from its home it is an offset."""
        low, high = problem.prepared.ranges["q"]
        room = BESIDE * (high - low)
        return not low - room <= float(effect.home) <= high + room
