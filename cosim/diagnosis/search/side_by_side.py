"""The refits of a stage in two processes side by side: what a refit gives is the same wherever it is made.

Both take from one list, what takes longest first. What a process had taken when it was lost is done here.
"""

from collections import deque
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.search.candidate_fit import CandidateFit
from cosim.diagnosis.search.stages import InTurn, OnProgress, Start, refitted
from cosim.estimation.fit import Fit
from cosim.support.cell import Cell, LostError, cores
from pyfmi_models.effects.base import Coupling

Waiting = deque[int]
Found = dict[int, CandidateFit]
_STRUCTURE: dict[str, Any] = {}
"""In the other process: the comparison, and the structure beside which effects are tried now."""


def side_by_side(on_progress: OnProgress) -> InTurn:
    """Refits in two processes, or in one where there is one core."""
    return SideBySide(on_progress) if cores() > 1 else InTurn(on_progress)


class SideBySide(InTurn):
    """Refits here and in a process of its own, which is ended with the context.

    It has as many threads of linear algebra as this one (`cosim.support.threads`): sums over more differ in their last
    digit. `on_progress` is told, in a few words, what is being refitted here.
    """

    def __init__(self, on_progress: OnProgress = lambda _: None) -> None:
        super().__init__(on_progress)
        self._cell, self._is_lost = Cell(), False
        self._thread = ThreadPoolExecutor(1, "refits")
        self._thread.submit(self._called, _prepare)  # what it needs is loaded while recordings are looked at

    def __exit__(self, *_: object) -> None:
        self._is_lost = True
        self._cell.close()
        self._thread.shutdown()
        self._cell.close()  # it may have been starting just then

    def __call__(self, comparison: Comparison, current: Fit, worth: Sequence[Start]) -> list[CandidateFit]:
        """Refit a structure with each of some effects."""
        waiting = deque(sorted(range(len(worth)), key=lambda number: not isinstance(worth[number][0], Coupling)))
        found: dict[int, CandidateFit] = {}
        there = self._thread.submit(self._there, replace(comparison, offered={}), current, worth, waiting, found)
        try:
            self._here(comparison, current, worth, waiting, found)
            there.result()
        finally:
            waiting.clear()
        return [found.get(k) or refitted(comparison, current, *worth[k]) for k in range(len(worth))]

    def _here(
        self, comparison: Comparison, current: Fit, worth: Sequence[Start], waiting: Waiting, found: Found
    ) -> None:
        while (number := _taken(waiting)) is not None:
            effect, many = worth[number]
            self.say(effect, len(worth) - len(waiting), len(worth))
            found[number] = refitted(comparison, current, effect, many)

    def _there(
        self, comparison: Comparison, current: Fit, worth: Sequence[Start], waiting: Waiting, found: Found
    ) -> None:
        """Refit in the other process until nothing waits, or it is lost."""
        if not self._called(_begin, comparison, current):
            return
        while (number := _taken(waiting)) is not None:
            one = self._called(_refitted, *worth[number])
            if not one:
                return
            found[number] = one

    def _called(self, function: Any, *arguments: Any) -> Any:
        """What a function gives there; None where the process is lost."""
        if self._is_lost:
            return None
        try:
            return self._cell.call(function, *arguments)
        except (LostError, OSError, MemoryError, KeyboardInterrupt):
            self._is_lost = True
            return None


def _taken(waiting: Waiting) -> int | None:
    """The next number, if one is left."""
    try:
        return waiting.popleft()
    except IndexError:
        return None


def _prepare() -> bool:
    return True


def _begin(comparison: Comparison, current: Fit) -> bool:
    _STRUCTURE.update(comparison=comparison, current=current)
    return True


def _refitted(effect: Any, many: int) -> CandidateFit:
    return refitted(effect=effect, many=many, **_STRUCTURE)
