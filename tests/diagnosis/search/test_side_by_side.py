"""Refits in two processes: the same as in one, whatever happens to the other."""

import os
import signal
from collections.abc import Callable
from threading import Event
from typing import Any

import numpy as np
import pytest
from test_search import compared

from cosim.diagnosis.search import side_by_side
from cosim.diagnosis.search.side_by_side import SideBySide
from cosim.diagnosis.search.stages import CandidateFit, InTurn, starts
from cosim.support.cell import Cell
from pyfmi_models.effects.backlash import Backlash


@pytest.fixture(scope="module")
def problem() -> Any:
    """A comparison, its base, and what is worth a refit; a play among it, which takes longest."""
    comparison, base = compared(lambda q, _: 0.5 * np.sin(6 * q + 0.3))
    play = Backlash(gap_rad=0.01, load_share=0.3, load_friction=0.5, load_viscous=0.1)
    return comparison, base, [*starts(comparison.screen(base), comparison.policy)[:3], (play, 4)]


@pytest.fixture(scope="module")
def alone(problem: Any) -> list[CandidateFit]:
    """What one process finds."""
    return InTurn()(*problem)


def assert_same(found: list[CandidateFit], expected: list[CandidateFit]) -> None:
    for one, other in zip(found, expected, strict=True):
        assert (one.effect, one.fit.mount, one.evidence) == (other.effect, other.fit.mount, other.evidence)
        assert np.array_equal(one.fit.slopes, other.fit.slopes)


def counted(monkeypatch: pytest.MonkeyPatch, before: Callable[[Cell, int], None] = lambda *_: None) -> list[object]:
    """What the other process was asked for, which this one waits for; something happens to it before that."""
    asked, call, here, begun = [], Cell.call, side_by_side.refitted, Event()

    def counting(cell: Cell, function: Any, *arguments: Any) -> Any:
        if function is side_by_side._refitted:
            before(cell, len(asked))
            asked.append(arguments[0])
            begun.set()
        return call(cell, function, *arguments)

    def patient(*arguments: Any) -> CandidateFit:
        assert begun.wait(60)
        return here(*arguments)

    monkeypatch.setattr(Cell, "call", counting)
    monkeypatch.setattr(side_by_side, "refitted", patient)
    return asked


def test_two_processes_find_what_one_finds(
    problem: Any, alone: list[CandidateFit], monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    asked = counted(monkeypatch)
    with SideBySide(said.append) as both:
        assert_same(both(*problem), alone)
        assert_same(both(*problem), alone)
    assert asked
    assert said
    assert said[0] == "Backlash (1 of 4)"
    assert len(asked) + len(said) == 8


def test_what_a_process_had_taken_when_it_was_killed_is_done_here(
    problem: Any, alone: list[CandidateFit], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = counted(monkeypatch, lambda cell, _: os.kill(cell.pid, signal.SIGKILL))
    with SideBySide() as both:
        assert_same(both(*problem), alone)
        assert len(asked) == 1
        assert_same(both(*problem), alone)
    assert len(asked) == 1


def test_where_no_process_can_be_started_one_does_it_all(
    problem: Any, alone: list[CandidateFit], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuses(_: Cell) -> None:
        raise OSError("no room")

    monkeypatch.setattr(Cell, "begin", refuses)
    with SideBySide() as both:
        assert_same(both(*problem), alone)


def test_what_fails_here_ends_both(problem: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(side_by_side, "refitted", interrupted)
    with pytest.raises(KeyboardInterrupt), SideBySide() as both:
        both(*problem)
    assert both._cell.pid == 0


@pytest.mark.parametrize(("cores", "kind"), [(1, InTurn), (2, SideBySide)])
def test_one_core_has_one_process(cores: int, kind: type[InTurn], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(side_by_side, "cores", lambda: cores)
    with side_by_side.side_by_side(lambda _: None) as made:
        assert type(made) is kind
