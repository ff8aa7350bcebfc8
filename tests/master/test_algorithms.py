"""Algorithms keep their closed forms and choose their pieces, in C and in Python with the same bits."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oscillators import BOND, BOTH, VERSIONS, H, Tiny, oscillator
from simulating import alone, pair, simulate
from tiny_fmu import described, description
from two_mass import START, export

from cosim.master.loop.coupling import _fitting, _growth
from cosim.master.result import RunResult
from cosim.support.errors import StepError, WiringError
from cosim.system.algorithm import Energy, GaussSeidel, Iterated, Jacobi
from cosim.system.wire import Wire


def recursion(advance: Any, ticks: int) -> tuple[np.ndarray, np.ndarray]:
    v, x, rows = 0.0, 0.0, []
    for _ in range(ticks):
        rows.append((v, x))
        v, x = advance(v, x)
    return tuple(np.array(rows).T)  # type: ignore[return-value]


def trapezoid(v: float, x: float) -> tuple[float, float]:
    next_v = ((1 - H * H / 4) * v + H * (1 - x)) / (1 + H * H / 4)
    return next_v, x + H * (v + next_v) / 2


def backward_euler(v: float, x: float) -> tuple[float, float]:
    next_v = (v + H * (1 - x)) / (1 + H * H)
    return next_v, x + H * next_v


CLOSED = {
    "jacobi": (Jacobi(), lambda v, x: (v + H * (1 - x), x + H * v)),
    "mass first": (
        GaussSeidel(kind="gauss-seidel", order=("mass", "spring")),
        lambda v, x: (v + H * (1 - x), x + H * (v + H * (1 - x))),
    ),
    "spring first": (
        GaussSeidel(kind="gauss-seidel", order=("spring", "mass")),
        lambda v, x: (v + H * (1 - x - H * v), x + H * v),
    ),
    "trapezoid": (Iterated(kind="iterated"), trapezoid),
    "backward Euler": (Iterated(kind="iterated", theta=1.0), backward_euler),
}


@BOTH
@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"fail_at": 0.5}, 'spring returned an error at tick 10 (0.5 s); it said "the shaft broke"; its last inputs'),
        ({"nan_at": 0.5}, "spring gave an output that is not a finite number at tick 10 (0.5 s)"),
    ],
)
@pytest.mark.parametrize("algorithm", [Iterated(kind="iterated"), Energy(kind="energy", bonds=BOND)])
def test_a_failure_among_coupled_components_is_named(
    plain: Tiny, algorithm: Any, parameters: dict[str, float], sentence: str, compiled: bool
) -> None:
    with pytest.raises(StepError, match=re.escape(sentence)):
        oscillator(plain[3], algorithm, parameters={"spring": parameters}, compiled=compiled)


@BOTH
@VERSIONS
@pytest.mark.parametrize("case", CLOSED)
def test_each_algorithm_is_the_method_it_says(tiny: Tiny, case: str, version: int, compiled: bool) -> None:
    algorithm, advance = CLOSED[case]
    run = oscillator(tiny[version], algorithm, compiled=compiled)
    v, x = recursion(advance, 400)
    np.testing.assert_allclose(run.recording["v"], v, rtol=0, atol=2e-8)
    np.testing.assert_allclose(run.recording["x"], x, rtol=0, atol=2e-8)


def test_the_energy_method_is_of_second_order_in_its_pieces_and_needs_no_rollback(plain: Tiny) -> None:
    errors = []
    for pieces in (2, 4):
        algorithm = Energy(kind="energy", bonds=BOND, tolerance=1e-12, max_pieces=pieces)
        run = oscillator(plain[3], algorithm, ticks=100)
        errors.append(np.abs(run.recording["x"] - (1 - np.cos(run.recording.t))).max())
        assert run.statistics["coupling"][0]["greatest"] == pieces
        assert "lost more energy than tolerated" in run.statistics["notes"][0]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.2)


def test_pieces_follow_the_energy_lost(plain: Tiny) -> None:
    def pieces(tolerance: float) -> int:
        run = oscillator(plain[2], Energy(kind="energy", bonds=BOND, tolerance=tolerance, max_pieces=256))
        effort = run.statistics["coupling"][0]
        assert (
            effort["at_limit"] < 0.02 * effort["rounds"]
        )  # at the start, where the greatest power so far is next to nothing
        return int(effort["rounds"])

    counts = [pieces(tolerance) for tolerance in (1e-2, 1e-4, 1e-6)]
    assert 400 <= counts[0] < counts[1] / 1.5 < counts[2] / 3


@pytest.fixture(scope="module")
def halves(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The two-mass mount: near side, far side and whole."""
    return export(tmp_path_factory.mktemp("halves"))


