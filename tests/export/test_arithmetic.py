"""Arithmetic compiled into every FMU: elementary functions to the last bit, and the step of the solver."""

import ctypes
import math
import re
from ctypes import CFUNCTYPE, POINTER, Structure, byref, c_double, c_int, c_void_p
from itertools import product
from pathlib import Path

import casadi as ca
import fmpy
import mpmath
import numpy as np
import pytest

from cosim.master import loop as own
from pyfmi_models.export.build import compile_shared
from pyfmi_models.export.codegen import SHIM
from pyfmi_models.export.platforms import PLATFORMS, host
from pyfmi_models.export.rodas4 import step_functions

COUNT = 1500
# What the header keeps inline has no address: here it gets one.
INLINE = b"""#define DETMATH_KEEP_NAMES
#include "detmath.h"
double inline_fmin(double x, double y) { return det_fmin(x, y); }
double inline_fmax(double x, double y) { return det_fmax(x, y); }
double inline_sign(double x) { return det_sign(x); }
"""


@pytest.fixture(scope="module")
def library():
    sources = {path.name: path.read_bytes() for path in SHIM.glob("detmath*")} | {"inline.c": INLINE}
    flags = ("-std=c11", "-O2", "-ffp-contract=off", "-fno-math-errno", "-shared", "-fPIC")
    return ctypes.CDLL(str(compile_shared(sources, "detmath.so", PLATFORMS[host()].target, flags)))


def function(library, name, arguments=1, prefix="det"):
    found = getattr(library, f"{prefix}_{name}")
    found.restype, found.argtypes = ctypes.c_double, [ctypes.c_double] * arguments
    return found


def error_in_ulp(value, exact):
    exponent = max(mpmath.frexp(exact)[1] - 1, -1022) if exact else -1022
    return float(abs(mpmath.mpf(value) - exact) / mpmath.mpf(2) ** (exponent - 52))


def decades(low, high, seed=0, signed=True):
    random = np.random.default_rng(seed)
    values = 10 ** random.uniform(low, high, COUNT)
    return values * random.choice([-1, 1], COUNT) if signed else values


def between(low, high):
    return np.random.default_rng(7).uniform(low, high, COUNT)


NEAR_ROOTS = np.concatenate([np.arange(1, 1000) * np.pi / 2, np.arange(62000, 63000) * np.pi / 2])
NEAR_ONE = 1 + decades(-15, -0.5)

# name: arguments, largest error in units in the last place
UNARY = {
    "exp": ((between(-745.1, 709.7), decades(-20, 0)), 1),
    "expm1": ((between(-60, 709), decades(-20, 0)), 1),
    "exp2": ((between(-1074, 1023), decades(-20, 0)), 1),
    "log": ((decades(-323, 308, signed=False), NEAR_ONE, between(0.5, 2)), 1),
    "log1p": ((decades(-20, -0.01), decades(-5, 300, signed=False)), 1),
    "log2": ((decades(-300, 300, signed=False), NEAR_ONE), 1),
    "log10": ((decades(-300, 300, signed=False), NEAR_ONE), 1),
    "sin": ((decades(-9, 5), between(-10, 10), NEAR_ROOTS), 1),
    "cos": ((decades(-9, 5), between(-10, 10), NEAR_ROOTS), 1),
    "tan": ((decades(-9, 5), between(-10, 10), NEAR_ROOTS), 2),
    "atan": ((decades(-9, 9), between(-3, 3)), 2),
    "asin": ((between(-1, 1), decades(-9, 0)), 2),
    "acos": ((between(-1, 1), decades(-9, 0)), 2),
    "sinh": ((between(-700, 700), between(700, 710.4), decades(-9, 2)), 2),
    "cosh": ((between(-700, 700), between(700, 710.4), decades(-9, 2)), 2),
    "tanh": ((between(-30, 30), decades(-9, 1)), 2),
    "asinh": ((decades(-9, 20),), 2),
    "acosh": ((1 + decades(-9, 20, signed=False),), 2),
    "atanh": ((between(-1, 1), decades(-9, -0.001)), 2),
}
EXACT = {"exp2": lambda x: mpmath.mpf(2) ** x, "log2": lambda x: mpmath.log(x, 2)}


@pytest.mark.parametrize("name", UNARY)
def test_the_last_place_agrees_with_mpmath(library, name):
    arguments, limit = UNARY[name]
    tested, exact = function(library, name), EXACT.get(name, getattr(mpmath, name, None))
    with mpmath.workprec(180):
        worst = max(error_in_ulp(tested(x), exact(mpmath.mpf(x))) for x in np.concatenate(arguments).tolist())
    assert worst <= limit


