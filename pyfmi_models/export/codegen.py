"""Equations -> C: what CasADi writes, and the constant table through which the shim reads it."""

import hashlib
import json
import math
import re
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import casadi as ca

from pyfmi_models.errors import ExportError
from pyfmi_models.export.layout import Layout, Row, layout_of
from pyfmi_models.model import Model

SHIM = Path(__file__).parent / "c"
TOLERANCE = 1e-8
"""Relative tolerance of the co-simulation solver when the master gives none."""

_ROLES = ("rates", "outputs", "jacobian", "directional", "tick")
_NOT_DETERMINISTIC = re.compile(r"\b(erf|erfinv|remainder|fma|cbrt|lgamma|tgamma|round|rint|nearbyint)\s*\(")


@dataclass(frozen=True)
class Generated:
    """The two generated C files of a model, the token that ties description and binary, and the variables' layout."""

    layout: Layout
    token: str
    files: dict[str, str]


def generate(model: Model) -> Generated:
    """Write the C of a model; equal models give equal text.

    Raises ExportError if the variables break a rule or the equations call a function that detmath does not have.
    """
    layout = layout_of(model)
    functions = _functions(model)
    equations = _casadi_code(model, functions)
    token = _token(layout, equations)
    return Generated(layout, token, {"equations.c": equations, "model.c": _model_code(layout, token, functions)})


def _functions(model: Model) -> dict[str, ca.Function]:
    symbol: Any = ca.SX if model.equations.is_a("SXFunction") else ca.MX
    sizes = (1, len(model.states), len(model.inputs), len(model.parameters))
    point = [symbol.sym(name, size) for name, size in zip("txup", sizes, strict=True)]
    following, outputs = (ca.densify(part) for part in model.equations.call(point))
    if model.period:
        return {"tick": _function("tick", point, [following, outputs])}
    seeds = [symbol.sym(f"d{name}", size) for name, size in zip("txup", sizes, strict=True)]
    changes = [_directional(part, point, seeds) for part in (following, outputs)]
    slopes = [ca.densify(ca.jacobian(following, point[1])), ca.densify(ca.jacobian(following, point[0]))]
    return {
        "rates": _function("rates", point, [following]),
        "outputs": _function("outputs", point, [outputs]),
        "jacobian": _function("jacobian", point, slopes),
        "directional": _function("directional", point + seeds, changes),
    }


def _function(role: str, arguments: list[Any], results: list[Any]) -> ca.Function:
    return ca.Function(f"model_{role}", arguments, results, {"cse": True})


def _directional(part: Any, point: list[Any], seeds: list[Any]) -> Any:
    total = sum(ca.jtimes(part, place, seed) for place, seed in zip(point, seeds, strict=True) if place.numel())
    return ca.densify(total)


def _casadi_code(model: Model, functions: dict[str, ca.Function]) -> str:
    generator = ca.CodeGenerator("equations", {"with_header": False})
    for function in functions.values():
        generator.add(function)
    code = str(generator.dump())
    unknown = _NOT_DETERMINISTIC.search(code)
    if unknown:
        raise ExportError(f'model "{model.name}" uses {unknown[1]}, which has no deterministic version in detmath')
    return code


def _token(layout: Layout, equations: str) -> str:
    rows = [[row.kind, asdict(row.variable)] for row in layout.rows]
    model = layout.model
    content = json.dumps([model.name, model.description, model.period, TOLERANCE, rows, equations])
    digest = hashlib.sha256(content.encode()).hexdigest()
    return "{" + "-".join((digest[:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32])) + "}"


def _model_code(layout: Layout, token: str, functions: dict[str, ca.Function]) -> str:
    model = layout.model
    rows = ",\n".join(_row(row) for row in layout.rows)
    nominals = ", ".join(_number(state.nominal) for state in model.states) or "1"
    counts = [len(layout.rows), *(len(layout.of(kind)) for kind in ("input", "parameter", "state", "rate", "output"))]
    codes = ",\n".join(_code(role, functions.get(role)) for role in _ROLES)
    return f"""/* Generated for "{_comment(model.name)}": the table beside what CasADi wrote (equations.c). */
#include "detmath.h"

#include "equations.c"
#include "model.h"

static const Variable variables[] = {{
{rows}
}};

static const double nominals[] = {{{nominals}}};

const Model model = {{
    .token = "{token}",
    .period = {_number(model.period or 0)},
    .tolerance = {_number(TOLERANCE)},
    .size = {counts[0]}, .inputs = {counts[1]}, .parameters = {counts[2]},
    .states = {counts[3]}, .rates = {counts[4]}, .outputs = {counts[5]},
    .table = variables,
    .nominals = nominals,
{codes}
}};
"""


def _row(row: Row) -> str:
    variable = row.variable
    numbers = ", ".join(_number(value) for value in (variable.start, variable.low, variable.high))
    fixed = "" if variable.tunable else ", .fixed = 1"
    return f"    {{{json.dumps(variable.name)}, {row.kind.upper()}, {numbers}{fixed}}}"


def _code(role: str, function: ca.Function | None) -> str:
    if function is None:
        return f"    .{role}_code = {{0}}"
    sizes = (function.sz_arg(), function.sz_res(), function.sz_iw(), function.sz_w())
    return f"    .{role}_code = {{model_{role}, {', '.join(map(str, sizes))}}}"


def _number(value: float) -> str:
    if math.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    return repr(float(value))


def _comment(text: str) -> str:
    return text.replace("*/", "* /").replace("\n", " ")
