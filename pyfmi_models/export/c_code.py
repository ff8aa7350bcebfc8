"""Equations -> C: scalar CasADi functions as plain C, one operation a line.

CasADi writes C too; this text is a third of the length, has no tests for missing arguments in its way (a step of the
solver takes nine tenths of the time) and can only call what `detmath` makes the same on every machine.
"""

import math
import re
from collections.abc import Sequence

import casadi as ca

from pyfmi_models.errors import ExportError

# All functions are those of detmath.h; {0} and {1} are names of variables or numbers in brackets.
_OPERATIONS = {
    "ASSIGN": "{0}",
    "LIFT": "{0}",
    "ADD": "{0} + {1}",
    "SUB": "{0} - {1}",
    "MUL": "{0} * {1}",
    "DIV": "{0} / {1}",
    "NEG": "-{0}",
    "INV": "1 / {0}",
    "SQ": "{0} * {0}",
    "TWICE": "2 * {0}",
    "POW": "pow({0}, {1})",
    "CONSTPOW": "pow({0}, {1})",
    "LT": "{0} < {1}",
    "LE": "{0} <= {1}",
    "EQ": "{0} == {1}",
    "NE": "{0} != {1}",
    "NOT": "{0} == 0",
    "AND": "{0} != 0 && {1} != 0",
    "OR": "{0} != 0 || {1} != 0",
    "IF_ELSE_ZERO": "{0} != 0 ? {1} : 0",
}
_ONE = "sqrt exp expm1 log log1p sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh fabs floor ceil sign"
_TWO = "atan2 hypot fmod remainder copysign fmin fmax"
_TEXTS = (
    {getattr(ca, f"OP_{name}"): text for name, text in _OPERATIONS.items()}
    | {getattr(ca, f"OP_{name.upper()}"): f"{name}({{0}})" for name in _ONE.split()}
    | {getattr(ca, f"OP_{name.upper()}"): f"{name}({{0}}, {{1}})" for name in _TWO.split()}
)
_NAMES = {getattr(ca, name): name[3:].lower() for name in dir(ca) if name.startswith("OP_")}


def c_function(name: str, parts: Sequence[ca.Function]) -> str:
    """Write functions of dense columns as one C function; a part may use columns of the parts before it by name.

    It reads the columns that no part makes and writes those that the last part makes.
    Raises ExportError, a sentence without its subject, if an operation is not the same on every machine.
    """
    made = {one for part in parts for one in part.name_out()}
    sizes = {one: part.numel_in(one) for part in parts for one in part.name_in() if one not in made}
    columns = {one: [f"{one}[{i}]" for i in range(size)] for one, size in sizes.items()}
    inputs, outputs = list(sizes), parts[-1].name_out()
    lines: list[str] = []
    for part in parts:
        columns |= _write(part, columns, lines)
    lines += [f"out[{i}][{j}] = {value};" for i, to in enumerate(outputs) for j, value in enumerate(columns[to])]
    body = "\n".join(f"    {line}" for line in [*_used(inputs, lines), *lines])
    signature = f"static void {name}(const double *const in[], double *const out[]) {{"
    return f"/* ({', '.join(inputs)}) -> ({', '.join(outputs)}) */\n{signature}\n{body}\n}}\n"


def _used(inputs: Sequence[str], lines: Sequence[str]) -> list[str]:
    """Declare the inputs that the lines read."""
    text = "\n".join(lines)
    return [f"const double *{name} = in[{i}];" for i, name in enumerate(inputs) if re.search(rf"\b{name}\[", text)]


def _write(part: ca.Function, columns: dict[str, list[str]], lines: list[str]) -> dict[str, list[str]]:
    """Append a line for each operation; return the columns that the function makes."""
    work: dict[int, str] = {}
    made = {name: [""] * part.numel_out(name) for name in part.name_out()}
    for k in range(part.n_instructions()):
        code, places, (to, *entry) = part.instruction_id(k), part.instruction_input(k), part.instruction_output(k)
        if code == ca.OP_INPUT:
            work[to] = columns[part.name_in(places[0])][places[1]]
        elif code == ca.OP_CONST:
            work[to] = number(part.instruction_constant(k))
        elif code == ca.OP_OUTPUT:
            made[part.name_out(to)][entry[0]] = work[places[0]]
        else:
            lines.append(f"const double a{len(lines)} = {_operation(code, [work[place] for place in places])};")
            work[to] = f"a{len(lines) - 1}"
    return made


def _operation(code: int, operands: Sequence[str]) -> str:
    if code not in _TEXTS:
        name, choices = _NAMES.get(code, str(code)), ", ".join(sorted(f"{_ONE} {_TWO} pow".split()))
        raise ExportError(
            f"uses {name}, of which there is no version with the same bits on every machine; there are, besides "
            f"arithmetic and comparison: {choices}"
        )
    return _TEXTS[code].format(*operands)


def number(value: float) -> str:
    """Write a number in C, exactly."""
    if math.isinf(value):
        return "INFINITY" if value > 0 else "(-INFINITY)"
    text = "NAN" if math.isnan(value) else repr(float(value))
    return f"({text})" if value < 0 else text
