"""The step of the co-simulation solver as expressions: its order, its damping, its answer to too long a step."""

from ctypes import CDLL, CFUNCTYPE, POINTER, Structure, byref, c_double, c_int, c_void_p
from pathlib import Path

import casadi as ca
import fmpy
import numpy as np
import pytest

from cosim.master import loop as own
from pyfmi_models import export
from pyfmi_models.export.build import compile_shared
from pyfmi_models.export.platforms import PLATFORMS, host
from pyfmi_models.export.rodas4 import step_functions

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
    headers = (LOOP / "rodas4.h", Path(export.__file__).parent / "c" / "detmath.h")
    sources = {one.name: one.read_bytes() for one in (LOOP / "rodas4.c", *headers)}
    flags, name = ("-shared", "-fPIC", "-O1", "-w"), f"rodas4{fmpy.sharedLibraryExtension}"
    return CDLL(str(compile_shared(sources, name, PLATFORMS[host()].target, flags)))


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
