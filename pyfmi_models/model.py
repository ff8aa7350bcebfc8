"""The vocabulary: what physics and export say to each other.

A `Model` is a finished set of equations between named variables. Export reads nothing else, so a new law or effect
never touches it. A component (friction law, effect, mount) is a frozen dataclass whose fields, made by `parameter`,
*are* its documentation, its FMU variables, its bounds in a fit and its keys in a card.
"""

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from inspect import cleandoc
from math import inf
from typing import Any, NamedTuple, TypeVar

import casadi as ca

Scalar = Any
"""A number, a `Pair` of numbers, or a CasADi symbol in the place of one."""


@dataclass(frozen=True, kw_only=True)
class Variable:
    """A named quantity with its unit, bounds and start value (SI; "1" means dimensionless).

    A parameter that is not `tunable` keeps its value from the start of a run to its end.
    """

    name: str
    unit: str
    description: str
    start: float = 0.0
    low: float = -inf
    high: float = inf
    nominal: float = 1.0
    tunable: bool = True


class Pair(NamedTuple):
    """A number that depends on the direction of motion."""

    positive: float
    negative: float


@dataclass(frozen=True, kw_only=True)
class Model:
    """Equations between named variables, ready to be exported, fitted or simulated.

    `equations` maps (time, states, inputs, parameters), each a column, to (next, outputs): with `period` None the
    states are continuous and `next` holds their time derivatives; otherwise the model is sampled every `period`
    seconds and `next` holds the states after the tick. Outputs of a sampled model are those of the tick and hold
    until the next one. States may be set before the start; their `start` is the default.
    """

    name: str
    description: str
    inputs: tuple[Variable, ...]
    parameters: tuple[Variable, ...]
    states: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    equations: ca.Function
    period: float | None = None
    chapters: tuple["Chapter", ...] = ()


@dataclass(frozen=True, kw_only=True)
class Chapter:
    """What a person should know of the part of a model whose variables are called `prefix.name`.

    `text` is prose with indented formulas. Chapters are in the order in which a signal meets them: `place` says where a
    part acts, and `onto` at which other place a part works that stands beside the way from input to output.
    """

    prefix: str
    name: str
    title: str
    text: str
    place: str = ""
    onto: str = ""


@dataclass(frozen=True, kw_only=True)
class Derivation:
    """How the equations of a model come about, for a reader: quantities on the way.

    `symbols` are short names by which parts know variables of the whole. `equations` maps as those of the model, to
    (next, outputs, quantities), and shares the quantities' expressions.
    """

    quantities: tuple[Variable, ...]
    symbols: Mapping[str, str]
    equations: ca.Function


Component = TypeVar("Component")


class Recorded(NamedTuple):
    """What recordings reach: highest speed [rad/s], the torque command that is hardly ever exceeded [N m],
    and the lowest and highest position [rad].
    """

    speed: float
    torque: float
    low: float = -inf
    high: float = inf


class Part:
    """What carries parameters: an axis, a friction law, an effect."""

    def fit_bounds(self, variable: Variable, recorded: Recorded) -> tuple[float, float]:
        """Bounds of a parameter in a fit: its own, and what the recordings can tell; `variable` without prefix."""
        return variable.low, variable.high


def parameter(
    unit: str,
    description: str,
    *,
    default: Any = MISSING,
    low: float = -inf,
    high: float = inf,
    nominal: float = 1.0,
    tunable: bool = True,
    fitted: bool = True,
) -> Any:
    """Declare a physical parameter of a component: unit, meaning and the bounds every user of it respects.

    Say `tunable=False` where a change in a run would change what the states mean, and so make torque out of nothing.
    Say `fitted=False` of what a fit to recordings leaves as it is: a limit, the shape of a law, a number of a grid.
    """
    numbers = {"low": low, "high": high, "nominal": nominal}
    variable = Variable(name="", unit=unit, description=description, tunable=tunable, **numbers)
    return field(default=default, metadata={"variable": variable, "fitted": fitted})


def structure(unit: str, description: str, *, low: float = -inf, high: float = inf) -> Any:
    """Declare a tuple of numbers that shapes the equations themselves: a card key, but no FMU variable and no fit."""
    variable = Variable(name="", unit=unit, description=description, low=low, high=high)
    return field(default=(), metadata={"structure": variable})


def word(description: str, *, default: Any = MISSING) -> Any:
    """Declare a text that shapes the equations: a card key, but no FMU variable and no fit."""
    return field(default=default, metadata={"word": description})


def parameters_of(component: Any, prefix: str = "") -> tuple[Variable, ...]:
    """List the parameters of a component with their present values as start values.

    A `Pair` becomes two variables, `name.positive` and `name.negative`. `prefix` is put before each name with a dot.
    """
    found: list[Variable] = []
    for name, variable, value in _declared(component):
        full = f"{prefix}.{name}" if prefix else name
        if isinstance(value, Pair):
            found += [replace(variable, name=f"{full}.{side}", start=getattr(value, side)) for side in Pair._fields]
        else:
            found.append(replace(variable, name=full, start=float(value)))
    return tuple(found)


def with_symbols(component: Component, symbols: dict[str, Scalar], direction: Any, prefix: str = "") -> Component:
    """Return the component with a symbol in the place of each number; `symbols` maps full names to them.

    A `Pair` becomes the symbol of the side that `direction` (a signed speed) points to.
    """
    changes: dict[str, Scalar] = {}
    for name, _, value in _declared(component):
        full = f"{prefix}.{name}" if prefix else name
        if isinstance(value, Pair):
            changes[name] = ca.if_else(direction >= 0, symbols[f"{full}.positive"], symbols[f"{full}.negative"])
        else:
            changes[name] = symbols[full]
    return replace(component, **changes)  # type: ignore[type-var]


def symbols_of(variables: tuple[Variable, ...]) -> tuple[Any, dict[str, Scalar]]:
    """Make one CasADi column of symbols for the variables, and a dictionary from name to entry."""
    column = ca.SX.sym("p", len(variables))
    return column, {variable.name: column[index] for index, variable in enumerate(variables)}


def _declared(component: Any) -> list[tuple[str, Variable, Any]]:
    declared = [(item.name, item.metadata.get("variable"), getattr(component, item.name)) for item in fields(component)]
    return [(name, variable, value) for name, variable, value in declared if variable is not None and value is not None]


def unfitted_of(component: Any) -> tuple[str, ...]:
    """Names of the parameters of a component that a fit leaves as they are."""
    return tuple(item.name for item in fields(component) if not item.metadata.get("fitted", True))


def structure_of(component: Any) -> dict[str, tuple[float, ...] | str]:
    """Numbers and words of a component that shape its equations, by field; see `structure` and `word`."""
    shaping = [item.name for item in fields(component) if item.metadata.keys() & {"structure", "word"}]
    return {name: getattr(component, name) for name in shaping}


def chapter_of(part: Any, prefix: str, place: str, onto: str = "", title: str = "") -> Chapter:
    """Make a chapter of what a part of a model says of itself: its title, else its class, and its docstring."""
    name = type(part).__name__
    title = title or getattr(part, "title", name)
    return Chapter(prefix=prefix, name=name, title=title, text=cleandoc(part.__doc__ or ""), place=place, onto=onto)


def fields_of(component: Any) -> tuple[str, ...]:
    """Names of the parameters of a component as its fields, without prefix and side."""
    return tuple(name for name, _, _ in _declared(component))
