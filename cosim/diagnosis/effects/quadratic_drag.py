"""Drag that grows with the square of the speed."""

from collections.abc import Iterator
from typing import ClassVar

from cosim.diagnosis.effects.base import Hypothesis
from cosim.diagnosis.effects.candidates import Candidate, Span
from cosim.estimation.prepare import Array
from pyfmi_models.effects import Effect
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

        def start(c: Array) -> Effect:
            return QuadraticDrag(coefficient=max(float(c[0]), 1e-9))

        yield Candidate("quadratic_drag", (QuadraticDrag(coefficient=0.0),), ("coefficient",), start)
