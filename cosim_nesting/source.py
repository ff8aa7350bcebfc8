"""The plan of a system as C: constant tables that the binary of its FMU copies from (see c/nest.h)."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from cosim.system.plan import Balance, Gather, Iterate, Link, Part, PlannedStage, Step
from cosim_nesting.prepared import Prepared, Told
from cosim_nesting.variables import Shown
from pyfmi_models.export.c_code import number

_KINDS = {Gather: "GATHER", Step: "LOOP_STEP", Iterate: "ITERATE", Balance: "BALANCE"}
_PLAIN = {"GATHER": 0, "LOOP_STEP": 1, "ITERATE": 2, "BALANCE": 3}
_TABLE = 2


def system_c(prepared: Prepared, shown: Sequence[Shown], columns: Sequence[int]) -> str:
    """Write system.c; `columns` are those of the signals in signals.bin, -1 where one is constant."""
    lines: list[str] = []
    tables = _wiring(prepared, lines) | _stages(prepared)
    tables["setting"] = "Setting", [_setting(lines, k, one) for k, one in enumerate(prepared.given)]
    tables["begin"] = "Start", [_start(lines, k, one) for k, one in enumerate(prepared.starts)]
    tables["start"] = "double", [number(float(one)) for one in prepared.bus]
    first = zip(prepared.signals, columns, strict=True)
    tables["constant"] = "double", [number(float(row[0])) if column < 0 else "0" for row, column in first]
    tables["column"] = "int", list(map(str, columns))
    tables["meaning"] = "Meaning", [f"{{{one.part}, {one.reference}}}" for one in shown]
    numbers = {"ticks": prepared.ticks, "signals": len(columns), "varying": sum(one >= 0 for one in columns)}
    numbers["limited"] = int(prepared.limited)
    numbers |= {"bus": len(prepared.bus), "signal": prepared.plan.signal}
    numbers |= {count: len(tables[table][1]) for count, table in _COUNTED.items()}
    fields = [f"    .step = {number(prepared.plan.step)},", *(f"    .{name} = {n}," for name, n in numbers.items())]
    fields += [f"    .{name} = {name}_table," for name in tables]
    arrays = [_array(kind, f"{name}_table", items) for name, (kind, items) in tables.items()]
    head = ["/* Generated: the plan of a system. */", '#include "nest.h"', ""]
    return "\n".join([*head, *lines, *arrays, "", "const System nested = {", *fields, "};", ""])


_COUNTED = {
    "parts": "piece",
    "wires": "wire",
    "stages": "stage",
    "settings": "setting",
    "starts": "begin",
    "all_faults": "fault",
    "inners": "inner",
    "bonds": "bond",
}
"""Fields of `System` in nest.h that say how long a table is."""
_Tables = dict[str, tuple[str, list[str]]]
"""By field of `System`: type and entries."""


def _wiring(prepared: Prepared, lines: list[str]) -> _Tables:
    """Components, wires, and faults of wires."""
    pieces: list[str] = []
    wires: list[str] = []
    faults: list[str] = []
    of_wires: list[str] = []
    for index, part in enumerate(prepared.plan.parts):
        for name, references in (("in", part.input_references), ("out", part.output_references)):
            lines.append(_array("uint32_t", f"{name}_{index}", map(str, references.tolist())))
        pieces.append(_piece(prepared, index, part, len(wires)))
        for link in part.links:
            wires.append(_wire(link))
            of_wires += [str(len(faults)), str(len(broken := _faults(link)))]
            faults += broken
    tables = {"piece": ("Piece", pieces), "wire": ("Wire", wires)}
    return tables | {"fault": ("Fault", faults), "faults": ("int", of_wires)}


def model_c(prepared: Prepared, shown: Sequence[Shown], token: str) -> str:
    """Write model.c: the table of variables, through which the functions of FMI know them."""
    rows = ['    {"time", TIME, 0, (-INFINITY), INFINITY, 0, 0}']
    rows += [
        f"    {{{json.dumps(one.name)}, {one.kind}, {number(one.start)}, (-INFINITY), INFINITY, 0, {k}}}"
        for k, one in enumerate(shown, 1)
    ]
    counts = {kind: sum(one.kind == kind for one in shown) for kind in ("INPUT", "PARAMETER", "OUTPUT")}
    text = ",\n".join(rows)
    return f"""/* Generated: the variables of the system. */
#include "model.h"

#include <math.h>

static const Variable variables[] = {{
{text}
}};