def test_a_power_is_within_one_unit_in_the_last_place(library):
    power, worst = function(library, "pow", 2), 0.0
    bases = np.concatenate([decades(-300, 300, 1, False), decades(-3, 3, 2, False), 1 + decades(-12, -1, 3)])
    exponents = np.concatenate([between(-1, 1), between(-100, 100), decades(0, 12, 4)])
    with mpmath.workprec(220):
        for x, y in zip(bases.tolist(), exponents.tolist(), strict=True):
            exact = mpmath.mpf(x) ** mpmath.mpf(y)
            if mpmath.mpf(2) ** -1074 < exact < mpmath.mpf(2) ** 1023:
                worst = max(worst, error_in_ulp(power(x, y), exact))
    assert worst <= 1


def same(a, b):
    return (math.isnan(a) and math.isnan(b)) or (a == b and math.copysign(1, a) == math.copysign(1, b))


INF, NAN = math.inf, math.nan
SPECIAL = {
    "exp": {INF: INF, -INF: 0.0, NAN: NAN, 0.0: 1.0, 710.0: INF, -746.0: 0.0, -745.1: 5e-324},
    "expm1": {INF: INF, -INF: -1.0, NAN: NAN, -0.0: -0.0},
    "log": {INF: INF, -0.0: -INF, -1.0: NAN, -INF: NAN, NAN: NAN, 1.0: 0.0},
    "log1p": {INF: INF, -1.0: -INF, -2.0: NAN, NAN: NAN, -0.0: -0.0},
    "sin": {INF: NAN, -INF: NAN, NAN: NAN, -0.0: -0.0},
    "cos": {INF: NAN, NAN: NAN, 0.0: 1.0},
    "tanh": {INF: 1.0, -INF: -1.0, NAN: NAN, -0.0: -0.0},
    "sinh": {INF: INF, -INF: -INF, NAN: NAN, -0.0: -0.0, 711.0: INF},
    "cosh": {INF: INF, -INF: INF, NAN: NAN, 711.0: INF},
    "atan": {INF: math.pi / 2, -INF: -math.pi / 2, NAN: NAN, -0.0: -0.0},
    "asin": {2.0: NAN, 1.0: math.pi / 2, NAN: NAN, -0.0: -0.0},
    "acos": {2.0: NAN, 1.0: 0.0, -1.0: math.pi, NAN: NAN},
    "acosh": {0.5: NAN, 1.0: 0.0, INF: INF, NAN: NAN},
    "asinh": {INF: INF, -INF: -INF, NAN: NAN, -0.0: -0.0},
    "atanh": {1.0: INF, -1.0: -INF, 2.0: NAN, -0.0: -0.0},
    "floor": {-0.0: -0.0, -0.5: -1.0, 2.5: 2.0, INF: INF, NAN: NAN, 1e300: 1e300},
    "ceil": {-0.5: -0.0, 2.5: 3.0, -INF: -INF, NAN: NAN},
}


@pytest.mark.parametrize("name", SPECIAL)
def test_special_values_follow_annex_f_of_c99(library, name):
    tested = function(library, name)
    assert {x: tested(x) for x, y in SPECIAL[name].items() if not same(tested(x), y)} == {}


def reference_power(x, y):
    try:
        return math.pow(x, y)
    except OverflowError:
        return -INF if x < 0 and y % 2 else INF
    except ValueError:
        if x == 0:
            return math.copysign(INF, x) if y % 2 == 1 else INF
        return NAN


ZEROS, UNITS = (0.0, -0.0), (1.0, -1.0, INF, -INF, NAN)
BASES = (*ZEROS, *UNITS, 0.5, -0.5, 2.0, -2.0, 3.0, -3.0, 1e300, -1e300)
FAR_APART = list(zip(decades(-20, 20, 1).tolist(), decades(-20, 20, 2).tolist(), strict=True))
TINY, HUGE, HALVES = 5e-324, 1.7e308, [n / 2 for n in range(-9, 10)]
PAIRS = {
    "pow": (reference_power, [*product(BASES, BASES), *product(range(-9, 10), range(16))]),
    "atan2": (math.atan2, product((*ZEROS, *UNITS), (*ZEROS, *UNITS))),
    "fmod": (math.fmod, [*FAR_APART, *product((n * TINY for n in range(-12, 13)), (m * TINY for m in range(1, 8)))]),
    "remainder": (
        math.remainder,
        [
            *FAR_APART,
            *((x, y) for x, y in product(HALVES, HALVES) if y),
            *product((TINY, 3 * TINY, -7 * TINY, HUGE, -0.7 * HUGE, *ZEROS), (TINY, 2 * TINY, HUGE, INF)),
        ],
    ),
}


