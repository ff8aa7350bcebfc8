"""What every calculated variable depends on, and how: the ModelStructure of FMI.

The equations are followed operation by operation. Each intermediate value carries the variables it depends on, each
with the strongest thing that may be said of its factor c in `value = c * variable + ...`: a constant, fixed with the
parameters, tunable with them, or no such factor at all ("dependent").
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain

import casadi as ca

from pyfmi_models.export.expressions import Node, graph_of, under
from pyfmi_models.export.layout import Layout, Row

KINDS = ("constant", "fixed", "tunable", "dependent")
"""From the strongest statement to none."""
NONE = KINDS.index("dependent")

_SUMS = {ca.OP_ADD, ca.OP_SUB, ca.OP_NEG, ca.OP_TWICE}
_PRODUCTS = {ca.OP_MUL, ca.OP_IF_ELSE_ZERO}


@dataclass(frozen=True)
class Unknown:
    """A calculated variable and what it depends on, by value reference: in a run, and at the start.

    In a run these are time, inputs and states; at the start parameters too, and then a factor is constant or none.
    """

    row: Row
    dependencies: Mapping[int, str]
    initial: Mapping[int, str]


@dataclass(frozen=True)
class _Value:
    """Variables with the kinds of their factors, and the kind of the value itself as a factor of something else."""

    kinds: Mapping[int, int]
    factor: int = 0

    def scaled(self, factor: int) -> "_Value":
        """Say less: the value times something of this kind that is no variable."""
        kinds = {variable: max(kind, factor) for variable, kind in self.kinds.items()}
        return _Value(kinds, max(self.factor, factor))


def unknowns_of(layout: Layout) -> list[Unknown]:
    """Rates and outputs with their dependencies."""
    running = _follow(layout, _start(layout, parameters_known=False))
    initial = _follow(layout, _start(layout, parameters_known=True))
    rows = [((0, i), row) for i, row in enumerate(layout.of("rate"))]
    rows += [((1, i), row) for i, row in enumerate(layout.of("output"))]
    return [Unknown(row, _named(running[at]), _named(initial[at], ("constant", "dependent"))) for at, row in rows]


def _named(value: _Value, allowed: tuple[str, ...] = KINDS) -> dict[int, str]:
    named = {variable: KINDS[kind] for variable, kind in sorted(value.kinds.items())}
    return {variable: kind if kind in allowed else "dependent" for variable, kind in named.items()}


def _start(layout: Layout, parameters_known: bool) -> list[list[_Value]]:
    """Values of the arguments (t, x, u, p). The memory of a sampled model is no variable of FMI: a tick hides it."""
    variable = [[_Value({row.reference: 0}) for row in layout.of(kind)] for kind in ("time", "state", "input")]
    if layout.model.period:
        variable[1] = [_Value({}, NONE)] * len(variable[1])
    parameters = layout.of("parameter")
    if parameters_known:
        return [*variable, [_Value({row.reference: 0}) for row in parameters]]
    kinds = ("tunable" if row.variable.tunable else "fixed" for row in parameters)
    return [*variable, [_Value({}, KINDS.index(kind)) for kind in kinds]]


def _follow(layout: Layout, arguments: list[list[_Value]]) -> dict[tuple[int, int], _Value]:
    """Value of every entry of (next, outputs), by part and place."""
    results = graph_of(layout.model.equations.expand())
    found: dict[Node, _Value] = {}
    for node in under(chain(*results)):
        part, entry = node.place
        given = part >= 0
        found[node] = arguments[part][entry] if given else _apply(node.operation, [found[n] for n in node.arguments])
    return {(part, place): found[node] for part, nodes in enumerate(results) for place, node in enumerate(nodes)}


def _apply(operation: int, values: list[_Value]) -> _Value:
    factor = max((value.factor for value in values), default=0)
    variables = [value for value in values if value.kinds]
    if operation in _SUMS or not variables:
        return _Value(_weakest(values), factor)
    first = values[0]
    if (operation in _PRODUCTS or (operation == ca.OP_DIV and first.kinds)) and len(variables) == 1:
        return variables[0].scaled(max(value.factor for value in values if not value.kinds))
    return _Value(dict.fromkeys(_weakest(values), NONE), NONE)


def _weakest(values: list[_Value]) -> dict[int, int]:
    found: dict[int, int] = {}
    for value in values:
        for variable, kind in value.kinds.items():
            found[variable] = max(kind, found.get(variable, 0))
    return found
