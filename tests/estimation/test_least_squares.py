"""The least squares behind every fit: where it ends, how often it looks, bounds."""

import numpy as np
import pytest

from cosim.estimation.least_squares import ENOUGH, least_squares

EVERYWHERE = (np.full(2, -np.inf), np.full(2, np.inf))
T = np.linspace(0, 3, 40)


def decay(x: np.ndarray) -> np.ndarray:
    """Residuals of x0 exp(-x1 t) against 2 exp(-t) with an error that no x removes."""
    return np.asarray(x[0] * np.exp(-x[1] * T) - 2 * np.exp(-T) + 0.1 * np.sin(20 * T))


def slopes(x: np.ndarray) -> np.ndarray:
    return np.column_stack([np.exp(-x[1] * T), -x[0] * T * np.exp(-x[1] * T)])


class Counted:
    """Residuals that are counted."""

    def __init__(self) -> None:
        self.looked: list[np.ndarray] = []

    def __call__(self, x: np.ndarray) -> np.ndarray:
        self.looked.append(x)
        return decay(x)


def test_it_finds_the_minimum() -> None:
    found = least_squares(decay, slopes, np.array([0.5, 0.2]), EVERYWHERE, 50)
    assert found == pytest.approx([2, 1], abs=0.03)
    assert slopes(found).T @ decay(found) == pytest.approx([0, 0], abs=1e-2)


def test_a_start_at_the_minimum_is_looked_at_once() -> None:
    best = least_squares(decay, slopes, np.array([0.5, 0.2]), EVERYWHERE, 50, 1e-12)
    counted = Counted()
    assert np.array_equal(least_squares(counted, slopes, best, EVERYWHERE, 50), best)
    assert len(counted.looked) == 1


def test_a_step_is_done_while_it_promises_enough() -> None:
    best = least_squares(decay, slopes, np.array([0.5, 0.2]), EVERYWHERE, 50, 1e-12)
    lowest, aside = float(decay(best) @ decay(best)), np.array([0.02, 0.0])
    worth = 1 - lowest / float(decay(best + aside) @ decay(best + aside))
    assert worth > ENOUGH
    found = least_squares(decay, slopes, best + aside, EVERYWHERE, 50)
    assert float(decay(found) @ decay(found)) == pytest.approx(lowest, rel=ENOUGH)


def test_a_step_that_a_bound_bends_uphill_is_no_end() -> None:
    bounds = (np.array([-np.inf, 0.0]), np.array([np.inf, 0.5]))
    found = least_squares(decay, slopes, np.array([0.1, 0.4]), bounds, 60)
    assert found[1] == pytest.approx(0.5)
    assert slopes(found)[:, 0] @ decay(found) == pytest.approx(0, abs=2e-2)