@pytest.mark.parametrize(
    ("algorithm", "least", "most"),
    [
        (Jacobi(), 1e-2, 1e-1),
        (GaussSeidel(kind="gauss-seidel"), 1e-4, 1e-3),
        (Iterated(kind="iterated"), 1e-4, 3e-4),
        (Energy(kind="energy", bonds=(("far.torque", "near.v"),), tolerance=1e-6), 0, 2e-6),
    ],
)
def test_the_split_mount_meets_the_whole_one_as_far_as_the_algorithm_goes(
    halves: dict[str, Path], algorithm: Any, least: float, most: float
) -> None:
    """Compare at 2 ms, where Jacobi swings ever wider; results/master/coupling.md shows all steps."""
    common: dict[str, Any] = {"step": 2e-3, "ticks": 150, "signals": {"tau": 10.0}}
    start = {"near": {"speed": START}, "far": {"speed": START, "v": START}}
    wires = [("far.torque", "near.disturbance"), ("near.v", "far.v"), ("tau", "near.tau")]
    two = {"near": halves["near"], "far": halves["far"]}
    split = simulate(two, wires, record={"v": "near.v"}, parameters=start, algorithm=algorithm, **common)
    whole = alone(halves["whole"], [("tau", "one.tau")], {"v": "one.v"}, parameters={"one": {"speed": START}}, **common)
    assert least <= np.abs(split.recording["v"] - whole.recording["v"]).max() <= most


# Algebraic loops are named, solved or broken knowingly; an algorithm that does not fit is refused.


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


MISTAKES: list[tuple[Any, Mapping[str, Any], str]] = [
    (GaussSeidel(kind="gauss-seidel", order=("mass",)), {}, "it must name each component once: mass, spring."),
    (Iterated(kind="iterated", components=("mas",)), {}, 'algorithm.components names "mas", which is no component'),
    (Iterated(kind="iterated"), {"every": 2}, '"mass" steps every 2 ticks; components that are coupled must step at'),
    (Iterated(kind="iterated"), {"state": False}, '"mass" cannot save and restore its state, which the iterated alg'),
    (Jacobi(), {"every": 0}, '"mass" shall step every 0 ticks; that must be a whole number from 1 on.'),
    (Energy(kind="energy", bonds=BOND), {}, 'The bond of "mass.y" [rad] and "spring.y" [rad] is no power; their'),
    (Energy(kind="energy", bonds=(("mass.y", "mass.y"),)), {}, 'The bond of "mass.y" and "mass.y" needs a wire from'),
    (Energy(kind="energy", bonds=BOND), {"can_vary_step": False}, '"mass" takes steps of one length only, and the ene'),
]


@pytest.mark.parametrize(("algorithm", "what", "sentence"), MISTAKES)
def test_an_algorithm_that_does_not_fit_is_refused(
    tiny: Tiny, tmp_path: Path, algorithm: Any, what: dict[str, Any], sentence: str
) -> None:
    every = {"mass": what["every"]} if "every" in what else {}
    told = description(3, **{name: value for name, value in what.items() if name != "every"})
    told = told.replace(' unit="rad"', "") if "can_vary_step" in what else told  # so that the bond is none of units
    with pytest.raises(WiringError, match=re.escape(sentence)):
        oscillator(described(tiny[3], tmp_path / "odd.fmu", told), algorithm, every=every)


def test_steps_of_a_component_that_is_none_and_quantised_iteration_are_refused(tiny: Tiny) -> None:
    with pytest.raises(WiringError, match='"mas" is given a step, but is no component; components are: mass, spring'):
        oscillator(tiny[3], Jacobi(), every={"mas": 2})
    wires = [Wire("one.y", "two.a", quantum=0.1), Wire("two.y", "one.a")]
    with pytest.raises(WiringError, match=r'The wire to "two.a" is quantised; values that are iterated must be smooth'):
        pair(tiny[3], wires, {"y": "one.y"}, algorithm=Iterated(kind="iterated"))


