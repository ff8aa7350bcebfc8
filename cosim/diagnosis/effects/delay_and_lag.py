"""What makes the torque late: a dead time, or a lag. The two are twins: alike at first order, so they are asked as one.

Which of them it is the set point tells, see `instrumental_variable.py`.
"""

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from cosim.diagnosis.answer.result import Where
from cosim.diagnosis.effects.base import QUICK_CHANGES, Hypothesis, Reach
from cosim.diagnosis.effects.candidates import Candidate, Span, has
from cosim.diagnosis.effects.timing_attribution import attributed
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.problem import Problem
from pyfmi_models.effects import ActuatorLag, Delay, DriveEffect, Effect
from pyfmi_models.mount import Mount

Drive = Delay | ActuatorLag
LEAST_DELAY_SAMPLES, LEAST_DELAY = 0.55, 1.5e-4
"""What is later by less than so many samples, or seconds, is what time stamps cannot be trusted for: a value that is
held, or read at the other end of its row, is half a sample late. A null read at 250 Hz was .505 late, the least that
was concealed and found .57 and .68 (seed 1494289175)."""


def milliseconds(effect: Effect) -> float:
    """Dead time or time constant [ms]."""
    return float(getattr(effect, effect.main.parameter))


def timed(form: type[Any], ms: float) -> Any:
    """A delay or a lag of so many milliseconds."""
    return form(**{form.main.parameter: ms})


class LateTorque(Hypothesis[Drive]):
    """Delays and lags of several sizes."""

    forms = (ActuatorLag, Delay)
    rank: ClassVar[float] = 16
    needs_position: ClassVar[bool] = False
    finds_its_way: ClassVar[bool] = True
    is_timing: ClassVar[bool] = True
    view = "phase"

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Four sizes of each."""
        if not span.asked:
            return
        for ms in (0.3, 1.0, 3.0, 8.0):
            for form in (form for form in (Delay, ActuatorLag) if not has(mount, form)):

                def start(c: Array, form: type[Drive] = form, ms: float = ms) -> Effect:
                    late: Effect = timed(form, float(np.clip(ms * float(c[0]), 0.03, 40)))
                    return late

                yield Candidate(form.id, (timed(form, ms),), (), start)

    def least(self, sample_time: float) -> float:
        """What time stamps can be trusted for."""
        return 1e3 * max(LEAST_DELAY_SAMPLES * sample_time, LEAST_DELAY)

    def twins(self, effect: Drive) -> list[Effect]:
        """The other of the two, as late."""
        return [timed(form, milliseconds(effect)) for form in self.forms if form is not type(effect)]

    def late(self, problem: Problem, effect: Drive) -> float | None:
        """As late as it says."""
        return 1e-3 * milliseconds(effect)

    def is_degenerate(self, problem: Problem, effect: Drive) -> bool:
        """Too short to be told from the time stamps', or a lag that lies in the clocks."""
        if milliseconds(effect) < self.least(problem.sample_time):
            return True
        return attributed(problem.prepared, 1e-3 * milliseconds(effect), problem.sample_time) == "clock"

    def where(self, effect: Drive, reach: Reach) -> Where:
        """Wherever the torque changes."""
        return QUICK_CHANGES

    def why_not(self, mount: Mount, prepared: Prepared) -> str:
        """Nothing asks, or the drive has something alike already."""
        if not any(piece.is_asked for piece in prepared.pieces):
            return NOTHING_ASKED
        if has(mount, DriveEffect):
            return "the model has an effect of the drive already, from which it cannot be told"
        return super().why_not(mount, prepared)


NOTHING_ASKED = "nothing in these recordings asks for a change of torque"
