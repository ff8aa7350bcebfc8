"""The plant in which a law or an effect is checked: numbers for it, and values and derivatives of its equations."""

from collections.abc import Sequence
from dataclasses import MISSING, dataclass, fields
from functools import cached_property
from itertools import pairwise
from math import isfinite
from typing import Any, TypeVar

import casadi as ca
import numpy as np
import numpy.typing as npt

from cosim.support.errors import InputError
from pyfmi_models.effects import Effect
from pyfmi_models.friction import Coulomb, FrictionLaw
from pyfmi_models.model import Model, Pair, Variable, parameters_of
from pyfmi_models.mount import Axis, Mount

Array = npt.NDArray[np.float64]
Part = TypeVar("Part")
INERTIA = 2.0
"""Of the axis [kg m2]."""
LAW = Coulomb(Fc=1.0, sigma2=3.0)
"""Friction under an effect: 1 N m, 3 N m s/rad."""


def example_of(given: type[Part] | Part) -> Part:
    """The object to check: what is given, or one of a class with required numbers from inside their bounds.

    Raises:
        InputError: a required number has no bounds that tell a size, or numbers that are guessed break a rule.
    """
    if not isinstance(given, type):
        return given
    required = {item.name: item.metadata for item in fields(given) if item.default is MISSING}  # type: ignore[arg-type]
    guessed = {name: _inside(known["variable"]) for name, known in required.items() if "variable" in known}
    try:
        made = given(**guessed)
    except TypeError as error:
        text = f"{given.__name__} cannot be made from guessed numbers ({error}); give an object, MyClass(...)."
        raise InputError(text, culprit=given.__name__) from None
    if rule := getattr(made, "broken_rule", lambda: "")():
        text = f"{given.__name__} with guessed numbers {guessed} breaks its rule: {rule}; give an object, MyClass(...)."
        raise InputError(text, culprit=given.__name__)
    return made


def _inside(variable: Variable) -> float:
    """A number that a parameter may have: its nominal, or one between its bounds."""
    if variable.low < variable.nominal < variable.high:
        return variable.nominal
    low = variable.low if isfinite(variable.low) else min(-variable.nominal, variable.high - variable.nominal)
    return (low + variable.high) / 2 if isfinite(variable.high) else low + variable.nominal


def mount_of(part: Effect | FrictionLaw, *more: Effect) -> Mount:
    """An axis with an effect on Coulomb friction, or with a law of friction."""
    law = part if isinstance(part, FrictionLaw) else LAW
    effects = (*more, part) if isinstance(part, Effect) else more
    return Mount(name="checked", axis=Axis(inertia=INERTIA), friction=law, effects=effects)


@dataclass(frozen=True)
class Equations:
    """Rates and outputs of a model, and their exact derivatives, at columns of (t, x, u, p)."""

    model: Model

    @property
    def variables(self) -> Sequence[Variable]:
        """What stands in a column behind the time."""
        return (*self.model.states, *self.model.inputs, *self.model.parameters)

    @cached_property
    def _function(self) -> ca.Function:
        sizes = [1, len(self.model.states), len(self.model.inputs), len(self.model.parameters)]
        z = ca.SX.sym("z", sum(sizes))
        parts = [z[first:last] for first, last in pairwise(np.cumsum([0, *sizes]))]
        values = ca.densify(ca.vertcat(*self.model.equations(*parts)))
        return ca.Function("slopes", [z], [values, ca.densify(ca.jacobian(values, z))])

    def at(self, column: Array) -> tuple[Array, Array]:
        """Values (rates and outputs,), and their derivatives by the column."""
        values, slopes = self._function(column)
        return values.full().ravel(), slopes.full()

    def named(self, t: float = 0.0, **values: float) -> dict[str, float]:
        """Rates `der(state)` and outputs by name, at values by name; the others are at their start."""
        column = np.array([t, *(values.get(one.name, one.start) for one in self.variables)])
        names = [*(f"der({one.name})" for one in self.model.states), *(one.name for one in self.model.outputs)]
        return dict(zip(names, self.at(column)[0].tolist(), strict=True))

    def points(self, count: int, seed: int = 0) -> Array:
        """Columns: times from 0 to hours, speeds from rest to fast, states and inputs of all sizes; (count, column)."""
        rng = np.random.default_rng(seed)
        found = np.zeros((1 + len(self.variables), count))
        found[0] = rng.choice([0.0, 1.0, 1e4], count) * rng.random(count)
        fixed = len(self.model.states) + len(self.model.inputs)
        for row, one in enumerate(self.variables, 1):
            size = one.nominal * rng.choice([0.0, 1e-6, 1.0, 30.0], count) if row <= fixed else np.zeros(count)
            found[row] = np.clip(one.start + size * rng.standard_normal(count), one.low, one.high)
        found[2, ::4] = 0.0  # at rest
        return found.T


def numbers_of(part: Any) -> dict[str, float]:
    """Parameters of a part by field; the mean of a pair."""
    found: dict[str, float] = {}
    for variable in parameters_of(part):
        name = variable.name.partition(".")[0]
        value = getattr(part, name)
        found[name] = sum(value) / 2 if isinstance(value, Pair) else float(value)
    return found
