"""How far an investigation is: the stage, of at most how many, about how long at most, and the best answer so far."""

import time
from collections.abc import Callable
from math import floor

from cosim_investigation.loop import SHORTEST
from cosim_investigation.story import Answered, Moved

MOVE, DIAGNOSE, DESIGN = range(3)
"""The stages of a round."""
BEGINS = {"moving": MOVE, "designing": DESIGN}
"""How a text of a stage begins; all others come from the diagnosis."""
PAIR = 2
"""Motions of a round: one to fit, one for validation."""


class Rounds:
    """Says what an investigation does; call it with a text, and `step` with what has happened.

    A round is motion, diagnosis, design; how many there are is known only as the most that the budget of motion allows.

    Args:
        tell: called with "stage 5 of at most 12: Delay (3 of 14); best so far: cogging, validation error 0.8 -> 0.2;
            at most about 40 s left".
        budget: seconds of motion in all.
        seconds: length of one motion [s].
        clock: seconds.
    """

    def __init__(
        self,
        tell: Callable[[str], None],
        budget: float,
        seconds: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._tell, self._budget, self._seconds, self._clock = tell, budget, seconds, clock
        self._began, self._stage, self._rounds, self._spent = clock(), MOVE, 0, 0.0
        self._moved = 0
        self._best: Answered | None = None

    def __call__(self, text: str) -> None:
        """Tell what is being done."""
        now = BEGINS.get(text.partition(":")[0].split()[0] if text.strip() else "", DIAGNOSE)
        if now < self._stage:
            self._rounds, self._moved = self._rounds + 1, 0
        self._stage = now
        self._tell(
            "; ".join(
                filter(None, [f"stage {self._number} of {self._most()}: {text}", self._so_far(), self._time_left()])
            )
        )

    def before(self, on_step: Callable[[Moved | Answered], None]) -> Callable[[Moved | Answered], None]:
        """Take in each recording and answer before `on_step` is called with it."""

        def happened(step: Moved | Answered) -> None:
            self.step(step)
            on_step(step)

        return happened

    def step(self, step: Moved | Answered) -> None:
        """Take in a recording or an answer."""
        if isinstance(step, Moved):
            self._spent, self._moved = self._spent + step.seconds, self._moved + 1
        elif self._best is None or step.after <= self._best.after:
            self._best = step

    @property
    def _number(self) -> int:
        return 3 * self._rounds + self._stage + 1

    def _to_come(self) -> int:
        """Rounds that the budget of motion allows after this one."""
        moving = self._seconds * max(PAIR - self._moved, 0) if self._stage == MOVE else 0.0
        room = max(self._budget - self._spent - moving, 0.0)
        whole = floor(room / (PAIR * self._seconds) + 1e-9)
        return whole + (room - whole * PAIR * self._seconds >= PAIR * SHORTEST)

    def _most(self) -> str:
        """Return the number of the last stage, which is a diagnosis."""
        more = self._to_come()
        return f"at most {3 * (self._rounds + more) + DIAGNOSE + 1}" if more else f"{3 * self._rounds + DIAGNOSE + 1}"

    def _so_far(self) -> str:
        if self._best is None:
            return ""
        return f"best so far: {self._best.words}, validation error {self._best.before:.3g} -> {self._best.after:.3g}"

    def _time_left(self) -> str:
        """Say how long it takes at most, from what the rounds before have taken; "" in the first round."""
        if not self._rounds:
            return ""
        pace = (self._clock() - self._began) / (self._number - 1)
        return f"at most about {pace * (3 * self._to_come() + DIAGNOSE + 1 - self._stage):.0f} s left"