@pytest.mark.parametrize("name", PAIRS)
def test_functions_of_two_numbers_are_those_of_python(library, name):
    """Powers and angles of special values, small whole powers exactly, remainders of any two."""
    (reference, pairs), tested = PAIRS[name], function(library, name, 2)
    assert [pair for pair in pairs if not same(tested(*pair), reference(*pair))] == []


def test_hypotenuse_extremes_signs_and_remainders_of_nothing(library):
    hypot, remainder = function(library, "hypot", 2), function(library, "remainder", 2)
    assert all(hypot(x, y) == pytest.approx(math.hypot(x, y), rel=4e-16, abs=0) for x, y in FAR_APART)
    assert hypot(3e300, 4e300) == pytest.approx(5e300, rel=4e-16)
    assert all(math.isnan(remainder(x, y)) for x, y in ((1.0, 0.0), (INF, 1.0), (NAN, 1.0), (1.0, NAN)))
    assert function(library, "fmin", 2, "inline")(NAN, 1.0) == 1.0
    assert function(library, "fmax", 2, "inline")(-1.0, NAN) == -1.0
    sign = function(library, "sign", 1, "inline")
    assert [sign(x) for x in (-3.0, 1e-300, 0.0, INF)] == [-1.0, 1.0, 0.0, 1.0]
    assert math.isnan(sign(NAN))


def test_tables_are_their_definitions_rounded_to_nearest():
    text = (SHIM / "detmath_tables.h").read_text()
    with mpmath.workprec(300):
        for j, (head, tail) in enumerate(table(text, "exp_table")):
            exact = mpmath.mpf(2) ** (mpmath.mpf(j) / 128)
            assert (head, tail) == (float(exact), float(exact - mpmath.mpf(float(exact))))
        for inverse, head, tail in table(text, "log_table"):
            exact = -mpmath.log(inverse)
            assert head * 2**42 == int(head * 2**42)
            assert tail == float(exact - mpmath.mpf(head))
        for i, (head, tail) in enumerate(table(text, "atan_table")):
            exact = mpmath.atan(mpmath.mpf(i) / 32)
            assert (head, tail) == (float(exact), float(exact - mpmath.mpf(float(exact))))


def table(text, name):
    body = re.search(rf"{name}\[\d+\]\[\d+\] = {{(.*?)}};", text, re.S)[1]
    return [tuple(float.fromhex(n) for n in row.split(",")) for row in re.findall(r"{(.*?)}", body)]


# The step of the co-simulation solver as expressions: its order, its damping, its answer to too long a step.

LOOP = Path(own.__file__).parent


def solver(sizes, formula):
    """One step of x' = formula(t, x, u, p) as a function of t, x, u, p, h: x at the end, its error, pivots."""
    point = [ca.SX.sym(name, size) for name, size in zip("txup", (1, *sizes), strict=True)]
    rates = ca.Function("rates", point, [ca.densify(ca.vertcat(*formula(*point)))])
    parts = step_functions(rates, [1.0] * sizes[0])

    def step(t, x, u=(), p=(), h=1.0):
        columns = {"t": t, "x": x, "u": u, "p": p, "h": h}
        for part in parts:
            columns |= part.call({name: columns[name] for name in part.name_in()})
        return [np.array(columns[name]).ravel() for name in ("end", "error", "pivots")]

    return step


NONLINEAR = solver((2, 0, 0), lambda t, x, u, p: [x[1] * ca.cos(t), -x[0] * x[1] + ca.sin(2 * t)])


def end(count):
    """The state at t = 2 by equal steps of a problem that is nonlinear and explicit in time."""
    x = [1.0, 0.5]
    for k in range(count):
        x = NONLINEAR(2 * k / count, x, h=2 / count)[0]
    return x


def test_the_method_is_of_fourth_order():
    exact = end(640)
    errors = [np.abs(end(count) - exact).max() for count in (20, 40, 80)]
    assert np.log2(np.array(errors[:-1]) / errors[1:]).min() >= 3.7


def test_the_error_estimate_is_of_the_embedded_third_order():
    x = [1.0, 0.5]
    errors = [np.abs(NONLINEAR(0.3, x, h=h)[1]).max() for h in (0.04, 0.02, 0.01)]
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(4, abs=0.3)


def test_a_stiff_decay_is_damped_at_once_and_followed_exactly():
    """L-stable and stiffly accurate: x' = -k (x - sin t) + cos t is at sin t after one step, however long."""
    step = solver((1, 0, 1), lambda t, x, u, p: [-p * (x - ca.sin(t)) + ca.cos(t)])
    assert step(0.0, 1.0, p=1e12, h=0.01)[0] == pytest.approx(np.sin(0.01), abs=1e-8)


