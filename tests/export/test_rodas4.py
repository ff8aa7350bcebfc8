"""The step of the co-simulation solver as expressions: its order, its damping, its answer to too long a step."""

import re
from pathlib import Path

import casadi as ca
import export_models as models
import numpy as np
import pytest

from pyfmi_models.export.rodas4 import ALPHA, GAMMA_TIME, A, C, step_functions


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


def test_divisions_by_parameters_are_done_once_a_step():
    model = models.lugre()
    point = models.symbols(3, 1, 7)
    rates = ca.Function("rates", point, [ca.densify(model.equations(*point)[0])])
    stages = step_functions(rates, [1.0] * 3)[-1]
    divisions = [k for k in range(stages.n_instructions()) if stages.instruction_id(k) in (ca.OP_DIV, ca.OP_INV)]
    assert len(divisions) == 5 + 3  # one by the friction level in each later stage, one for each state's error


def test_the_loop_integrates_foreign_models_with_the_same_numbers():
    text = (Path(__file__).parents[2] / "cosim" / "master" / "loop" / "rodas4.c").read_text("utf-8")
    tables = {name: body for name, body in re.findall(r"double (\w+)(?:\[\w+\])+ = \{(.*?)\};", text, re.S)}
    found = {name: [float(one) for one in re.findall(r"-?\d+\.?\d*", body)] for name, body in tables.items()}
    numbers = {"alpha": ALPHA, "gamma_time": GAMMA_TIME, "a": sum(A, (0,)), "c": sum(C, (0,))}
    assert found == {name: [*row] for name, row in numbers.items()}
