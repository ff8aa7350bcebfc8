"""Derivatives at some rows alone are those of all rows there, to the bit."""

import numpy as np
import pytest

from cosim.estimation.filters import derivative, derivative_at

X = np.cumsum(np.random.default_rng(0).normal(size=300))


@pytest.mark.parametrize("each", [1, 7, 60])
def test_a_derivative_at_some_rows_has_the_bits_of_that_of_all_rows(each: int) -> None:
    rows = np.arange(0, len(X), each)
    assert np.array_equal(derivative_at(X, 0.1, rows), derivative(X, 0.1)[rows])
    assert np.array_equal(derivative_at(X, 0.1, rows, 2), derivative(derivative(X, 0.1), 0.1)[rows])
