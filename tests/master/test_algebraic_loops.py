"""Algebraic loops are named, solved or broken knowingly; an algorithm that does not fit is refused."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oscillators import BOND, BOTH, Tiny, oscillator, plain
from simulating import simulate
from tiny_fmu import described, description, tiny

from cosim.master.result import RunResult
from cosim.support.errors import StepError, WiringError
from cosim.system.algorithm import Energy, GaussSeidel, Iterated, Jacobi
from cosim.system.wire import Wire

__all__ = ["plain", "tiny"]


@pytest.fixture(scope="module")
def direct(tiny: Tiny, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tiny FMU that says that its output follows its inputs at once."""
    return described(tiny[3], tmp_path_factory.mktemp("direct") / "direct.fmu", description(3, direct=True))


def amplifiers(fmu: Path, algorithm: Any, **options: Any) -> RunResult:
    """y1 = 4 (1 - y2), y2 = 3 y1, both at once: y1 = 4/13."""
    wires = [Wire("r", "one.a"), Wire("two.y", "one.b", **options.pop("wire", {})), Wire("one.y", "two.a")]
    parameters = {"one": {"mode": 2.0, "k": 4.0}, "two": {"mode": 2.0, "k": 3.0}}
    settings: dict[str, Any] = {"record": {"y": "one.y"}, "step": 0.1, "ticks": 5, "parameters": parameters}
    settings |= {"signals": {"r": 1.0}}
    return simulate({"one": fmu, "two": fmu}, wires, algorithm=algorithm, **(settings | options))


@pytest.mark.parametrize("algorithm", [Jacobi(), GaussSeidel(kind="gauss-seidel")])
def test_an_algebraic_loop_is_named_before_the_first_step(direct: Path, algorithm: Any, tmp_path: Path) -> None:
    sentence = f"each follows the one before at once, and {algorithm.kind} cannot solve that. Choose the algorithm"
    with pytest.raises(WiringError, match=sentence) as caught:
        amplifiers(direct, algorithm)
    assert set(caught.value.value) == {"one.y", "two.a", "two.y", "one.b"}
    with pytest.raises(WiringError, match=sentence):
        amplifiers(direct, algorithm, path=tmp_path / "r.parquet")
    assert not list(tmp_path.iterdir())


@BOTH
def test_outputs_that_follow_inputs_at_once_have_met_them_at_the_start(direct: Path, compiled: bool) -> None:
    done = simulate(
        {"last": direct, "first": direct},
        [("r", "first.a"), ("first.y", "last.a")],
        record={"y": "last.y", "r": "r"},
        step=0.1,
        ticks=3,
        signals={"r": np.array([1.0, 2.0, 3.0])},
        parameters={"first": {"mode": 2.0, "k": 4.0}, "last": {"mode": 2.0, "k": 3.0}},
        compiled=compiled,
    ).recording
    np.testing.assert_array_equal(done["y"], [12, 12, 12])  # at tick 0 met; then a tick of delay each


@BOTH
def test_iteration_solves_an_algebraic_loop(direct: Path, compiled: bool) -> None:
    run = amplifiers(direct, Iterated(kind="iterated"), compiled=compiled)
    np.testing.assert_allclose(run.recording["y"], 4 / 13, rtol=1e-8)


def test_a_loop_may_be_broken_knowingly_and_a_doubtful_one_is_told(direct: Path, tiny: Tiny, tmp_path: Path) -> None:
    run = amplifiers(direct, Jacobi(), wire={"breaks_loop": True})
    np.testing.assert_allclose(run.recording["y"][:4], [4, 4 * (1 - 12), 4 * (1 - 12), 4 * (1 + 3 * 44)])
    silent = description(3).replace(' dependencies=""', "")
    note = amplifiers(described(tiny[3], tmp_path / "silent.fmu", silent), Jacobi()).statistics["notes"][0]
    assert note.startswith("An algebraic loop cannot be excluded, because ")
    assert "do not say what their outputs depend on" in note


@BOTH
def test_components_that_do_not_agree_are_named(direct: Path, compiled: bool) -> None:
    algorithm, jump = Iterated(kind="iterated", max_iterations=2), {"r": np.array([1.0, 2.0, 2.0, 2.0, 2.0])}
    with pytest.raises(StepError, match="one and those coupled with it did not agree within the iterations allowed"):
        amplifiers(direct, algorithm, signals=jump, compiled=compiled)


MISTAKES: list[tuple[Any, Mapping[str, int], str]] = [
    (GaussSeidel(kind="gauss-seidel", order=("mass",)), {}, "it must name each component once: mass, spring."),
    (
        Iterated(kind="iterated", components=("mas",)),
        {},
        'algorithm.components names "mas", which is no component; components are: mass, spring.',
    ),
    (Iterated(kind="iterated"), {"mass": 2}, '"mass" steps every 2 ticks; components that are coupled must step at'),
    (Jacobi(), {"mas": 2}, '"mas" is given a step, but is no component; components are: mass, spring.'),
    (Jacobi(), {"mass": 0}, '"mass" shall step every 0 ticks; that must be a whole number from 1 on.'),
    (
        Energy(kind="energy", bonds=BOND),
        {},
        'The bond of "mass.y" [rad] and "spring.y" [rad] is no power; their product must be in W.',
    ),
    (
        Energy(kind="energy", bonds=(("mass.y", "mass.y"),)),
        {},
        'The bond of "mass.y" and "mass.y" needs a wire from each of them to the component of the other.',
    ),
]


@pytest.mark.parametrize(("algorithm", "every", "sentence"), MISTAKES)
def test_an_algorithm_that_does_not_fit_is_refused(
    tiny: Tiny, algorithm: Any, every: Mapping[str, int], sentence: str
) -> None:
    with pytest.raises(WiringError, match=re.escape(sentence)):
        oscillator(tiny[3], algorithm, every=every)


def test_iteration_needs_components_that_can_be_taken_back(tiny: Tiny, tmp_path: Path) -> None:
    fmu = described(tiny[2], tmp_path / "forward.fmu", description(2, state=False))
    with pytest.raises(WiringError, match='"mass" cannot save and restore its state, which the iterated algorithm'):
        oscillator(fmu, Iterated(kind="iterated"))


def test_pieces_of_a_step_need_components_that_take_them(plain: Tiny, tmp_path: Path) -> None:
    fmu = described(plain[3], tmp_path / "stiff.fmu", description(3, can_vary_step=False))
    with pytest.raises(WiringError, match='"mass" takes steps of one length only, and the energy algorithm cuts them'):
        oscillator(fmu, Energy(kind="energy", bonds=BOND))


def test_a_quantised_wire_is_not_iterated(tiny: Tiny) -> None:
    wires = [Wire("one.y", "two.a", quantum=0.1), Wire("two.y", "one.a")]
    with pytest.raises(WiringError, match=r'The wire to "two.a" is quantised; values that are iterated must be smooth'):
        simulate(
            {"one": tiny[3], "two": tiny[3]},
            wires,
            record={"y": "one.y"},
            step=1.0,
            ticks=1,
            algorithm=Iterated(kind="iterated"),
        )
