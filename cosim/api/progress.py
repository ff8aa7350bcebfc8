"""How far a diagnosis is: the stage it is in, of how many, and about how long it takes still."""

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple


class Stage(NamedTuple):
    """A stage: how what is told in it begins ("" for everything else), and its usual share of the time."""

    begins: str
    share: float


CARD = Stage("estimating a card", 0.05)
SEARCH = (
    Stage("refitting the base", 0.12),
    Stage("", 0.38),
    Stage("proving on", 0.35),
)
FILES = (
    Stage("building the improved FMU", 0.03),
    Stage("closing the loop", 0.02),
    Stage("writing the report", 0.10),
)
"""Shares of the time, measured on the recordings of `cosim demo`: 25 s on two cores."""
SURE = 2.0
"""Seconds after which the time to go is told."""


def stages_of(has_card: bool, writes_all: bool) -> tuple[Stage, ...]:
    """The stages of a diagnosis with these inputs and outputs."""
    return (*(() if has_card else (CARD,)), *SEARCH, *(FILES if writes_all else ()))


class Staged:
    """Tells somebody what is being done, with the stage before and the time to go behind it.

    Args:
        tell: who is told, in one line: "stage 2 of 6: Delay (3 of 14), about 12 s left".
        stages: in their order; what is told goes on to a later one and never back.
        clock: seconds.
    """

    def __init__(
        self, tell: Callable[[str], None], stages: Sequence[Stage], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._tell, self._stages, self._clock = tell, stages, clock
        self._began, self._now = clock(), 0

    def __call__(self, text: str) -> None:
        """Tell what is being done."""
        self._now = self._stage(text)
        left = self._remaining()
        said = f", about {left:.0f} s left" if left is not None else ""
        self._tell(f"stage {self._now + 1} of {len(self._stages)}: {text}{said}")

    def _stage(self, text: str) -> int:
        """Number of the stage that a text belongs to."""
        for number, stage in enumerate(self._stages):
            if stage.begins and text.startswith(stage.begins):
                return max(number, self._now)
        others = [number for number, stage in enumerate(self._stages) if not stage.begins]
        return max(self._now, others[0]) if others and self._now + 1 >= others[0] else self._now

    def _remaining(self) -> float | None:
        """Seconds to go, from what the stages before have taken; None while little is known."""
        spent = self._clock() - self._began
        done = sum(stage.share for stage in self._stages[: self._now])
        if spent < SURE or done <= 0:
            return None
        here = self._stages[self._now].share / 2
        return spent * (sum(stage.share for stage in self._stages) - done - here) / (done + here)
