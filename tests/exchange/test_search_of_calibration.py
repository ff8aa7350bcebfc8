"""Around a minimum of a staircase the search draws points as far away as errors of the fit are, and no farther."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim_calibration import fit
from cosim_calibration.experiment import _on_ticks
from cosim_calibration.fit import DRAWN, REACH, WIDTHS, Fit, _searched
from cosim_calibration.uncertainty import _noise

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


def test_points_are_drawn_from_the_errors_of_the_fit_narrower_each_round() -> None:
    best, rounds = drawn(SLOPES)
    assert np.array_equal(best, START), "no point was better"
    noise = 0.02 / np.sqrt(2)  # what is left, over four rows less two numbers
    assert len(rounds) == len(WIDTHS)
    for width, points in zip(WIDTHS, rounds, strict=True):
        assert len(points) == 200 * DRAWN
        spread = (points - START).std(0)
        assert spread == pytest.approx(width * noise / np.array([4.0, 0.5]), rel=0.05)  # of 5000: 1 %
        assert np.abs((points - START) / spread).max() < 6, "they are normal"


def test_what_is_not_seen_is_searched_no_farther_than_the_reach() -> None:
    _, rounds = drawn(SLOPES * [1.0, 1e-9])
    for width, points in zip(WIDTHS, rounds, strict=True):
        assert (points - START)[:, 1].std() == pytest.approx(width * REACH, rel=0.05)


def test_each_round_begins_at_the_best_point_so_far() -> None:
    best, rounds = drawn(SLOPES, better=True)
    assert not np.array_equal(best, START)
    assert best.tolist() in rounds[0].tolist()


def test_the_cost_is_half_the_sum_of_squares_or_soft_beyond_the_outlier() -> None:
    z = np.array([0.01, 3.0])
    assert fit._cost(z, "linear", 1.0) == pytest.approx(0.5 * float(z @ z))
    soft = sum(2 * (np.sqrt(1 + one**2) - 1) for one in z / 0.5)
    assert fit._cost(z, "soft_l1", 0.5) == pytest.approx(0.5 * 0.25 * soft)


# What a robust loss makes of noise, and what an input between rows is, against their formulas.


def noise_of(z: np.ndarray, loss: str, outlier: float) -> float:
    return _noise(Fit(np.ones(2), z, np.ones((len(z), 2)), loss, outlier, (1.0,), 1), 2)


@pytest.mark.parametrize("outlier", [0.5, 1.0, 3.0])
def test_the_noise_of_a_robust_fit_is_that_of_huber(outlier: float) -> None:
    """rms(psi) / mean(psi') of normal noise, by integration; psi = z / sqrt(1 + (z / c)^2)."""
    x = np.linspace(-9, 9, 20001)
    density = np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi) * (x[1] - x[0])
    bent = 1 + (x / outlier) ** 2
    expected = np.sqrt(np.sum(density * x**2 / bent)) / np.sum(density * bent**-1.5)
    z = np.random.default_rng(1).standard_normal(200_000)
    assert noise_of(z, "soft_l1", outlier) == pytest.approx(expected, rel=0.01)
    assert 1 < expected < 1.5, "a robust fit knows somewhat less of normal noise"
    assert noise_of(z, "linear", outlier) == pytest.approx(1.0, rel=0.01)


def test_an_input_that_runs_linearly_is_its_mean_over_each_step() -> None:
    times, values = np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0, -2.0])
    found = _on_ticks(times, values, 0.5, 6, "linear")
    assert found[:6] == pytest.approx([0.5, 1.5, 1.5, 0.5, -0.5, -1.5])
    assert len(found) == 7


def test_an_input_that_is_held_keeps_the_sample_before() -> None:
    times, values = np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0, -2.0])
    assert _on_ticks(times, values, 0.5, 6, "hold").tolist() == [0, 0, 2, 2, 2, 2, -2]
