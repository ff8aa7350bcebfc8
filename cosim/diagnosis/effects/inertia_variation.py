"""Inertia that depends on where the axis is."""

from collections.abc import Iterator
from typing import ClassVar

from cosim.diagnosis.effects.base import Hypothesis
from cosim.diagnosis.effects.candidates import Candidate, Span, wave
from pyfmi_models.effects.inertia_variation import InertiaVariation
from pyfmi_models.mount import Mount

TURNS = (1.0, 2.0, 3.0, 4.0)
"""Cycles a turn that are looked at ..."""
STROKES = (0.5, 1.0, 1.5, 2.0, 3.0)
"""... and waves over the stroke of a linear axis: a fit does not find its way from half a wave to two."""


class VaryingInertia(Hypothesis[InertiaVariation]):
    """Inertia over the angle."""

    forms = (InertiaVariation,)
    member: ClassVar[str] = "cycles_per_rev"
    share_of: ClassVar[str] = "axis.inertia"
    rank: ClassVar[float] = 18

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Once to four times a turn; on a linear axis half a wave to three over the stroke."""
        for cycles in TURNS if mount.motion == "rotary" else [waves / span.reach for waves in STROKES]:
            yield wave(InertiaVariation(relative_amplitude=0.0, cycles_per_rev=cycles), -1, 1e-6, 0.9)
