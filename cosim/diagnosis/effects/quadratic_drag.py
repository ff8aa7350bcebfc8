"""Drag that grows with the square of the speed."""

from collections.abc import Iterator
from typing import ClassVar

from cosim.diagnosis.effects.base import Hypothesis
from cosim.diagnosis.effects.candidates import Candidate, Span, sized
from pyfmi_models.effects.quadratic_drag import QuadraticDrag
from pyfmi_models.mount import Mount


class Drag(Hypothesis[QuadraticDrag]):
    """Torque over the square of the speed."""

    forms = (QuadraticDrag,)
    rank: ClassVar[float] = 14
    needs_position: ClassVar[bool] = False
    view = "keep turning"

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """One column."""
        yield sized(QuadraticDrag(coefficient=0.0), 1e-9)
