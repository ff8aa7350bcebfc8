"""Every friction law of `LAWS` with numbers of the telescope mount, and its formulas as functions of numbers.

A new law is met by all property tests at once; a required parameter that `NUMBERS` does not name is taken from inside
its bounds.
"""

from dataclasses import MISSING, fields, replace
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
from effect_examples import inside

from pyfmi_models.friction import LAWS, FrictionLaw
from pyfmi_models.model import Pair, parameters_of, symbols_of, with_symbols

NUMBERS = {"sigma0": 9.23e4, "sigma1": 497.0, "sigma2": 32.77, "Fc": 2.322, "Fs": 3.322, "Vs": 0.04129, "delta": 1.292}
STEP = 1e-4
Array = Any


def example(kind: type[FrictionLaw]) -> FrictionLaw:
    """Return a law with the mount's numbers where it has them, and its defaults elsewhere."""
    known = {item.name: item for item in fields(kind)}
    required = {name: item.metadata["variable"] for name, item in known.items() if item.default is MISSING}
    guessed = {name: inside(variable) for name, variable in required.items()}
    return kind(**(guessed | {name: value for name, value in NUMBERS.items() if name in known}))


EXAMPLES = {key: example(kind) for key, kind in LAWS.items()}
VARIANTS = EXAMPLES | {
    "brittle dahl": replace(EXAMPLES["dahl"], n=0.5),
    "ductile dahl": replace(EXAMPLES["dahl"], n=2.0),
    "lugre without stribeck": replace(EXAMPLES["lugre"], Fs=None, Vs=None),
    "blunt maxwell_slip": replace(EXAMPLES["maxwell_slip"], attraction=20.0, spread=300.0, sigma1=0.0),
}
"""The laws, and shapes of them that pass through other branches."""
ONE_SIDED = {
    key: replace(law, **{name: Pair(1.1 * value, 0.8 * value) for name, value in NUMBERS.items() if hasattr(law, name)})
    for key, law in EXAMPLES.items()
}
"""The laws with numbers that depend on direction."""
WITH_MEMORY = {key: law for key, law in VARIANTS.items() if law.states()}


class Numeric:
    """The formulas of a law as compiled functions of (states, speed, seconds, parameters)."""

    def __init__(self, law: FrictionLaw) -> None:
        self.law, self.size, variables = law, len(law.states()), parameters_of(law)
        self.values = np.array([variable.start for variable in variables])
        p, symbols = symbols_of(variables)
        x, v, dt = ca.SX.sym("x", self.size), ca.SX.sym("v"), ca.SX.sym("dt")
        this = with_symbols(law, symbols, v)
        level = this.level(v) + 0 * v
        torque = this.contact(x, v, level) + this.viscous(v)
        self.formulas = {"level": level, "torque": torque, "rate": this.rate(x, v, level)}
        self.formulas["advance"] = this.advance(x, v, level, dt)
        self.point = (x, v, dt, p)
        self.functions = {name: ca.Function(name, [*self.point], [one]) for name, one in self.formulas.items()}

    def slopes(self, name: str, state: Array, v: float, dt: float = STEP) -> tuple[Array, Array]:
        """Values of a formula (rows,), and its derivatives by (states, speed, seconds, parameters), exactly."""
        everything = ca.vertcat(*self.point)
        function = ca.Function(
            "slopes", [*self.point], [self.formulas[name], ca.jacobian(self.formulas[name], everything)]
        )
        value, slopes = function(state, v, dt, self.values)
        return value.full().ravel(), slopes.full()

    def __call__(self, name: str, state: Array, v: float, dt: float = STEP) -> Array:
        return self.functions[name](state, v, dt, self.values).full().ravel()

    def start(self, share: Array = 0.0) -> Array:
        """States at a share of the level at rest, each element at its part of it."""
        return np.full(self.size, share * self("level", np.zeros(self.size), 0.0)[0] / max(self.size, 1))

    def along(self, v: Array, dt: float, state: Array | None = None) -> Array:
        """States (size, samples) after each sample of a motion whose speed is constant for dt."""
        state = self.start() if state is None else state
        if not self.size:
            return np.zeros((0, len(v)))
        advance = self.functions["advance"].mapaccum(len(v))
        return advance(state, ca.DM(v).T, dt, ca.repmat(ca.DM(self.values), 1, len(v))).full()

    def torque_of(self, states: Array, v: Array) -> Array:
        """Torque for each column of states and each speed."""
        row = self.functions["torque"].map(len(v))
        return row(states, ca.DM(v).T, STEP, ca.repmat(ca.DM(self.values), 1, len(v))).full().ravel()


@cache
def numeric(law: FrictionLaw) -> Numeric:
    """Return the compiled formulas of a law, made once."""
    return Numeric(law)


def work(law: FrictionLaw, v: Array, dt: float, states: Array) -> tuple[float, float]:
    """Work done on friction along a motion, and the energy moved either way (the scale of rounding).

    `states` are those before each sample; three Gauss points a sample see the torque bend within it.
    """
    this, total, moved = numeric(law), 0.0, 0.0
    inner = this.functions["advance"].map(len(v)) if this.size else None
    p = ca.repmat(ca.DM(this.values), 1, len(v))
    for place, weight in zip((1 - 0.6**0.5, 1.0, 1 + 0.6**0.5), (5 / 18, 8 / 18, 5 / 18), strict=True):
        at = inner(states, ca.DM(v).T, place / 2 * dt, p).full() if inner else states
        power = weight * dt * this.torque_of(at, v) * v
        total, moved = total + float(power.sum()), moved + float(np.abs(power).sum())
    return total, moved