# What couplings choose by: sizes of pieces, their growth with the error.


@pytest.mark.parametrize("error", [0.03, 0.4, 1.0, 3.0, 20.0])
@pytest.mark.parametrize("before", [0.02, 0.7, 5.0])
def test_a_piece_grows_by_the_error_and_by_how_it_changed_within_bounds(before: float, error: float) -> None:
    """A PI controller of the step: 0.9 error^(-3/8) before^(1/4), between a fifth and one and a half."""
    assert _growth(before, error) == pytest.approx(np.clip(0.9 * error**-0.375 * before**0.25, 0.2, 1.5), rel=1e-14)
    assert _growth(before, 0.0) == 1.5, "without an error it grows most"
    assert _growth(0.0, 2.0) == pytest.approx(0.9 * 2**-0.125, rel=1e-14), "the first has none before it"


@pytest.mark.parametrize("most", [1, 2, 8, 16])
def test_a_piece_is_the_largest_power_of_two_that_fits_its_size_and_its_place(most: int) -> None:
    for size in (1.0, 1.99, 2.0, 3.5, 4.0, 7.9, 8.0, 16.0, 40.0):
        for position in range(most):
            fits = [2**k for k in range(5) if 2**k <= min(size, most) and position % 2**k == 0]
            assert _fitting(size, position, most) == max(fits)


ENERGIES = [{"tolerance": 1e-3, "max_pieces": 1}, {"tolerance": 1e-3}, {"tolerance": 1e-5, "max_pieces": 4}]
ENERGIES += [{"tolerance": 3e-7, "max_pieces": 1024}]
ITERATIONS = [{"theta": 0.0, "tolerance": 1e-3}, {"theta": 0.3, "tolerance": 1e-6}, {"theta": 1.0, "tolerance": 1e-14}]


@pytest.mark.parametrize(
    "algorithm",
    [
        *(Energy(kind="energy", bonds=BOND, **options) for options in ENERGIES),
        *(Iterated(kind="iterated", **options) for options in ITERATIONS),
    ],
)
def test_python_and_c_take_the_same_pieces_and_rounds_to_the_same_bits(plain: Tiny, algorithm: Any) -> None:
    """Stiff, soft and at rest until its first row: each way the power on the bond is another."""
    for version, k in ((2, 0.3), (3, 7.0)):
        parameters = {"mass": {"k": k}, "spring": {"k": k}}
        one, other = (
            oscillator(plain[version], algorithm, ticks=40, compiled=compiled, parameters=parameters, decimation=3)
            for compiled in (True, False)
        )
        assert one.statistics["coupling"] == other.statistics["coupling"]
        assert one.statistics["notes"] == [note for note in other.statistics["notes"] if "ran in Python" not in note]
        for name in one.recording:
            np.testing.assert_array_equal(one.recording[name], other.recording[name])


def test_a_coupling_at_rest_takes_the_fewest_pieces_and_rounds(plain: Tiny) -> None:
    """Nothing moves, so nothing is lost: the first tick begins with one piece of 8, then pieces grow by half."""
    algorithm = Energy(kind="energy", bonds=BOND, tolerance=1e-6, max_pieces=8)
    for compiled in (True, False):
        run = oscillator(plain[3], algorithm, ticks=20, compiled=compiled, parameters={"mass": {"k": 0.0}})
        (effort,) = run.statistics["coupling"]
        sizes, size, position = [], 1.0, 0
        while sum(sizes) < 20 * 8:
            sizes.append(_fitting(size, position, 8))
            position, size = (position + sizes[-1]) % 8, min(1.5 * size, 8.0)
        assert effort["rounds"] == len(sizes)
        assert effort["greatest"] == max(np.unique(np.cumsum([0, *sizes[:-1]]) // 8, return_counts=True)[1])
        assert effort["at_limit"] == 0
    iterated = oscillator(plain[3], Iterated(kind="iterated"), ticks=20, parameters={"mass": {"k": 0.0}})
    assert iterated.statistics["coupling"] == [{"rounds": 20, "greatest": 1, "at_limit": 0}]