const Model model = {{
    .token = "{token}",
    .tolerance = 1e-6,
    .size = {len(rows)},
    .inputs = {counts["INPUT"]}, .parameters = {counts["PARAMETER"]}, .outputs = {counts["OUTPUT"]},
    .table = variables,
}};
"""


def signal_columns(signals: np.ndarray) -> list[int]:
    """Return of each signal its column in the table of those that vary, -1 where it is constant."""
    varies = [bool(np.any(row != row[0])) for row in signals]
    return [sum(varies[:k]) if one else -1 for k, one in enumerate(varies)]


def signal_bytes(signals: np.ndarray, columns: Sequence[int]) -> bytes:
    """Write the varying signals tick by tick, as doubles of little-endian machines."""
    varying = signals[[k for k, column in enumerate(columns) if column >= 0]]
    return np.ascontiguousarray(varying.T, dtype="<f8").tobytes()


def folder_of(index: int) -> str:
    """Folder of a component in resources/parts."""
    return str(index)


def _array(kind: str, name: str, items: Iterable[str]) -> str:
    """A constant table, never empty."""
    listed = list(items) or ["0" if kind in ("double", "int", "uint32_t") else "{0}"]
    return f"static const {kind} {name}[] = {{{', '.join(listed)}}};"


def _piece(prepared: Prepared, index: int, part: Part, first: int) -> str:
    fmu, binary = prepared.components[index], prepared.binaries[index]
    words = (part.name, folder_of(index), binary.path, binary.token)
    texts = ", ".join(map(json.dumps, words))
    numbers = [fmu.version, int(fmu.can_get_and_set_state), part.every, part.input, len(part.input_references)]
    numbers += [part.output, len(part.output_references), first, len(part.links)]
    return f"{{{texts}, {', '.join(map(str, numbers))}, in_{index}, out_{index}}}"


def _wire(link: Link) -> str:
    numbers = ", ".join(map(number, (link.gain, link.offset, link.quantum)))
    return f"{{{link.source}, {link.target}, {link.noise}, {numbers}, 0, 0}}"


def _faults(link: Link) -> list[str]:
    table = [f"{{0, 0, 0, {_TABLE}, {number(a)}, {number(b)}, 0, 0}}" for a, b in link.table]
    return table + [
        f"{{{one.first}, {one.last}, {one.noise}, {int(one.freeze)}, {number(one.gain)}, {number(one.offset)}, 0, 0}}"
        for one in link.faults
    ]


def _stages(prepared: Prepared) -> _Tables:
    """Stages, the inner wires of all of them, their bonds."""
    parts = prepared.plan.parts
    first = [sum(len(part.links) for part in parts[:index]) for index in range(len(parts))]
    stages: list[str] = []
    inner: list[str] = []
    bonds: list[str] = []
    for stage in prepared.plan.stages:
        own = _coupled(stage)
        stages.append(own)
        if isinstance(stage, Iterate | Balance):
            inner += [f"{{.wire = {first[one.part] + one.link}, .back = {int(one.back)}}}" for one in stage.inner]
        if isinstance(stage, Balance):
            bonds += [f"{{{one}, {other}, 0}}" for one, other in stage.bonds]
    return {"stage": ("Stage", stages), "inner": ("Inner", inner), "bond": ("Bond", bonds)}


def _coupled(stage: PlannedStage) -> str:
    fields = [f".kind = {_PLAIN[_KINDS[type(stage)]]}", f".part = {stage.part}", f".parts = {stage.parts}"]
    if isinstance(stage, Iterate | Balance):
        fields += [f".inners = {len(stage.inner)}", f".tolerance = {number(stage.tolerance)}", f".most = {stage.most}"]
    if isinstance(stage, Balance):
        fields.append(f".bonds = {len(stage.bonds)}")
    if isinstance(stage, Iterate):
        fields.append(f".theta = {number(stage.theta)}")
    return f"{{{', '.join(fields)}}}"


def _start(lines: list[str], index: int, one: object) -> str:
    kind, part, places = one.kind, one.part, one.places  # type: ignore[attr-defined]
    lines.append(_array("int", f"places_{index}", map(str, places)))
    return f"{{{kind}, {part}, {len(places)}, places_{index}}}"


def _setting(lines: list[str], index: int, one: Told) -> str:
    texts = one.function == "SetString"
    values = [json.dumps(value) if texts else number(float(value)) for value in one.values]
    lines.append(_array("char *const" if texts else "double", f"values_{index}", values))
    where = ("NULL", f"values_{index}") if texts else (f"values_{index}", "NULL")
    head = f"{one.part}, {int(one.late)}, {json.dumps(one.function)}, {one.reference}, {len(values)}"
    return f"{{{head}, {where[0]}, {where[1]}}}"


C_FILES = Path(__file__).parent / "c"
"""The C around a plan."""
