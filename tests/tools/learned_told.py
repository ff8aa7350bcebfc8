"""What a diagnosis tells of something that it learned and that has no name."""

from typing import Any

import numpy as np

AT, BY = np.linspace(-1, 1, 24), [18.0, 22.0, 26.0]
DATA = {"at": AT.tolist(), "value": [None, *(0.3 * AT[1:] ** 2)], "band": [0.02] * 24}
CURVE = {
    "kind": "torque", "unit": "N.m", "over": "position", "data": DATA,
    "at": [-1.0, 0.0, 1.0], "value": [0.3, 0.0, 0.3],
}  # fmt: skip
MAP = {
    "kind": "friction", "unit": "1", "over": "position", "by": "temperature", "at": [-1.0, 0.0, 1.0], "by_at": BY,
    "value": [[0.3, 0.1, 0.0], [0.0, -0.2, 0.0], [0.3, 0.0, 0.1]],
    "data": {"at": [-0.5, 0.5], "by_at": [20.0, 24.0], "value": [[0.1, None], [0.1, 0.0]], "band": [[0.1] * 2] * 2},
}  # fmt: skip
DRIVE = {
    "kind": "drive", "unit": "N.m", "command": [-5.0, 0.0, 5.0], "missing": [-0.2, 0.0, 0.2],
    "data": {"at": AT.tolist(), "value": AT.tolist(), "band": [0.1] * 24},
}  # fmt: skip
MEMORY = {"kind": "hysteresis", "unit": "N.m", "strokes": [0.1], "torque": [0.4], "data": DATA}
TOLD: dict[str, Any] = {
    "quantities": ["position and temperature", "torque"], "size": 0.31, "table": [CURVE, MAP, DRIVE, MEMORY],
    "before": 0.42, "after": 0.15, "interval": [0.21, 0.33], "cutoff_hz": 10.0,
    "formula": [{
        "table": 0, "kind": "torque", "over": ["position"], "equation": "torque = k1 q³",
        "parameters": {"k1": {"value": 0.31, "interval": [0.29, 0.33], "unit": "N.m/rad3"}},
    }],
    "range": ["over position -1 to 1 rad", "over temperature 18 to 26 degC"],
    "statement": "Something that depends on position and temperature, and on torque, 0.31 N·m; modelled as a table.",
}  # fmt: skip
