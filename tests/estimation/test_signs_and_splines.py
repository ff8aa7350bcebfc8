"""Two small things that a library does too, and that cost a diagnosis more to load there than to do here."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from scipy.optimize import lsq_linear

from cosim.estimation.filters import between
from cosim.estimation.least_squares import squares_left


@given(st.integers(0, 2**32 - 1), st.integers(4, 40))
def test_a_signal_is_read_between_its_rows_as_by_the_library(seed: int, rows: int) -> None:
    draw = np.random.default_rng(seed)
    t = np.cumsum(draw.uniform(0.5, 1.5, rows))
    values, at = draw.normal(size=rows), draw.uniform(t[0] - 0.5, t[-1] + 0.5, (7, 3))
    expected = CubicSpline(t, values, extrapolate=False)(at)
    np.testing.assert_allclose(between(t, values, at), expected, atol=1e-9 * np.abs(values).max())


@given(st.integers(0, 2**32 - 1), st.integers(3, 6))
def test_what_least_squares_leaves_with_signs_is_the_librarys(seed: int, count: int) -> None:
    draw = np.random.default_rng(seed)
    columns, targets = draw.normal(size=(9, count)), draw.normal(size=(9, 4))
    least = np.where(np.arange(count) < 3, 0.0, -np.inf)
    left = [2 * lsq_linear(columns, one, (least, np.inf), "bvls").cost for one in targets.T]
    np.testing.assert_allclose(squares_left(columns, targets, (0, 1, 2)), left, rtol=1e-9)


def test_a_column_that_is_twice_another_does_not_hide_the_best_signs() -> None:
    columns = np.array([[1.0, 2.0], [0.0, 0.0], [1.0, 2.0]])
    assert np.isclose(squares_left(columns, np.array([[1.0], [2.0], [1.0]]), (0, 1))[0], 4.0)
    assert np.isclose(squares_left(columns, np.array([[-1.0], [2.0], [-1.0]]), (0, 1))[0], 6.0)
