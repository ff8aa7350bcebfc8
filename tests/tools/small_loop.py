"""Texts of scenarios: any from its tables, and a loop of two small FMUs."""

import json
from typing import Any

TEXT = """
name = "loop"
step = 1e-3
stop = 0.5
[components.plant]
fmu = "tiny3.fmu"
[components.controller]
fmu = "tiny2.fmu"
parameters = { mode = 1.0, k = 5.0 }
[signals.r]
kind = "sine"
frequency = 2.0
amplitude = 0.1
smooth_start = 0.1
[signals.n]
kind = "noise"
rms = 1e-3
seed = 7
[[connections]]
from = "controller.y"
to = "plant.a"
[[connections]]
from = "plant.y"
to = "controller.b"
gain = 2.0
quantum = 1e-6
noise = "n"
[[connections]]
from = "r.position"
to = "controller.a"
[record]
signals = { q = "plant.y", tau = { signal = "plant.a", mode = "mean" }, q_d = "r.position" }
decimation = 2
"""


def toml(value: Any) -> str:
    """Write a value in one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {toml(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value if isinstance(value, int | float | str) else str(value), ensure_ascii=False)


def text_of(wires: dict[str, Any], **tables: Any) -> str:
    """The text of a scenario: by their targets, what wires come from or say; and its other tables."""
    connections = [{"to": end} | (one if isinstance(one, dict) else {"from": one}) for end, one in wires.items()]
    return "\n".join(f"{key} = {toml(value)}" for key, value in (tables | {"connections": connections}).items())
