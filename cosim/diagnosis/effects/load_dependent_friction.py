"""Friction that grows with the weight on the bearings."""

from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar

import numpy as np

from cosim.diagnosis.effects.base import Hypothesis
from cosim.diagnosis.effects.candidates import Candidate, Span, contact_level, has
from cosim.estimation.prepare import Array, Prepared
from pyfmi_models.effects import Effect, PayloadEffect
from pyfmi_models.effects.load_dependent_friction import LoadDependentFriction, LoadScaledFriction
from pyfmi_models.mount import Mount


class LoadFriction(Hypothesis[LoadDependentFriction]):
    """A rise of the level alone, or of level and viscous friction alike."""

    forms = (LoadDependentFriction, LoadScaledFriction)
    tables = ("friction level over position",)
    rank: ClassVar[float] = 5
    view = "load"

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Only a known weight tells the load."""
        if not has(mount, PayloadEffect):
            return
        forms = [LoadDependentFriction(coulomb_per_Nm=0.0)]
        if level := contact_level(mount):
            forms.append(LoadScaledFriction(coulomb_per_Nm=0.0, at_level=level))
        for form in forms:

            def start(c: Array, form: LoadDependentFriction = form) -> Effect:
                return replace(form, coulomb_per_Nm=float(np.clip(c[0], 1e-6, 5)))

            yield Candidate("load_dependent_friction", (form,), ("coulomb_per_Nm",), start)

    def why_not(self, mount: Mount, prepared: Prepared) -> str:
        """It needs a weight of known size."""
        known = has(mount, PayloadEffect) or mount.friction.key == "none"
        return super().why_not(mount, prepared) if known else "the model holds no load that changes"
