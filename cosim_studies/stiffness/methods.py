"""Ways to step the bristle equation: the paper's analytic update, textbook methods, and the truth for both.

    d(sigma0 z)/dt = sigma0 (v(t) - |v| sigma0 z / g(v)),

with v prescribed it is linear in the bristle torque sigma0 z, so the truth comes from 5-stage Radau collocation.
"""

from collections.abc import Callable, Sequence
from math import ceil
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from cosim_studies.stiffness.motion import Regime
from pyfmi_models.friction import LuGre
from pyfmi_models.model import parameters_of, with_symbols

Floats = npt.NDArray[np.float64]
OneStep = Callable[[LuGre, Regime, float], ca.Function]
"""Of a law, a motion and a step: the map from (state, time at the start of the step) to the state at its end."""
EXPLICIT = {"explicit Euler": 2.0, "Runge-Kutta 4": 2.785293563405282}
"""Where the real axis leaves the stability region of an explicit method."""
STIFFEST = 12.5
"""The collocation takes shorter steps where slope times step is more; halving this changes the truth by 3e-14."""


def exact(law: LuGre, regime: Regime, step: float) -> Floats:
    """Bristle torque [N m] at the end of each step, by collocation of order 9: correct to rounding (tested)."""
    slowest = step * float(_slope(law, np.array([abs(regime.peak) + abs(regime.offset)]))[0])
    parts = max(1, ceil(slowest / STIFFEST))
    return _collocated(law, regime, step / parts, regime.ticks(step) * parts)[parts - 1 :: parts]


def _collocated(law: LuGre, regime: Regime, step: float, count: int) -> Floats:
    nodes = np.array(ca.collocation_points(5, "radau"))
    powers = np.arange(len(nodes))
    A = (nodes[:, None] ** (powers + 1) / (powers + 1)) @ np.linalg.inv(nodes[:, None] ** powers)
    v = regime.speed(step * (np.arange(count)[:, None] + nodes)).ravel()
    free, slope = (x.reshape(-1, len(nodes)) for x in (_rates(law, 0.0, v), -_slope(law, v)))
    # The rate is free + slope F, so the stages K solve K = free + slope (F + step A K) and are linear in F, too.
    system = np.eye(len(nodes)) - step * slope[:, :, None] * A
    stages = np.linalg.solve(system, np.stack([free, slope], axis=-1))
    push, gain = step * stages[..., 0] @ A[-1], 1 + step * stages[..., 1] @ A[-1]
    found = [0.0]
    for a, b in zip(gain.tolist(), push.tolist(), strict=True):
        found.append(a * found[-1] + b)
    return np.array(found[1:])


def stability_limit(law: LuGre, bound: float, step: float, direction: int = 1) -> float:
    """Steady speed [rad/s] above which an explicit method is unstable; `bound` is its limit of step |d(rate)/dz|."""
    return float(brentq(lambda v: step * float(_slope(law, np.array([direction * v]))[0]) - bound, 1e-6, 1e3))


def iterate(one: ca.Function, times: Floats) -> Floats:
    """Apply a one-step map from rest; `times` are the starts of the steps."""
    return np.asarray(one.mapaccum(len(times))(0, ca.DM(times).T).full()).ravel()


def torque(law: LuGre, z: Floats, v: Floats) -> Floats:
    """Friction torque [N m] for bristle torques and speeds; dz/dt is that of the equation, not a difference."""
    return _each(_function(law, lambda this, x, w: this.contact(x, w, this.level(w)) + this.viscous(w)), z, v)


def _analytic(where: float) -> OneStep:
    """Equation (17) with the speed at a fraction of the step."""

    def one(law: LuGre, regime: Regime, step: float) -> ca.Function:
        z, t = ca.SX.sym("z"), ca.SX.sym("t")
        v = regime.speed(t + where * step)
        this = _at(law, v)
        return ca.Function("analytic", [z, t], [this.advance(z, v, this.level(v), step)])

    return one


def _explicit(tableau: Sequence[tuple[float, float]]) -> OneStep:
    """Explicit Runge-Kutta method where stage i starts from stage i-1: (fraction of the step, weight)."""

    def one(law: LuGre, regime: Regime, step: float) -> ca.Function:
        rate = _rate(law)
        z, t = ca.SX.sym("z"), ca.SX.sym("t")
        slope, total = ca.SX(0), z
        for fraction, weight in tableau:
            slope = rate(z + fraction * step * slope, regime.speed(t + fraction * step))
            total += weight * step * slope
        return ca.Function("explicit", [z, t], [total])

    return one


METHODS: dict[str, OneStep] = {
    "(17), speed at start": _analytic(0.0),
    "(17), speed at midpoint": _analytic(0.5),
    "explicit Euler": _explicit([(0, 1)]),
    "Runge-Kutta 4": _explicit([(0, 1 / 6), (1 / 2, 1 / 3), (1 / 2, 1 / 3), (1, 1 / 6)]),
}


def _at(law: LuGre, v: Any) -> LuGre:
    """Return the law with its pairs resolved for the direction of v."""
    symbols = {variable.name: ca.SX(variable.start) for variable in parameters_of(law)}
    return with_symbols(law, symbols, v)


def _function(law: LuGre, formula: Callable[[LuGre, Any, Any], Any]) -> ca.Function:
    state, v = ca.SX.sym("state"), ca.SX.sym("v")
    return ca.Function("formula", [state, v], [formula(_at(law, v), state, v)])


def _rate(law: LuGre) -> ca.Function:
    return _function(law, lambda this, x, v: this.rate(x, v, this.level(v)))


def _rates(law: LuGre, state: float, v: Floats) -> Floats:
    return _each(_rate(law), np.full_like(v, state), v)


def _slope(law: LuGre, v: Floats) -> Floats:
    """How fast a deviation of the bristle torque decays [1/s]: sigma0 |v| / g."""
    return _rates(law, 0.0, v) - _rates(law, 1.0, v)


def _each(function: ca.Function, state: Floats, v: Floats) -> Floats:
    """Evaluate a function of state and speed at each pair; calling it on rows directly takes four times as long."""
    row = ca.DM(state).T, ca.DM(v).T
    return np.asarray(function.map(len(v))(*row).full()).ravel()
