"""A Python function is a component like any other: same delays, same bits in both loops, its errors named."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oscillators import BOTH, Tiny
from simulating import alone, simulate
from small_loop import text_of

from cosim.fmi.function import FunctionComponent
from cosim.master.result import RunResult
from cosim.master.simulate import run
from cosim.support.errors import ScenarioError, StepError, WiringError
from cosim.system.scenario import parse_scenario

IN, OUT = {"a": "rad", "b": "rad"}, {"y": "rad"}


def proportional(t: float, a: float, b: float, k: float = 5.0) -> float:
    return k * (a - b)


def control_loop(plant: Path, controller: Any, parameters: Any, **options: Any) -> RunResult:
    both, record = {"plant": plant, "controller": controller}, {"q": "plant.y", "u": "controller.y"}
    wires = [("controller.y", "plant.a"), ("plant.y", "controller.b"), ("r", "controller.a")]
    options |= {"step": 1e-2, "ticks": 100, "signals": {"r": 1.0}, "parameters": {"controller": parameters}}
    return simulate(both, wires, record=record, **options)


@BOTH
@pytest.mark.parametrize("every", [1, 3])
def test_a_function_does_what_the_same_fmu_does(tiny: Tiny, every: int, compiled: bool) -> None:
    fmu = control_loop(tiny[3], tiny[3], {"mode": 1.0, "k": 4.0}, every={"controller": every})
    function = FunctionComponent(proportional, IN, OUT)
    plain = control_loop(tiny[3], function, {"k": 4.0}, every={"controller": every}, compiled=compiled)
    for name in ("q", "u"):
        np.testing.assert_array_equal(plain.recording[name], fmu.recording[name])
    assert plain.statistics["loop"] == ("compiled" if compiled else "interpreted")
    assert plain.statistics["notes"][0] == "controller is a Python function: each of its steps costs microseconds."


class Counter:
    """Count its steps."""

    def __init__(self, first: float) -> None:
        self.count = first

    def __call__(self, t: float, a: float) -> dict[str, float]:
        self.count += 1
        return {"count": self.count, "t": t}


def test_a_class_remembers_within_a_run_and_begins_anew_in_the_next() -> None:
    component = FunctionComponent(Counter, {"a": ""}, {"count": "1", "t": "s"})
    given: dict[str, Any] = {"signals": {"r": 0.0}, "parameters": {"one": {"first": 10.0}}, "step": 0.5}
    for _ in range(2):
        done = alone(component, [("r", "one.a")], {"count": "one.count", "time": "one.t"}, **given).recording
        np.testing.assert_array_equal(done["count"], [0, 11, 12, 13])
        np.testing.assert_array_equal(done["time"], [0, 0, 0.5, 1.0])


@BOTH
@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda t, a, b: 1 / (b - b), "ZeroDivisionError: float division by zero"),
        (lambda t, a, b: {"z": 1.0}, "ValueError: it must return a dictionary with y; it returned z"),
        (lambda t, a, b: "much", "ValueError: could not convert string to float: 'much'"),
    ],
)
def test_what_a_function_raises_ends_the_run_with_its_words(
    tiny: Tiny, function: Any, said: str, compiled: bool
) -> None:
    sentence = f'controller returned an error at tick 0 (0 s); it said "{said}"; its last inputs: b = 0, a = 1.'
    with pytest.raises(StepError, match=re.escape(sentence)):
        control_loop(tiny[2], FunctionComponent(function, IN, OUT, "controller"), {}, compiled=compiled)


def test_parameters_that_a_function_does_not_take_are_refused(tiny: Tiny) -> None:
    with pytest.raises(WiringError, match=r"controller cannot be called with its inputs and parameters: .*'gain'"):
        control_loop(tiny[2], FunctionComponent(proportional, IN, OUT, "controller"), {"gain": 1.0})
    with pytest.raises(WiringError, match="missing a required argument: 'c'"):
        control_loop(tiny[2], FunctionComponent(lambda t, a, b, c: 0.0, IN, OUT, "controller"), {})


def controlled(folder: Path, plant: Path, *left_out: str) -> str:
    """The text of a scenario whose controller is a function in a file."""
    given = {"python": folder / "control.py:proportional", "inputs": IN, "outputs": OUT, "parameters": {"k": 2.0}}
    controller = {key: value for key, value in given.items() if key not in left_out}
    wires = {"plant.a": "controller.y", "controller.b": "plant.y", "controller.a": "r"}
    tables = {"signals": {"r": {"kind": "constant", "value": 1.0}}, "record": {"signals": ["plant.y"]}}
    both = {"plant": {"fmu": plant}, "controller": controller}
    return text_of(wires, stop=0.1, step=1e-2, components=both, **tables)


def test_a_scenario_names_a_function_in_a_file(tiny: Tiny, tmp_path: Path) -> None:
    (tmp_path / "control.py").write_text("def proportional(t, a, b, k):\n    return k * (a - b)\n")
    done = run(parse_scenario(controlled(tmp_path, tiny[3]), "x.toml", Path()))
    assert done.recording["plant.y"][-1] > 0
    origin = done.recording.origin["components"]["controller"]
    assert (origin["function"], origin["parameters"]) == ("control.py:proportional", {"k": 2.0})
    assert len(origin["sha256"]) == 64


@pytest.mark.parametrize(
    ("content", "left_out", "sentence"),
    [
        (None, "", 'control.py:proportional": the file does not exist; write "file.py:function".'),
        ("1 / 0", "", "the file cannot be run: ZeroDivisionError: division by zero."),
        ("def pd(t): ...", "", 'there is no function "proportional"; there are: pd.'),
        ("", "outputs", "components.controller breaks a rule: give fmu = "),
    ],
)
def test_a_function_that_is_not_there_is_refused(
    tiny: Tiny, tmp_path: Path, content: str | None, left_out: str, sentence: str
) -> None:
    if content is not None:
        (tmp_path / "control.py").write_text(content)
    with pytest.raises(ScenarioError, match=re.escape(sentence)):
        run(parse_scenario(controlled(tmp_path, tiny[3], left_out), "x.toml", Path()))
