"""The flat table of variables of a model: one row a value reference, the same in FMI 2, FMI 3 and the C shim."""

import math
import re
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from pyfmi_models.errors import ExportError
from pyfmi_models.model import Model, Variable

Kind = Literal["time", "input", "parameter", "state", "rate", "output"]


@dataclass(frozen=True)
class Row:
    """A variable with its value reference; `state` is the value reference of the state that a rate belongs to."""

    reference: int
    kind: Kind
    variable: Variable
    state: int | None = None


@dataclass(frozen=True)
class Layout:
    """Rows in the order of the C table: time, inputs, parameters, states, rates of continuous states, outputs."""

    model: Model
    rows: tuple[Row, ...]

    def of(self, *kinds: Kind) -> tuple[Row, ...]:
        """Rows of these kinds, by value reference."""
        return tuple(row for row in self.rows if row.kind in kinds)

    @cached_property
    def identifier(self) -> str:
        """The model's name as a C identifier: name of the binary and `modelIdentifier`."""
        name = re.sub(r"\W", "_", self.model.name, flags=re.ASCII)
        return name if name[:1].isalpha() else f"m_{name}"


def layout_of(model: Model) -> Layout:
    """Number the variables of the model.

    Raises ExportError that names the variable and the rule if a name is doubled or reserved, a start value is not a
    number within the bounds, a nominal is not positive, or the equations have other sizes than the lists of variables.
    """
    time = Variable(name="time", unit="s", description="Simulation time")
    groups: list[tuple[Kind, tuple[Variable, ...]]] = [
        ("time", (time,)),
        ("input", model.inputs),
        ("parameter", model.parameters),
        ("state", model.states),
        ("rate", () if model.period else tuple(_rate(state) for state in model.states)),
        ("output", model.outputs),
    ]
    rows: list[Row] = []
    for kind, variables in groups:
        first = len(rows)
        rows += [
            Row(first + i, kind, v, first - len(variables) + i if kind == "rate" else None)
            for i, v in enumerate(variables)
        ]
    _check(model, rows)
    return Layout(model, tuple(rows))


def _rate(state: Variable) -> Variable:
    unit = "1/s" if state.unit == "1" else _per_second(state.unit)
    return Variable(name=f"der({state.name})", unit=unit, description=f"Time derivative of {state.name}")


def _per_second(unit: str) -> str:
    """Unit of the time derivative, written as the vocabulary would: m -> m/s, rad/s -> rad/s2, N/m -> N/(m.s)."""
    numerator, slash, denominator = unit.partition("/")
    if not slash:
        return f"{numerator}/s"
    factors = denominator.strip("()").split(".")
    powers = [re.fullmatch(r"s(\d*)", factor) for factor in factors]
    if not any(powers):
        return f"{numerator}/({'.'.join(factors)}.s)"
    raised = [f"s{int(power[1] or 1) + 1}" if power else factor for factor, power in zip(factors, powers, strict=True)]
    return f"{numerator}/{raised[0]}" if len(raised) == 1 else f"{numerator}/({'.'.join(raised)})"


def _check(model: Model, rows: list[Row]) -> None:
    if model.period is not None and not 0 < model.period < math.inf:
        raise ExportError(f'model "{model.name}": the period {model.period} s is not positive and finite')
    seen: set[str] = set()
    for row in rows:
        if row.variable.name in seen:
            raise ExportError(f'model "{model.name}": two variables are called "{row.variable.name}"')
        seen.add(row.variable.name)
        _check_numbers(row.variable)
    _check_sizes(model)


def _check_numbers(variable: Variable) -> None:
    if not variable.low <= variable.start <= variable.high or not math.isfinite(variable.start):
        raise ExportError(
            f'"{variable.name}": the start value {variable.start} is no number from {variable.low} to {variable.high}'
        )
    if not 0 < variable.nominal < math.inf:
        raise ExportError(f'"{variable.name}": the nominal value {variable.nominal} is not positive and finite')


def _check_sizes(model: Model) -> None:
    equations = model.equations
    if (equations.n_in(), equations.n_out()) != (4, 2):
        raise ExportError(f'model "{model.name}": equations must map (t, x, u, p) to (next, outputs)')
    sizes = [
        ("states", equations.numel_in(1), model.states),
        ("inputs", equations.numel_in(2), model.inputs),
        ("parameters", equations.numel_in(3), model.parameters),
        ("rates", equations.numel_out(0), model.states),
        ("outputs", equations.numel_out(1), model.outputs),
    ]
    for what, size, variables in sizes:
        if size != len(variables):
            raise ExportError(
                f'model "{model.name}": the equations have {size} {what}, but {len(variables)} are listed'
            )
