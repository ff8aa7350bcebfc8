"""Friction that grows with the weight on the bearings, or with all torque through a gear."""

from collections.abc import Iterable, Iterator, Sequence
from typing import ClassVar

from cosim.diagnosis.effects.base import Hypothesis
from cosim.diagnosis.effects.candidates import Candidate, Span, contact_level, has, sized
from pyfmi_models.effects import PayloadEffect
from pyfmi_models.effects.load_dependent_friction import GearLoadFriction, LoadDependentFriction, LoadScaledFriction
from pyfmi_models.mount import Mount

SIDES = (0.0, 1.0)
"""Share of friction that the teeth of a gear feel: none on the load's side of it, all on the motor's."""


class LoadFriction(Hypothesis[LoadDependentFriction]):
    """A rise of the level alone, or of level and viscous friction alike."""

    forms = (LoadDependentFriction, LoadScaledFriction, GearLoadFriction)
    tables = ("friction level over position",)
    rank: ClassVar[float] = 5
    view = "load"
    may_end = ("inertia_share", "friction_share")

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """A known weight tells the load; what accelerates the axis passes a gear, on its load's or its motor's side."""
        weight, level = has(mount, PayloadEffect), contact_level(mount)
        forms = [LoadDependentFriction(coulomb_per_Nm=0.0)] if weight else []
        if level:
            known = {"coulomb_per_Nm": 0.0, "at_level": level}
            forms += [LoadScaledFriction(**known)] if weight else []
            forms += [GearLoadFriction(**known, inertia_share=1.0, friction_share=one) for one in SIDES]
        for form in forms:
            yield sized(form, 1e-6, 0.5 if form.feels_inertia else 5.0)

    def concealed(self, mount: Mount, span: Span, tried: Sequence[Candidate]) -> Iterable[Candidate]:
        """What rises with the weight, where there is one: its size counts in another torque than a gear's."""
        weights = [one for one in tried if not one.instances[0].feels_inertia]
        return weights or tried
