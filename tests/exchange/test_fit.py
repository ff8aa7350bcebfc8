"""A fit simulates no point twice, and few: what is known of a point is taken again."""

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim_calibration.experiment import Experiment, _on_ticks
from cosim_calibration.fit import DRAWN, REACH, WIDTHS, Fit, _cost, _searched, fit
from cosim_calibration.free import Free
from cosim_calibration.residuals import MOST, Residuals, Rows
from cosim_calibration.uncertainty import _noise

T = np.linspace(0, 3, 301)
TRUE = {"a": 2.0, "b": 0.7, "c": -1.0}


def decay(point: dict[str, float]) -> list[np.ndarray]:
    """Two outputs that are smooth in all three numbers."""
    a, b, c = (point[name] for name in "abc")
    return [a * np.exp(-b * T) + c, a * np.cos(b * T)]


class Model:
    """Stands for the processes; keeps which points were simulated."""

    def __init__(self, model: Callable[[dict[str, float]], list[np.ndarray]]) -> None:
        self.model = model
        self.points: list[tuple[float, ...]] = []

    def at(self, points: Sequence[dict[str, float]], part: slice) -> list[list[list[np.ndarray]]]:
        self.points += [tuple(one.values()) for one in points]
        return [[self.model(one)] for one in points]


def residuals_of(model: Model, starts: dict[str, float], high: float = np.inf) -> Residuals:
    random = np.random.default_rng(3)
    true = {name: TRUE[name] for name in starts}
    outputs = {f"y{k}": y + 0.02 * random.standard_normal(len(y)) for k, y in enumerate(model.model(true))}
    rows = Rows.of([Experiment("run", 0.01, 300, T, {}, outputs)])
    free = tuple(
        Free(name, "", value, -np.inf, high if name == "a" else np.inf, abs(value)) for name, value in starts.items()
    )
    processes: Any = model
    return Residuals(processes, free, rows, 1 / rows.spread, slice(0, 1))


def test_a_smooth_model_is_simulated_few_times_and_never_twice_at_a_point() -> None:
    model = Model(decay)
    residuals = residuals_of(model, {"a": 2.4, "b": 0.6, "c": -0.8})
    done = fit(residuals, np.array([1.0, 1.0, -1.0]), 1, 0, "linear", lambda text: None)
    assert len(set(model.points)) == len(model.points)
    assert len(model.points) <= 45, "five steps to one side, a look whether it is smooth, one or two central ones"
    errors = np.sqrt(np.diag(np.linalg.inv(done.jacobian.T @ done.jacobian)))  # weights are those of the noise
    assert np.abs(done.x * residuals.scales - list(TRUE.values())).max() < 4 * (errors * residuals.scales).max()
    assert not residuals.stairs
    assert residuals.rough == ()
    # The last derivatives are those of central differences.
    a, b, _ = done.x * residuals.scales
    slope = np.concatenate([-a * T * np.exp(-b * T), -a * T * np.sin(b * T)])
    exact = residuals.weights[residuals.rows.output] * slope * residuals.scales[1]
    assert np.linalg.norm(done.jacobian[:, 1] - exact) < 1e-3 * np.linalg.norm(exact)


def test_a_difference_to_one_side_goes_away_from_a_bound() -> None:
    residuals = residuals_of(Model(decay), dict(TRUE), high=2.0)
    residuals.quick = True
    found = residuals.jacobian(np.array([1.0, 1.0, -1.0]))[:, 0]
    exact = residuals.weights[residuals.rows.output] * np.concatenate([np.exp(-0.7 * T), np.cos(0.7 * T)]) * 2.0
    assert found == pytest.approx(exact, rel=1e-3, abs=1e-6)


def test_other_weights_take_the_same_simulations() -> None:
    model = Model(decay)
    residuals = residuals_of(model, dict(TRUE))
    x = np.array([1.0, 1.0, -1.0])
    before = residuals.jacobian(x)
    count = len(model.points)
    residuals.weights = residuals.weights * [3.0, 0.5]
    after = residuals.jacobian(x, final=True)
    assert len(model.points) == count
    assert after == pytest.approx(before * np.repeat([3.0, 0.5], len(T))[:, np.newaxis])


def test_a_staircase_is_seen_as_one() -> None:
    def stairs(point: dict[str, float]) -> list[np.ndarray]:
        a, b = round(point["a"] / 0.01) * 0.01, point["b"]
        return [a * np.exp(-b * T), a * np.cos(b * T)]

    residuals = residuals_of(Model(stairs), {"a": 2.0, "b": 0.7})
    residuals.settle(np.array([1.0, 1.0]))
    assert residuals.stairs
    assert 0.01 / 2 < residuals.least[0] <= MOST, "a step of the staircase is 0.005 of the number"
    assert residuals.least[1] < 0.01


