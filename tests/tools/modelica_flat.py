"""A Modelica text as an outside parser understands it: flattened, with values for what is given."""

import math
from typing import Any

import numpy as np
import pymoca.ast as ast
import pymoca.parser
from pymoca.tree import flatten

from pyfmi_models.model import Model

OPERATORS = {
    "+": lambda a, b=None: a if b is None else a + b,
    "-": lambda a, b=None: -a if b is None else a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
    "^": math.pow,
    ">=": lambda a, b: a >= b,
    ">": lambda a, b: a > b,
    "<=": lambda a, b: a <= b,
    "<": lambda a, b: a < b,
    "abs": abs,
    "sign": lambda a: (a > 0) - (a < 0),
    "min": min,
    "max": max,
    **{name: getattr(math, name) for name in ("sin", "cos", "tan", "tanh", "exp", "log", "sqrt", "floor")},
}


class Flat:
    """A flattened model with values for what is given; everything else follows from its equations.

    An equation of a symbol says that nothing is connected outside, so that a flow is zero: those are left out.
    """

    def __init__(self, text: str, package: str, model: str = "Plant") -> None:
        tree = pymoca.parser.parse(text)
        assert tree is not None, text
        place = ast.ComponentRef(name=package, child=[ast.ComponentRef(name=model)])
        (flat,) = flatten(tree, place).classes.values()
        self.symbols = flat.symbols
        equations = [one for one in flat.equations if not isinstance(one.left, ast.Symbol)]
        self.equations = dict(map(self._solved, equations))
        assert len(self.equations) == len(equations)

    @staticmethod
    def _solved(equation: Any) -> tuple[str, tuple[Any, Any]]:
        """`name`, `der(name)` or `factor*der(name)` on the left."""
        left, factor = equation.left, None
        if isinstance(left, ast.Expression) and left.operator == "*":
            factor, left = left.operands
        name = f"der({left.operands[0]})" if isinstance(left, ast.Expression) else str(left)
        return name, (equation.right, factor)

    def values(self, given: dict[str, float]) -> dict[str, float]:
        self.known = dict(given)
        return {name: self.value(name) for name in self.equations}

    def value(self, name: str) -> float:
        if name not in self.known:
            if name in self.equations:
                right, factor = self.equations[name]
                self.known[name] = self.of(right) / (1 if factor is None else self.of(factor))
            else:
                self.known[name] = self.of(self.symbols[name].value)
        return self.known[name]

    def of(self, node: Any) -> Any:
        if isinstance(node, ast.Primary):
            return node.value
        if isinstance(node, ast.ComponentRef):
            return self.value(str(node))
        if isinstance(node, ast.IfExpression):
            return self.of(node.expressions[0] if self.of(node.conditions[0]) else node.expressions[1])
        if str(node.operator) == "der":
            return self.value(f"der({node.operands[0]})")
        return OPERATORS[str(node.operator)](*map(self.of, node.operands))


def in_modelica(model: Model, name: str) -> str:
    """What a variable of the model is called in the package: only the first dot parts a component from its variable."""
    prefix, dot, rest = name.partition(".")
    parts = {variable.name.partition(".")[0] for variable in (*model.parameters, *model.states) if "." in variable.name}
    return f"{prefix}.{rest.replace('.', '_')}" if dot else f"{name}_output" if name in parts else name


def at_random(model: Model, seed: int) -> tuple[float, list[np.ndarray]]:
    """Time, and states, inputs and parameters around their start and nominal values, inside their bounds."""
    random = np.random.default_rng(seed)

    def drawn(variable: Any, own: bool) -> float:
        scale = 0.05 * abs(variable.start) if own else variable.nominal * 10 ** random.uniform(-1, 1.5)
        value = variable.start + scale * random.uniform(-1, 1)
        return float(np.clip(value, variable.low, variable.high))

    columns = [(model.states, False), (model.inputs, False), (model.parameters, True)]
    return float(random.uniform(0, 9)), [np.array([drawn(one, own) for one in group]) for group, own in columns]
