"""The kernels in C do what NumPy and SciPy do, on any rows, and without them a diagnosis computes the same."""

from collections.abc import Callable
from dataclasses import replace
from math import ceil
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.interpolate import CubicSpline
from scipy.optimize import lsq_linear
from scipy.signal import butter, sosfiltfilt

from cosim.diagnosis.evidence import marginal as evidence
from cosim.diagnosis.evidence.marginal import Group, marginal
from cosim.estimation import filters, play, rowwise
from cosim.estimation.discrepancy_basis import stop_operators
from cosim.estimation.filters import EDGE, FADED, between, derivative, derivative_at, highpass, lowpass
from cosim.estimation.kernels import library
from cosim.estimation.least_squares import squares_left
from cosim.estimation.play import stepped_torque
from cosim.estimation.rowwise import CHUNK, OPERATIONS, STRIDE, Rowwise, Stepwise, Tape, recurrence
from pyfmi_models.effects.backlash import Backlash

NAMES = {getattr(ca, name): name for name in dir(ca) if name.startswith("OP_")}
SPECIAL = np.array([0.0, 1.0, -1.0, 2.0, -3.0, 0.5, 1e-300, 1e5, np.inf, -np.inf, np.nan])
X = ca.SX.sym("x", 2)


@pytest.fixture
def interpreted(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Do without the library from now on."""

    def without() -> None:
        for module in (filters, rowwise):
            monkeypatch.setattr(module, "library", lambda: None)

    return without


def operated(operation: int, x: ca.SX, y: ca.SX) -> ca.SX:
    if operation in (ca.OP_ASSIGN, ca.OP_CONSTPOW):
        return x + 0 * y
    function = rowwise.ON_ROWS[rowwise.CODES[operation]]
    many = function.nin if isinstance(function, np.ufunc) else function.__code__.co_argcount
    return ca.SX.binary(operation, x, y) if many == 2 else ca.SX.unary(operation, x)


def test_the_library_was_built() -> None:
    assert hasattr(library(), "play_run")


@pytest.mark.parametrize("operation", OPERATIONS, ids=[NAMES[one] for one in OPERATIONS])
def test_an_operation_in_c_is_that_of_numpy(operation: int, interpreted: Callable[[], None]) -> None:
    columns = np.random.default_rng(operation).normal(0, 3, (2, 1000))
    columns[:, :121] = np.array(np.meshgrid(SPECIAL[:11], SPECIAL[:11])).reshape(2, -1)
    if operation == ca.OP_POW:  # 1 to the power of what is no number, and what is infinite and negative: nobody asks
        columns = np.where(np.isfinite(columns), columns, 0.3)
    function = Rowwise(Tape.of(X, ca.SX.sym("p"), operated(operation, X[0], X[1])))
    found = function(columns, np.ones(1))
    interpreted()
    wanted = function(columns, np.ones(1))
    np.testing.assert_allclose(found, wanted, rtol=1e-13, atol=1e-300)


@pytest.mark.parametrize(("exponent", "product"), [(2.0, np.square), (1.0, np.positive), (1.7, lambda x: x**1.7)])
def test_a_power_that_all_rows_share_is_a_product_where_it_is_whole(exponent, product, interpreted):
    p, columns = ca.SX.sym("p"), np.abs(np.random.default_rng(6).normal(0, 3, (2, 400)))
    function = Rowwise(Tape.of(X, p, X[0] ** p))
    found = function(columns, np.array([exponent]))[0]
    np.testing.assert_allclose(found, product(columns[0]), rtol=0 if exponent != 1.7 else 1e-13)
    interpreted()
    np.testing.assert_allclose(function(columns, np.array([exponent]))[0], found, rtol=1e-13)


def test_a_row_has_the_same_bits_wherever_it_stands() -> None:
    curve = Rowwise(Tape.of(X, ca.SX.sym("p"), ca.tanh(X[0]) * ca.exp(-((X[1] / 3) ** 2)) + ca.sin(X[0]) ** 1.3))
    columns = np.random.default_rng(3).normal(0, 2, (2, 777))
    turned = np.roll(columns, 101, axis=1)
    assert np.array_equal(np.roll(curve(columns, np.ones(1)), 101, axis=1), curve(turned, np.ones(1)), equal_nan=True)


@pytest.mark.parametrize("passes", [1, 2])
@pytest.mark.parametrize("shape", [(400,), (400, 1), (60, 11), (9, 8), (2, 3), (400, 0)])
def test_the_filter_has_the_bits_of_scipy(shape: tuple[int, ...], passes: int, interpreted: Callable[[], None]) -> None:
    columns = np.random.default_rng(1).normal(size=shape).cumsum(axis=0)
    kept = columns.copy()
    found = [lowpass(one, 1e-3, 30.0, passes) for one in (columns, np.asfortranarray(columns))]
    assert np.array_equal(columns, kept)
    interpreted()
    wanted = lowpass(columns, 1e-3, 30.0, passes)
    assert all(np.array_equal(one, wanted) for one in found)


@pytest.mark.parametrize(("signals", "rows"), [(1, 50), (5, 50), (9, 1), (3, 0), (0, 4)])
def test_a_recurrence_is_solved_step_by_step(signals: int, rows: int, interpreted: Callable[[], None]) -> None:
    rng = np.random.default_rng(2)
    keeps, adds = rng.uniform(0, 1, rows), rng.normal(size=(signals, rows))
    by_hand = np.zeros((signals, rows + 1))
    for k in range(rows):
        by_hand[:, k + 1] = keeps[k] * by_hand[:, k] + adds[:, k]
    assert np.array_equal(recurrence(keeps, adds), by_hand)
    interpreted()
    np.testing.assert_allclose(recurrence(keeps, adds), by_hand, rtol=1e-13)


@pytest.mark.parametrize("many", [1, 6, 23])
def test_the_marginal_likelihood_in_c_is_that_of_numpy(many: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(many)
    drawn = [rng.normal(size=(60, 1 + many)) @ rng.normal(size=(1 + many, 1 + many)) for _ in range(5)]
    grams, count = np.array([one.T @ one for one in drawn]), np.full(5, 60.0)
    groups = [Group(np.arange(many // 2, many), 0.3), Group(np.arange(many // 4, many // 2), 0.1)][: 1 + many // 4]
    given = grams, np.full(many, 2.0), groups, count, count / 2, np.full(5, 1e-3)
    found = marginal(*given)
    monkeypatch.setattr(evidence, "library", lambda: None)
    for one, other in zip(vars(found).values(), vars(marginal(*given)).values(), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9)


def test_what_is_not_positive_definite_is_refused_as_numpy_refuses_it() -> None:
    grams = np.array([[[1.0, 0.0, 0.0], [0.0, 1.0, 2.0], [0.0, 2.0, 1.0]]])
    ones = np.ones(1)
    with pytest.raises(np.linalg.LinAlgError):
        marginal(1e6 * grams, np.full(2, 1e9), [], ones, ones, ones)


@pytest.mark.parametrize("cutoff", [0.004, 0.03, 0.2, 0.44])
def test_the_filter_is_the_butterworth_of_scipy(cutoff: float) -> None:
    columns = np.random.default_rng(5).normal(size=(2000, 3)).cumsum(axis=0)
    turned = max(EDGE, ceil(FADED / cutoff))
    wanted = sosfiltfilt(butter(4, cutoff, fs=1.0, output="sos"), columns, axis=0, padlen=turned)
    np.testing.assert_allclose(lowpass(columns, 1.0, cutoff), wanted, rtol=1e-9, atol=1e-9)
    wanted = sosfiltfilt(butter(4, cutoff, "highpass", fs=1.0, output="sos"), columns[:, 0])
    np.testing.assert_allclose(highpass(columns[:, 0], 1.0, cutoff), wanted, rtol=1e-9, atol=1e-9)


# Expressions evaluated on whole rows mean what CasADi means by them.

X3, P = ca.SX.sym("x", 3), ca.SX.sym("p", 2)
a, b, c = X3[0], X3[1], X3[2]
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
    found = Rowwise(Tape.of(X3, P, expression))(columns, numbers)
    function = ca.Function("each", [X3, P], [ca.densify(expression)])
    wanted = np.array([np.asarray(function(one, numbers)).ravel() for one in columns.T])
    assert found.shape == (expression.numel(), rows)
    if rows:
        np.testing.assert_allclose(found, wanted.T, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("lengths", [(5,), (5, 5, 5), (5, 4)])
def test_columns_that_a_tape_does_not_have_are_refused(lengths: tuple[int, ...]) -> None:
    """In C what lies behind them would be read."""
    with pytest.raises(ValueError, match="a tape of 2 columns was given columns of 5"):
        Rowwise(Tape.of(X, P, X[0] + X[1]))([np.zeros(length) for length in lengths], np.ones(P.numel()))


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


# Plays in C have the bits of the expressions that they write out.

DT = 1e-3
PLAY = Backlash(gap_rad=1e-3, load_friction=0.3, load_viscous=0.1)
SOFT = Backlash(gap_rad=1.0, load_friction=2.0, contact_hz=20.0, load_deflection=1e-3)
NO_GAP = Backlash(gap_rad=0.0, load_friction=0.0)
SEVERAL = [PLAY, NO_GAP, *(replace(SOFT, gap_rad=gap) for gap in np.geomspace(1e-4, 1, 9))]


def moved() -> tuple[np.ndarray, np.ndarray]:
    """Speed [rad/s] and acceleration at rows DT apart."""
    speed = np.cumsum(np.random.default_rng(7).normal(size=5_000)) * 1e-3
    return speed, np.gradient(speed, DT)


@pytest.mark.parametrize("many", [1, 8, len(SEVERAL)])
def test_plays_in_c_have_the_bits_of_the_expressions(many: int, monkeypatch: pytest.MonkeyPatch) -> None:
    v, a = moved()
    found = stepped_torque(SEVERAL[:many], [5.0] * many, v, a, DT)
    assert found.shape == (many, len(v))
    monkeypatch.setattr(play, "library", lambda: None)
    assert np.array_equal(found, stepped_torque(SEVERAL[:many], [5.0] * many, v, a, DT))
    assert np.abs(found + 5.0 * a).max() > 0


def test_each_of_several_has_the_bits_of_it_alone_and_of_a_speed_that_is_not_in_one_piece_of_memory() -> None:
    v, a = moved()
    found = stepped_torque(SEVERAL, [5.0] * len(SEVERAL), v, a, DT)
    assert np.array_equal(found, [stepped_torque([one], [5.0], v, a, DT)[0] for one in SEVERAL])
    assert not np.array_equal(found[0], found[1])
    assert np.array_equal(found[:1], stepped_torque([PLAY], [5.0], np.column_stack([v, a])[:, 0], a, DT))
    one_row = stepped_torque([PLAY], [5.0], np.ones(1), np.zeros(1), DT)
    assert np.array_equal(one_row, np.zeros((1, 1))), "one row alone passes nothing on"


# Stop operators, row by row and all rows of one way at once.

DISTANCES = np.geomspace(0.3, 30.0, 5)


@given(arrays(float, st.integers(2, 60), elements=st.integers(-9, 9).map(float)), st.sampled_from((-1.0, 0.0, 2.0)))
def test_a_stop_is_elastic_up_to_its_distance_and_then_slides(q: Any, speed: float) -> None:
    """Rests and turns of one row are among the positions."""
    piece: Any = SimpleNamespace(q=q, v=np.full(len(q), speed))
    state = np.sign(speed) * np.ones(len(DISTANCES))
    for row, found in enumerate(stop_operators(piece, DISTANCES)):
        state = np.clip(state + (q[row] - q[max(row - 1, 0)]) / DISTANCES, -1, 1)
        np.testing.assert_allclose(found, state, atol=1e-12)
