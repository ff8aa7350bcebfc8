"""Model -> C: its equations, and the constant table through which the shim reads them."""

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from itertools import accumulate
from pathlib import Path
from typing import Any

import casadi as ca

from pyfmi_models.errors import ExportError
from pyfmi_models.export.c_code import c_function, number
from pyfmi_models.export.layout import Layout, Row, layout_of
from pyfmi_models.export.rodas4 import step_functions
from pyfmi_models.model import Model, Scalar

SHIM = Path(__file__).parent / "c"
TOLERANCE = 1e-8
"""Relative tolerance of the co-simulation solver when the master gives none."""
WORK, OVERHEAD = 1_000_000_000, 100
"""Operations that one call may take before it gives up, about a second; and those around a step of the solver."""


@dataclass(frozen=True)
class Generated:
    """The two generated C files of a model, the token that ties description and binary, and the variables' layout.

    `most_steps` are the steps of the solver, or the ticks, that one call takes before it gives up.
    """

    layout: Layout
    token: str
    most_steps: int
    files: dict[str, str]


def generate(model: Model) -> Generated:
    """Write the C of a model; equal models give equal text.

    Raises ExportError if the variables break a rule or the equations call a function that detmath does not have.
    """
    layout = layout_of(model)
    functions = _functions(model)
    try:
        equations = "\n".join(c_function(f"model_{role}", parts) for role, parts in functions.items())
    except ExportError as error:
        raise ExportError(f'model "{model.name}" {error}') from None
    token = _token(layout, equations)
    most_steps = _most_steps(functions)
    code = _model_code(layout, token, functions, most_steps)
    return Generated(layout, token, most_steps, {"equations.c": equations, "model.c": code})


def _functions(model: Model) -> dict[str, list[ca.Function]]:
    """The functions of each role; where there are several, the later ones use what the earlier ones make."""
    point = {name: ca.SX.sym(name, size) for name, size in zip("txup", _sizes(model), strict=True)}
    following, outputs = _scalar(model).call([*point.values()])
    if model.period:
        return {"tick": [_function(point, {"next": following, "y": outputs})]}
    rates = _function(point, {"rates": following})
    found = {"rates": [rates], "outputs": [_function(point, {"y": outputs})]} | _derivatives(point, following, outputs)
    return found | ({"step": [*step_functions(rates, [s.nominal for s in model.states])]} if model.states else {})


def _sizes(model: Model) -> tuple[int, ...]:
    return 1, len(model.states), len(model.inputs), len(model.parameters)


def _scalar(model: Model) -> ca.Function:
    """Return the equations written out in scalars: only so does a step of the solver know where zeros are."""
    try:
        return model.equations if model.equations.is_a("SXFunction") else model.equations.expand()
    except RuntimeError as error:
        raise ExportError(f'the equations of model "{model.name}" cannot be written out in scalars: {error}') from error


def _derivatives(point: dict[str, Scalar], rates: Any, outputs: Any) -> dict[str, list[ca.Function]]:
    """Directional derivatives, from changes of the point to changes of the results, and adjoint ones, backwards."""
    seeds = {f"d{name}": ca.SX.sym(f"d{name}", part.numel()) for name, part in point.items()}
    weights = {"dr": ca.SX.sym("dr", rates.numel()), "dy": ca.SX.sym("dy", outputs.numel())}
    before = ca.vertcat(*point.values())
    changes = [ca.jtimes(part, before, ca.vertcat(*seeds.values())) for part in (rates, outputs)]
    back = ca.jtimes(ca.vertcat(rates, outputs), before, ca.vertcat(*weights.values()), True)
    ends = [0, *accumulate(part.numel() for part in point.values())]
    parts = {f"d{name}": back[a:b] for name, a, b in zip(point, ends, ends[1:], strict=False)}
    return {
        "directional": [_function(point | seeds, {"dr": changes[0], "dy": changes[1]})],
        "adjoint": [_function(point | weights, parts)],
    }


def _function(given: dict[str, Scalar], results: dict[str, Scalar]) -> ca.Function:
    dense = {name: ca.densify(part) for name, part in results.items()}
    return ca.Function("role", given | dense, [*given], [*dense], {"cse": True})


def _token(layout: Layout, equations: str) -> str:
    rows = [[row.kind, asdict(row.variable)] for row in layout.rows]
    model = layout.model
    content = json.dumps([model.name, model.description, model.period, TOLERANCE, rows, equations])
    digest = hashlib.sha256(content.encode()).hexdigest()
    return "{" + "-".join((digest[:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32])) + "}"


def _model_code(layout: Layout, token: str, functions: Iterable[str], most_steps: int) -> str:
    model = layout.model
    shown = _shown(layout)
    rows = ",\n".join(_row(row, shown.get(row.reference, row.reference)) for row in layout.rows)
    nominals = ", ".join(number(state.nominal) for state in model.states) or "1"
    counts = [len(layout.rows), *(len(layout.of(kind)) for kind in ("input", "parameter", "state", "rate", "output"))]
    codes = ",\n".join(f"    .{role}_code = model_{role}" for role in functions)
    return f"""/* Generated for "{_comment(model.name)}": the table beside its equations. */
#include "detmath.h"
#include "model.h"

#include "equations.c"

static const Variable variables[] = {{
{rows}
}};

static const double nominals[] = {{{nominals}}};

const Model model = {{
    .token = "{token}",
    .period = {number(model.period or 0)},
    .tolerance = {number(TOLERANCE)},
    .size = {counts[0]}, .inputs = {counts[1]}, .parameters = {counts[2]},
    .states = {counts[3]}, .rates = {counts[4]}, .outputs = {counts[5]},
    .most_steps = {most_steps},
    .table = variables,
    .nominals = nominals,
{codes}
}};

#include "solver.h"
"""


def _most_steps(functions: dict[str, list[ca.Function]]) -> int:
    once = [part.n_instructions() for role in ("step", "tick") for part in functions.get(role, ())]
    return WORK // (sum(once) + OVERHEAD)


def _shown(layout: Layout) -> dict[int, int]:
    """Outputs of a continuous model that show an input or a state as it is, with what they show."""
    model = layout.model
    if model.period:
        return {}
    point = [ca.SX.sym(name, size) for name, size in zip("txup", _sizes(model), strict=True)]
    outputs = ca.densify(_scalar(model).call(point)[1])
    given = [*zip(ca.vertsplit(point[1]), layout.of("state"), strict=True)]
    given += zip(ca.vertsplit(point[2]), layout.of("input"), strict=True)
    rows = enumerate(layout.of("output"))
    return {row.reference: source.reference for i, row in rows for one, source in given if ca.is_equal(outputs[i], one)}


def _row(row: Row, same: int) -> str:
    variable = row.variable
    numbers = ", ".join(number(value) for value in (variable.start, variable.low, variable.high))
    fixed = int(not variable.tunable)
    return f"    {{{json.dumps(variable.name)}, {row.kind.upper()}, {numbers}, {fixed}, {same}}}"


def _comment(text: str) -> str:
    return text.replace("*/", "* /").replace("\n", " ")
