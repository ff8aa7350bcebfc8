"""What makes the torque late: a dead time, or a lag. The two are twins: alike at first order, so they are asked as one.

Which of them it is the set point tells, see `instrumental_variable.py`. Whether the reading is late, or the torque,
nothing tells between the two of them; the set point does again. A torque that acts late and a reading that is late are
the same relation of torque and motion. But a loop that sees its encoder in time corrects what the drive delays, and
follows slow motion as before; a reading that reaches the recording late trails the set point beside it by just that
time. So the reading's lag behind slow set points is measured,

    q_d - q = L v_d + (terms in acceleration, jerk, direction and a constant),

and compared with the lag T that torque and motion show. L = T: the clock. L well below T: the drive. More than
that a loop may trail by itself, so either may be true; and without a recorded set point nothing is known.
"""

from collections.abc import Iterator
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from cosim.diagnosis.effects.base import QUICK_CHANGES, Hypothesis
from cosim.diagnosis.effects.candidates import Candidate, Span, has
from cosim.estimation.filters import derivative, lowpass
from cosim.estimation.prepare import Array, Piece, Prepared
from cosim.estimation.problem import Problem
from cosim.support.kept import kept_with
from cosim.support.statistics import SURELY
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
    acts = QUICK_CHANGES

    def may_come(self, mount: Mount) -> bool:
        """A delay beside a lag too."""
        return True

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

    def is_degenerate(self, problem: Problem, effect: Drive) -> bool:
        """Too short to be told from the time stamps', or a lag that lies in the clocks."""
        if milliseconds(effect) < self.least(problem.sample_time):
            return True
        return attributed(problem.prepared, 1e-3 * milliseconds(effect), problem.sample_time) == "clock"

    def why_not(self, mount: Mount, prepared: Prepared) -> str:
        """Nothing asks, or the drive has something alike already."""
        if not any(piece.is_asked for piece in prepared.pieces):
            return NOTHING_ASKED
        if has(mount, DriveEffect):
            return "the model has an effect of the drive already, from which it cannot be told"
        return super().why_not(mount, prepared)


NOTHING_ASKED = "nothing in these recordings asks for a change of torque"


SLOW = 1.0
"""Hz: a loop follows motion this slow as well as it ever will."""
AGREES = 0.1
"""The two lags are one and the same if they differ by less than this share: a loop trails so by rare accident."""


class ReadingLag(NamedTuple):
    """Time [s] by which the reading trails the set point in slow motion, and its standard error."""

    seconds: float
    error: float


def attributed(prepared: Prepared, seconds: float, sample_time: float) -> Literal["drive", "clock", "either"]:
    """What a torque that acts `seconds` late, to judge by torque and motion, is due to.

    Less than a sample is no matter of two clocks: one loop writes torque and reading of a row in the same tick.
    """
    if seconds < sample_time:
        return "drive"
    late = reading_lag(prepared)
    if late is None or SURELY * late.error > seconds / 4:
        return "either"
    if abs(late.seconds - seconds) < AGREES * seconds + SURELY * late.error:
        return "clock"
    return "drive" if late.seconds < seconds / 2 else "either"


@kept_with()
def reading_lag(prepared: Prepared) -> ReadingLag | None:
    """Measure it on all pieces together; None where position or set point was not recorded, or nothing moved."""
    if not prepared.has_position or any("q_d" not in piece.extras for piece in prepared.pieces):
        return None
    parts = [_followed(piece) for piece in prepared.pieces]
    behind, shapes = np.concatenate([b for b, _ in parts]), np.concatenate([s for _, s in parts])
    size = np.abs(shapes).max(0)
    if not size[0] > 0:
        return None
    scaled = shapes / np.where(size > 0, size, 1.0)
    fitted = np.linalg.lstsq(scaled, behind, rcond=1e-9)[0]
    own = scaled[:, 0] - scaled[:, 1:] @ np.linalg.lstsq(scaled[:, 1:], scaled[:, 0], rcond=1e-9)[0]
    independent = 2 * SLOW * sum(float(piece.t[-1] - piece.t[0]) for piece in prepared.pieces)
    error = np.std(behind - scaled @ fitted) / (np.std(own) + 1e-300) / np.sqrt(independent)
    return ReadingLag(float(fitted[0] / size[0]), float(error / size[0]))


def _followed(piece: Piece) -> tuple[Array, Array]:
    """How far the slow reading is behind its set point, (rows,), and what it may depend on, the lag first."""
    wanted = lowpass(piece.extras["q_d"], piece.dt, SLOW)
    v = derivative(wanted, piece.dt)
    a = derivative(v, piece.dt)
    turning = np.tanh(v / (0.01 * np.abs(v).max() + 1e-300))
    shapes = np.column_stack([v, a, derivative(a, piece.dt), turning, np.ones_like(v)])
    return (wanted - lowpass(piece.q, piece.dt, SLOW))[piece.inside], shapes[piece.inside]