# Around a minimum of a staircase the search draws points as far away as errors of the fit are, and no farther.

SLOPES = np.array([[4.0, 0.0], [0.0, 0.5], [0.0, 0.0], [0.0, 0.0]])
START, LEFT = np.array([0.3, -0.2]), np.array([0.0, 0.0, 0.02, 0.0])
"""Two numbers of which one is known eight times as well as the other, and what is left at their minimum."""


def drawn(slopes: np.ndarray, better: bool = False) -> tuple[np.ndarray, list[np.ndarray]]:
    """What the search ends at and its points by round, around a minimum that no other point is below."""
    rounds: list[np.ndarray] = []

    def many(points: list[np.ndarray]) -> list[np.ndarray]:
        rounds.append(np.array(points))
        return [LEFT * (0.5 if better else 2.0) for _ in points]

    residuals: Any = SimpleNamespace(groups=range(200), at=lambda x: LEFT, jacobian=lambda x: slopes)
    residuals.many, residuals.inside = many, lambda one: one
    return _searched(residuals, START, "linear", 1.0, 5), rounds


@pytest.mark.parametrize(
    ("seen", "spread"),
    [pytest.param(1.0, 0.02 / np.sqrt(2) / 0.5, id="errors of the fit"), pytest.param(1e-9, REACH, id="the reach")],
)
def test_points_are_drawn_from_the_errors_of_the_fit_within_the_reach_narrower_each_round(seen, spread) -> None:
    best, rounds = drawn(SLOPES * [1.0, seen])
    assert np.array_equal(best, START), "no point was better"
    assert len(rounds) == len(WIDTHS)
    for width, points in zip(WIDTHS, rounds, strict=True):
        assert len(points) == 200 * DRAWN
        # What is left is 0.02, over four rows less two numbers.
        expected = width * np.array([0.02 / np.sqrt(2) / 4.0, spread])
        assert (points - START).std(0) == pytest.approx(expected, rel=0.05)  # of 5000: 1 %
        assert np.abs((points - START) / expected).max() < 6, "they are normal"


def test_each_round_begins_at_the_best_point_so_far() -> None:
    best, rounds = drawn(SLOPES, better=True)
    assert not np.array_equal(best, START)
    assert best.tolist() in rounds[0].tolist()


def test_the_cost_is_half_the_sum_of_squares_or_soft_beyond_the_outlier() -> None:
    z = np.array([0.01, 3.0])
    assert _cost(z, "linear", 1.0) == pytest.approx(0.5 * float(z @ z))
    soft = sum(2 * (np.sqrt(1 + one**2) - 1) for one in z / 0.5)
    assert _cost(z, "soft_l1", 0.5) == pytest.approx(0.5 * 0.25 * soft)


# What a robust loss makes of noise, and what an input between rows is, against their formulas.


@pytest.mark.parametrize("outlier", [0.5, 1.0, 3.0])
def test_the_noise_of_a_robust_fit_is_that_of_huber(outlier: float) -> None:
    """rms(psi) / mean(psi') of normal noise, by integration; psi = z / sqrt(1 + (z / c)^2)."""
    x = np.linspace(-9, 9, 20001)
    density = np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi) * (x[1] - x[0])
    bent = 1 + (x / outlier) ** 2
    expected = np.sqrt(np.sum(density * x**2 / bent)) / np.sum(density * bent**-1.5)
    z = np.random.default_rng(1).standard_normal(200_000)
    for loss, known in (("soft_l1", expected), ("linear", 1.0)):
        done = Fit(np.ones(2), z, np.ones((len(z), 2)), loss, outlier, (1.0,), 1)
        assert _noise(done, 2) == pytest.approx(known, rel=0.01)
    assert 1 < expected < 1.5, "a robust fit knows somewhat less of normal noise"


@pytest.mark.parametrize(
    ("between", "expected"),
    [
        pytest.param("linear", [0.5, 1.5, 1.5, 0.5, -0.5, -1.5, -2.0], id="its mean over each step"),
        pytest.param("hold", [0, 0, 2, 2, 2, 2, -2], id="the sample before"),
    ],
)
def test_an_input_between_rows_is(between: str, expected: list[float]) -> None:
    times, values = np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0, -2.0])
    assert _on_ticks(times, values, 0.5, 6, between) == pytest.approx(expected)
