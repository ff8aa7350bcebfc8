"""A contact that bends, for a law that knows none."""

from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar

import numpy as np

from cosim.diagnosis.effects.base import Evidence, Hypothesis, Seen
from cosim.diagnosis.effects.candidates import Candidate, Span, contact_level
from cosim.diagnosis.effects.tuning import refound, revived
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.problem import Problem
from cosim.estimation.row_weights import held_level, least_way
from pyfmi_models.effects import Effect
from pyfmi_models.effects.presliding import Presliding
from pyfmi_models.mount import Mount

SOFTER = (4.0, 16.0)
"""How many times softer than the start a bending contact is tried."""


class BendingContact(Hypothesis[Presliding]):
    """Contacts of several reaches, from a ten-thousandth of the motion to all of it."""

    forms = (Presliding,)
    tables = ("time since reversal", "distance since reversal", "hysteresis over a long stroke")
    easiest: ClassVar[int] = -1
    rank: ClassVar[float] = 8
    imitated_by: ClassVar[str] = "stops"
    finds_its_way: ClassVar[bool] = True
    view = "since reversal"

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Nine reaches."""
        # Where the contact only bends, a fitted level is nothing: the torque tells how strong it is at least.
        level = max(contact_level(mount), float(np.median(np.abs(span.tau))))
        for reach in np.geomspace(1e-4, 1.0, 9) * span.reach:
            bent = Presliding(sigma0=level / float(reach))

            def start(_: Array, bent: Presliding = bent) -> Effect:
                return bent

            yield Candidate("presliding", (bent,), (), start)

    def is_settled(self, mount: Mount) -> bool:
        """A law may bend itself."""
        return bool(mount.law.states())

    def looked(self, seen: Seen, mount: Mount) -> str:
        """Softer contacts."""
        stiffness = f"{float(f'{seen.high:.3g}'):,.0f}" if seen.high >= 1000 else f"{seen.high:.3g}"
        return f"with a contact softer than {stiffness} {'N/m' if mount.motion == 'linear' else 'N·m/rad'}"

    def tuned(self, problem: Problem, found: Fit, start: Presliding, evidence: Evidence) -> Fit:
        """Start from softer contacts too."""
        softer = [replace(start, sigma0=start.sigma0 / times) for times in SOFTER]
        return refound(problem, revived(problem, found, start), evidence, softer)

    def shows(self, effect: Presliding, mount: Mount, prepared: Prepared) -> bool:
        """What bends by less than recordings show is rounding, or the filter."""
        return self.way_back(effect, mount) >= least_way(prepared)

    def way_back(self, effect: Presliding, mount: Mount) -> float:
        """What the contact bends: where motion goes one way, it is a lagged torque over speed."""
        return held_level(mount.friction) / float(effect.sigma0)
