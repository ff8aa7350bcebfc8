"""A scenario in hand: the same bits as a run, values read and set between steps, one sentence for what cannot be."""

from pathlib import Path

import numpy as np
import pytest

import cosim
from cosim.support.errors import StepError, WiringError


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("pieces", [[500], [1] * 500, [100, 1, 3, 396]])
def test_steps_of_any_length_give_the_bits_of_a_run(scenario: Path, pieces: list[int], compiled: bool) -> None:
    run = cosim.run(scenario).recording
    with cosim.open(scenario, compiled=compiled) as session:
        for ticks in pieces:
            session.step(ticks)
        assert session.tick == 500
        assert session.t == pytest.approx(0.5)
        mine = session.recording
    assert mine.columns == run.columns
    for name in run.columns:
        assert np.array_equal(mine[name], run[name][: len(mine)]), name
    assert len(mine) >= len(run) - 1


def test_a_controller_in_python_acts_in_the_next_step(scenario: Path) -> None:
    """One that computes what the component does gives the same bits."""
    with cosim.open(scenario) as given, cosim.open(scenario) as mine:
        for _ in range(50):
            given.step()
            mine.step()
            mine["controller.y"] = given["controller.y"]
            assert mine["plant.y"] == given["plant.y"]
        mine["controller.y"] = given["controller.y"] + 1.0
        for session in (given, mine):
            session.step(2)
        assert mine["plant.y"] != given["plant.y"]


def test_an_input_without_a_wire_keeps_what_it_is_given(scenario: Path) -> None:
    with cosim.open(scenario) as session:
        session["plant.b"] = 0.25
        assert session["plant.b"] == 0.25
        for _ in range(3):
            session.step(700)  # more than one block of signals
            assert session["plant.b"] == 0.25
        still = session["plant.y"]
        session["plant.b"] = 1e3
        session.step(5)
        assert session["plant.y"] < still


@pytest.mark.parametrize(
    ("name", "value", "error", "sentence"),
    [
        ("plant.x", 1.0, WiringError, r'There is no "plant\.x"; there are: .*plant\.y'),
        ("plant.a", 1.0, WiringError, r'"plant\.a" is fed by controller\.y: set that'),
        ("r.position", 1.0, WiringError, r'"r\.position" is a signal, which a scenario gives'),
        ("controller.y", float("nan"), StepError, r'"controller\.y" is set to nan; it must be a finite number'),
    ],
)
def test_what_cannot_be_set_is_one_sentence(
    scenario: Path, name: str, value: float, error: type[Exception], sentence: str
) -> None:
    with cosim.open(scenario) as session, pytest.raises(error, match=sentence):
        session[name] = value


def test_a_component_that_fails_says_when_and_the_rows_before_are_there(scenario: Path) -> None:
    failing = {"plant.fail_at": 0.1, "plant.status": 3.0}
    with cosim.open(scenario, set=failing) as session:
        with pytest.raises(StepError, match=r"plant returned an error at tick 100 \(0\.1 s\)"):
            session.step(500)
        assert len(session.recording) == 50
        with pytest.raises(StepError, match=r"The simulation failed: it cannot be stepped on\."):
            session.step()


def test_a_component_that_asks_to_end_ends_the_session_without_an_error(scenario: Path) -> None:
    with cosim.open(scenario, set={"plant.fail_at": 0.1, "plant.status": 17.0}) as session:
        session.step(500)
        assert session.ended.startswith("plant asked to end the simulation at tick 10")
        with pytest.raises(StepError, match=r"asked to end the simulation .*: it cannot be stepped on"):
            session.step()
