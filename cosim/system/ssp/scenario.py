"""The text of the scenario that an SSP means."""

import json
from collections.abc import Mapping
from pathlib import Path as File
from typing import Any

from cosim.system.ssp.interpretation import Interpretation
from cosim.system.ssp.structure import Path, Structure

_INTERFACES = {"CoSimulation": {"interface": "co-simulation"}, "ModelExchange": {"interface": "model-exchange"}}


def scenario_of(structure: Structure, files: Mapping[Path, File]) -> str:
    """Write the scenario; `files` are the FMUs by their element."""
    interpretation = Interpretation(structure, files)
    start, stop, step, assumed = interpretation.experiment()
    described = structure.nodes[()].element.get("description", "").rstrip(".")
    head: dict[str, Any] = {
        "name": structure.file.root.get("name") or "system",
        "description": f"{described}." if described else "",
    }
    parameters = {path: interpretation.parameters(path) for path in structure.components}
    lacking, nowhere = interpretation.unknown()
    said = [*filter(None, [assumed]), *structure.notes]
    said += [f"Not set, because their FMUs do not have them: {', '.join(lacking)}."] if lacking else []
    said += [f"Not set, because no element has these names: {', '.join(nowhere)}."] if nowhere else []
    head |= {"notes": said} if said else {}
    lines = _table("", head | ({"start": start} if start else {}) | {"step": step, "stop": stop})
    for path, node in structure.components.items():
        name = _text(interpretation.names[path])
        interface = _INTERFACES.get(node.element.get("implementation", ""), {})
        lines += _table(f"[components.{name}]", {"fmu": str(files[path])} | interface)
        lines += _table(f"[components.{name}.parameters]", parameters[path])
        for variable, stated in interpretation.units(path).items():
            lines += _table(f"[components.{name}.variables.{_text(variable)}]", {"name": variable, "unit": stated})
    for wire in interpretation.wires():
        lines += _table("[[connections]]", wire)
    return "\n".join(lines + _table("[record.signals]", interpretation.records())) + "\n"


def _table(head: str, values: Mapping[str, Any]) -> list[str]:
    rows = [f"{_text(key)} = {_text(value)}" for key, value in values.items()]
    return ["", head, *rows] if head else rows


def _text(value: Any) -> str:
    """Write a value as TOML, which reads JSON's strings and Python's floats (DEL must be escaped)."""
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_text(key)} = {_text(one)}' for key, one in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(_text(one) for one in value)}]"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
