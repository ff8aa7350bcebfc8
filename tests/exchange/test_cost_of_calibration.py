"""A fit simulates no point twice, and few: what is known of a point is taken again."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from cosim_calibration.experiment import Experiment
from cosim_calibration.fit import fit
from cosim_calibration.free import Free
from cosim_calibration.residuals import MOST, Residuals, Rows

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


def residuals_of(model: Model, starts: dict[str, float], high: float = np.inf, noise: float = 0.02) -> Residuals:
    random = np.random.default_rng(3)
    true = {name: TRUE[name] for name in starts}
    outputs = {f"y{k}": y + noise * random.standard_normal(len(y)) for k, y in enumerate(model.model(true))}
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


def test_the_last_derivatives_are_those_of_central_differences() -> None:
    model = Model(decay)
    residuals = residuals_of(model, {"a": 2.4, "b": 0.6, "c": -0.8}, noise=0.2)
    done = fit(residuals, np.array([1.0, 1.0, -1.0]), 1, 0, "linear", lambda text: None)
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
    before, x = residuals.jacobian(np.array([1.0, 1.0, -1.0])), np.array([1.0, 1.0, -1.0])
    count = len(model.points)
    residuals.weights = residuals.weights * [3.0, 0.5]
    after = residuals.jacobian(x, final=True)
    assert len(model.points) == count
    half = len(T)
    assert after[:half] == pytest.approx(3 * before[:half])
    assert after[half:] == pytest.approx(0.5 * before[half:])


def test_a_staircase_is_seen_as_one() -> None:
    def stairs(point: dict[str, float]) -> list[np.ndarray]:
        a, b = round(point["a"] / 0.01) * 0.01, point["b"]
        return [a * np.exp(-b * T), a * np.cos(b * T)]

    residuals = residuals_of(Model(stairs), {"a": 2.0, "b": 0.7})
    residuals.settle(np.array([1.0, 1.0]))
    assert residuals.stairs
    assert 0.01 / 2 < residuals.least[0] <= MOST, "a step of the staircase is 0.005 of the number"
    assert residuals.least[1] < 0.01
