"""Expressions evaluated on whole rows mean what CasADi means by them."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from scipy.optimize import lsq_linear

from cosim.estimation.filters import between, derivative, derivative_at
from cosim.estimation.least_squares import squares_left
from cosim.estimation.rowwise import CHUNK, STRIDE, Rowwise, Stepwise, Tape

X, P = ca.SX.sym("x", 3), ca.SX.sym("p", 2)
a, b, c = X[0], X[1], X[2]
EXPRESSIONS = {
    "arithmetic": a * b / (c + 3) - 2 * a + P[0] ** 2 - 1 / b,
    "powers": ca.sqrt(ca.fabs(a)) + ca.fabs(b) ** P[1] + a**3,
    "waves": ca.sin(a) * ca.cos(b) + ca.tan(c / 4) + ca.atan2(a, b) + ca.atan(c),
    "curves": ca.exp(-(a**2)) + ca.log(1 + b**2) + ca.tanh(c) + ca.log1p(a**2) + ca.expm1(b / 9) + ca.sinh(c / 9),
    "choices": ca.if_else(a > 0, b, ca.if_else(b <= 0, c, -a)) + ca.fmin(a, b) + ca.fmax(b, c) + ca.sign(a),
    "logic": ca.if_else(ca.logic_and(a > 0, b > 0), 1.0, 0.0) + ca.if_else(ca.logic_or(a < 0, c == b), 3.0, 0.0),
    "a choice of what is undefined": ca.if_else(a > 0, ca.log(a), ca.sqrt(-a)),
    "rounding": ca.floor(a) + ca.ceil(b) + ca.fmod(c, 2) + ca.copysign(a, b),
    "parameters only": P[0] * P[1] + 0 * a,
    "slopes": ca.jacobian(ca.tanh(a / 1e-3) * ca.exp(-((b / P[0]) ** 2)) + ca.fabs(c), ca.vertcat(a, b, c, P)).T,
}


@pytest.mark.parametrize("name", EXPRESSIONS)
@pytest.mark.parametrize("rows", [0, 1, CHUNK, CHUNK + 7])
def test_rows_are_what_casadi_says(name: str, rows: int) -> None:
    expression = EXPRESSIONS[name]
    columns = np.random.default_rng(rows).normal(0, 2, (3, rows))
    columns[:, : rows // 3] = np.round(columns[:, : rows // 3])
    numbers = np.array([1.7, 0.6])
    found = Rowwise(Tape.of(X, P, expression))(columns, numbers)
    function = ca.Function("each", [X, P], [ca.densify(expression)])
    wanted = np.array([np.asarray(function(one, numbers)).ravel() for one in columns.T])
    assert found.shape == (expression.numel(), rows)
    if rows:
        np.testing.assert_allclose(found, wanted.T, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("lengths", [(5,), (5, 5, 5), (5, 4)])
def test_columns_that_a_tape_does_not_have_are_refused(lengths: tuple[int, ...]) -> None:
    """In C what lies behind them would be read."""
    x = ca.SX.sym("x", 2)
    with pytest.raises(ValueError, match="a tape of 2 columns was given columns of 5"):
        Rowwise(Tape.of(x, P, x[0] + x[1]))([np.zeros(length) for length in lengths], np.ones(P.numel()))


@pytest.mark.parametrize("rows", [0, 1, STRIDE - 1, STRIDE, STRIDE + 1, 3 * STRIDE + 5])
def test_a_state_is_carried_step_by_step(rows: int) -> None:
    state, column, factor = ca.SX.sym("state", 2), ca.SX.sym("column", 2), ca.SX.sym("factor")
    following = ca.vertcat(factor * state[0] + column[0], state[0] - state[1] / 2 + column[1])
    columns = np.random.default_rng(rows).normal(size=(2, rows))
    by_hand = np.zeros((2, rows + 1))
    for k, (x, y) in enumerate(columns.T):
        by_hand[:, k + 1] = 0.5 * by_hand[0, k] + x, by_hand[0, k] - by_hand[1, k] / 2 + y
    walk = Stepwise(state, column, factor, following)
    for _ in range(2):  # each walk starts from zero
        np.testing.assert_allclose(walk(columns, np.array([0.5])), by_hand, rtol=1e-14, atol=1e-14)


# Derivatives at some rows alone are those of all rows there, to the bit.

WALK = np.cumsum(np.random.default_rng(0).normal(size=300))


@pytest.mark.parametrize("each", [1, 7, 60])
def test_a_derivative_at_some_rows_has_the_bits_of_that_of_all_rows(each: int) -> None:
    rows = np.arange(0, len(WALK), each)
    assert np.array_equal(derivative_at(WALK, 0.1, rows), derivative(WALK, 0.1)[rows])
    assert np.array_equal(derivative_at(WALK, 0.1, rows, 2), derivative(derivative(WALK, 0.1), 0.1)[rows])


# Two small things that a library does too, and that cost a diagnosis more to load there than to do here.


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