@pytest.mark.parametrize("seed", range(5))
def test_elimination_solves_any_sparse_linear_system(seed):
    """For x' = A x one step is the stability function R(hA) x, whatever the zeros of A: the same as from a dense A."""
    random = np.random.default_rng(seed)
    A = random.normal(size=(7, 7)) * (random.random((7, 7)) < 0.35) - 2 * np.eye(7)
    x = random.normal(size=7)
    sparse = solver((7, 0, 0), lambda t, x, u, p: ca.vertsplit(ca.sparsify(ca.SX(ca.DM(A))) @ x))
    T = np.linalg.qr(random.normal(size=(7, 7)))[0]
    dense = solver((7, 0, 0), lambda t, x, u, p: ca.vertsplit(ca.SX(T @ A @ T.T) @ x))
    assert sparse(0.0, x, h=0.3)[0] == pytest.approx(T.T @ dense(0.0, T @ x, h=0.3)[0], rel=1e-11, abs=1e-12)


def test_a_step_that_meets_a_growing_mode_shows_a_small_pivot():
    """Where x' = x grows: at h gamma = 1 the matrix 1/(h gamma) - 1 is singular, and its reciprocal says so."""
    step = solver((1, 0, 0), lambda t, x, u, p: [x])
    assert abs(step(0.0, 1.0, h=4.0 * (1 + 1e-12))[2][0]) > 1e9
    assert step(0.0, 1.0, h=0.04)[2][0] == pytest.approx(0.01 / 0.99)


RATES, JACOBIAN = (CFUNCTYPE(c_int, c_void_p, c_double, *count * [POINTER(c_double)]) for count in (2, 3))


class Solver(Structure):
    """That of cosim/master/loop/rodas4.h."""

    _fields_ = (
        *(("size", c_int), ("context", c_void_p), ("rates", RATES), ("jacobian", JACOBIAN)),
        *(("nominals", c_void_p), ("tolerance", c_double), ("work", c_void_p), ("pivots", c_void_p)),
    )


@pytest.fixture(scope="module")
def loop():
    """What integrates foreign models, of which only rates and a Jacobian are known."""
    headers = (LOOP / "rodas4.h", SHIM / "detmath.h")
    sources = {one.name: one.read_bytes() for one in (LOOP / "rodas4.c", *headers)}
    flags, name = ("-shared", "-fPIC", "-O1", "-w"), f"rodas4{fmpy.sharedLibraryExtension}"
    return ctypes.CDLL(str(compile_shared(sources, name, PLATFORMS[host()].target, flags)))


@pytest.mark.parametrize("seed", range(6))
def test_the_loop_steps_a_foreign_model_as_expressions_do(loop, seed):
    """Rates A x + b sin t; in every second case 1 / (h gamma) - A has a zero in front, and rows are exchanged.

    Expressions have them in other coordinates, where none is.
    """
    random, size, h = np.random.default_rng(seed), 5, 0.3
    A, b, x = (random.normal(size=shape) for shape in ((size, size), size, size))
    A[0, 0] = 1 / (0.25 * h) if seed % 2 else A[0, 0]
    T = np.linalg.qr(random.normal(size=(size, size)))[0]

    def rates(_, t, x, out):
        np.ctypeslib.as_array(out, (size,))[:] = A @ np.ctypeslib.as_array(x, (size,)) + b * np.sin(t)
        return 0

    def jacobian(_, t, x, by_state, by_time):
        np.ctypeslib.as_array(by_state, (size * size,))[:] = A.T.ravel()
        np.ctypeslib.as_array(by_time, (size,))[:] = b * np.cos(t)
        return 0

    nominals, work, pivots = np.ones(size), np.zeros(size * size + 12 * size), np.zeros(size, np.intc)
    numbers = (nominals.ctypes.data, 1e-6, work.ctypes.data, pivots.ctypes.data)
    this, end, error = Solver(size, None, RATES(rates), JACOBIAN(jacobian), *numbers), np.zeros(size), np.zeros(size)
    places = [c_void_p(one.ctypes.data) for one in (x, end, error)]
    assert loop.rodas4_step(byref(this), c_double(0.4), c_double(h), *places) == 0
    expressions = solver(
        (size, 0, 0), lambda t, x, u, p: ca.vertsplit(ca.DM(T @ A @ T.T) @ x + ca.DM(T @ b) * ca.sin(t))
    )
    np.testing.assert_allclose(end, T.T @ expressions(0.4, T @ x, h=h)[0], rtol=1e-9)
