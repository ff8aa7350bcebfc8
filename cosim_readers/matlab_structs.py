"""Structs of MAT files as columns: Simulink's logs, recordings of ControlDesk, and fields of any other.

Simulink, *Structure with time*: `time` and `signals`, each with `values` (rows, k) and a `label`. ControlDesk of
dSPACE: `X` and `Y`, arrays of structs with `Name`, `Data` and `Unit`. Of other structs the fields are columns, named by
their last part where it is unique in the file. Objects of MATLAB (table, timeseries, Dataset) only MATLAB can open.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

DEEPEST = 10
"""Structs inside structs that are looked into."""


@dataclass
class Found:
    """Arrays by path, their units, and the names of what only MATLAB can open."""

    arrays: dict[str, np.ndarray] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    objects: list[str] = field(default_factory=list)


def arrays_of(values: Mapping[str, Any]) -> Found:
    """Return the arrays in the variables of a MAT file by path, as SciPy gives them with `simplify_cells`."""
    found = Found()
    for name, value in values.items():
        if not name.startswith("__"):
            _walk(found, name, value, 0)
    return found


def _walk(found: Found, path: str, value: Any, depth: int) -> None:
    if isinstance(value, dict) and depth < DEEPEST:
        if "signals" in value and "time" in value:
            _simulink(found, path, value)
        elif _structs(value.get("X")) and _structs(value.get("Y")):
            _controldesk(found, value)
        else:
            for name, member in value.items():
                _walk(found, f"{path}.{name}", member, depth + 1)
    elif type(value).__name__ in ("MatlabOpaque", "MatlabFunction"):
        found.objects.append(path)
    elif not isinstance(value, dict | list | str):
        found.arrays[path] = np.asarray(value)


def _simulink(found: Found, path: str, value: Mapping[str, Any]) -> None:
    found.arrays[f"{path}.time"] = np.asarray(value["time"])
    for number, signal in enumerate(_structs(value["signals"]), 1):
        values = np.asarray(signal.get("values"))
        labels = [str(one) for one in np.ravel(np.asarray(signal.get("label", []), dtype=object)) if str(one)]
        lead = path if len(_structs(value["signals"])) == 1 else f"{path}_{number}"
        if values.ndim == 2 and len(labels) == values.shape[1]:
            found.arrays |= {f"{path}.{text}": values[:, k] for k, text in enumerate(labels)}
        else:
            found.arrays[f"{path}.{labels[0] if len(labels) == 1 else lead}"] = values


def _controldesk(found: Found, value: Mapping[str, Any]) -> None:
    time = _structs(value["X"])[0]
    found.arrays["time"] = np.asarray(time.get("Data"))
    found.units["time"] = "s"
    for number, signal in enumerate(_structs(value["Y"]), 1):
        name = str(signal.get("Name") or f"Y{number}").strip("'\"").replace(".", "_").replace("/", ".")
        found.arrays[name] = np.asarray(signal.get("Data"))
        if isinstance(unit := signal.get("Unit"), str) and unit:
            found.units[name] = unit


def _structs(value: Any) -> list[dict[str, Any]]:
    """Return a struct or an array of structs as a list; an empty one of anything else."""
    members: Iterator[Any] | list[Any] = [value] if isinstance(value, dict) else []
    if isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object):
        members = list(np.ravel(np.asarray(value, dtype=object))) if isinstance(value, np.ndarray) else value
    return [one for one in members if isinstance(one, dict)]
