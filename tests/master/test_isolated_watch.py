"""A run that is watched from outside: when a call counts as overdue, and what is said of a process that is gone."""

import signal
from pathlib import Path
from typing import Any

import pytest
from test_isolation import FUNCTION

from cosim.master.isolated import Call, Watch, run_isolated
from cosim.master.loop.structures import CLoop
from cosim.master.simulate import Options
from cosim.support.activity import Board
from cosim.support.cell import LostError
from cosim.system.scenario import Scenario, read_scenario


class Clock:
    """A time that goes on when it is told to."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def board() -> Board:
    return Board()


@pytest.fixture
def loop(board: Board) -> Any:
    return board.loop(CLoop, ["controller", "plant"])


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def watch(board: Board, loop: Any, clock: Clock) -> Watch:
    """It begins while tick 7 of the plant is stepped; a call may take two seconds."""
    stepping(loop, 1, 7)
    return Watch(board, 0.001, 2.0, clock)


def stepping(loop: Any, part: int, tick: int) -> None:
    """As the loop says whose functions it calls: see `enter` in part.h."""
    loop.status, loop.tick = -1 - part, tick


def overdue_after(watch: Watch, clock: Clock, seconds: float) -> str:
    clock.now += seconds
    return watch.overdue()


def test_a_call_is_overdue_once_it_took_longer_than_it_may(watch: Watch, clock: Clock) -> None:
    assert [overdue_after(watch, clock, seconds) for seconds in (1.0, 1.0)] == ["", ""]
    assert overdue_after(watch, clock, 0.001) == "a call did not return"


@pytest.mark.parametrize(("part", "tick"), [(0, 7), (1, 8)])
def test_a_loop_that_goes_on_has_its_time_anew(watch: Watch, clock: Clock, loop: Any, part: int, tick: int) -> None:
    clock.now += 1.5
    stepping(loop, part, tick)
    assert [overdue_after(watch, clock, seconds) for seconds in (0.0, 1.5)] == ["", ""]
    assert overdue_after(watch, clock, 1.0) != ""


def test_work_between_calls_of_components_is_never_overdue(watch: Watch, clock: Clock, loop: Any, board: Board) -> None:
    loop.status = 0
    assert [overdue_after(watch, clock, 100.0) for _ in range(3)] == ["", "", ""]
    board.write("plant", "loaded")
    assert overdue_after(watch, clock, 0.0) == ""
    assert overdue_after(watch, clock, 2.5) != ""


def test_what_is_done_with_a_component_comes_before_what_the_loop_said_last(board: Board, loop: Any) -> None:
    stepping(loop, 1, 7)
    assert Call.of(board) == Call("plant", "stepped", 7)
    board.write("controller", "initialised")
    assert Call.of(board) == Call("controller", "initialised", 7)
    board.write()
    loop.status = 0
    assert Call.of(board) == Call("", "", 7)
    stepping(loop, 9, 7)
    assert Call.of(board).component == "plant", "a number beyond the last names the last"


@pytest.mark.parametrize(
    ("status", "code", "sentence"),
    [
        ("timeout", 0, "did not return within 2 s while it was stepped at tick 1,500 (1.5 s); --call-timeout lets"),
        ("crashed", 0, "ended its process with exit code 0 while it was stepped at tick 1,500 (1.5 s); a component"),
        ("crashed", 3, "ended its process with exit code 3 while"),
        ("crashed", -signal.SIGSEGV, "crashed: SIGSEGV, segmentation fault, while"),
        ("crashed", -signal.SIGKILL, "crashed: SIGKILL, killed, perhaps because memory ran out, while"),
        ("crashed", -signal.SIGTRAP, "crashed: SIGTRAP, while"),
        ("crashed", -1000, "crashed with signal 1000 while"),
    ],
)
def test_the_sentence_says_who_what_when_and_how(
    board: Board, loop: Any, scenario: Path, status: str, code: int, sentence: str
) -> None:
    given = read_scenario(scenario)
    stepping(loop, 0, 1500)
    error = Watch(board, 0.001, 2.0).error(LostError(status, "reason", code), given)
    source = given.components["controller"].fmu
    assert f"controller ({source}) {sentence}" in str(error)
    assert str(error).endswith("Nothing was recorded.")
    assert (error.component, error.reason) == ("controller", "reason")


def test_a_time_is_said_only_of_a_step_and_a_process_may_end_outside_of_all_calls(board: Board, scenario: Path) -> None:
    watch, lost, given = Watch(board, 0.001, 2.0), LostError("crashed", "reason", 1), read_scenario(scenario)
    rule = "ended its process with exit code 1{}; a component must return"
    assert str(watch.error(lost, given)).startswith(f"The process of the run {rule.format('')}")
    board.write("odd", "loaded")
    assert str(watch.error(lost, given)).startswith(f"odd {rule.format(' while it was loaded')}")


def test_what_a_component_writes_is_shown_and_progress_is_told(
    scenario: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    speaks = "import sys\nsys.stderr.write('heard from odd\\n')\n\ndef odd(t, q):\n    return q\n"
    (tmp_path / "odd.py").write_text(speaks)
    scenario.write_text(scenario.read_text() + FUNCTION)
    told: list[tuple[int, int]] = []
    given: Scenario = read_scenario(scenario)
    run_isolated(given, Options(tmp_path / "a.parquet", on_progress=lambda done, of: told.append((done, of))))
    assert "heard from odd" in capfd.readouterr().err
    assert told[-1] == (given.ticks, given.ticks)
