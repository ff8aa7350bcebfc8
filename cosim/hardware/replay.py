"""The recorded samples through the same controller and the same loop: the recorded orders, bit for bit."""

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import HardwareError
from cosim.exchange import open_fmu
from cosim.files import sha256
from cosim.hardware.axis import make_axis
from cosim.hardware.library import library
from cosim.hardware.machine import Machine
from cosim.hardware.structures import HEADS, RECORD, CRecord
from cosim.hardware.wired import Wired
from cosim.recording import Recording

COMPARED = {"machine.order": "torque", "machine.command": "command", "machine.state": "state"}
COMPARED |= {"machine.faults": "faults", "machine.notes": "notes", "machine.controlword": "controlword"}
"""Columns that must come out again, and their fields of a record."""


@dataclass(frozen=True)
class Replay:
    """What came out: cycles compared, how many differ by column, and the tick of the first that does (-1: none)."""

    cycles: int
    stepped: int
    different: dict[str, int]
    first: int

    @property
    def identical(self) -> bool:
        """Whether every bit of every order is the recorded one."""
        return not any(self.different.values())


def replay(recording: Recording) -> Replay:
    """Take the samples of a recorded session through its controller.

    Raises:
        HardwareError: it is no recording of a session, does not begin with it, or its controller is gone or another.
    """
    origin = _origin(recording)
    given = _records(recording, origin)
    made = given.copy()
    with ExitStack() as stack:
        wired = _wired(origin, stack)
        axis, _kept = make_axis(wired, Machine.model_validate(origin["machine"]), origin["step"])
        library().hardware_replay(axis, made.ctypes.data_as(_pointer()), len(made))
    wrong = {name: _bits(given[field]) != _bits(made[field]) for name, field in COMPARED.items()}
    rows = np.flatnonzero(np.logical_or.reduce(list(wrong.values())))
    return Replay(
        cycles=len(made),
        stepped=int(np.count_nonzero(made["notes"] & 2)),
        different={name: int(np.count_nonzero(one)) for name, one in wrong.items()},
        first=int(made["sample"]["tick"][rows[0]]) if len(rows) else -1,
    )


def _pointer() -> Any:
    from ctypes import POINTER

    return POINTER(CRecord)


def _bits(column: np.ndarray) -> np.ndarray:
    column = np.ascontiguousarray(column)
    return column.view(np.uint64) if column.dtype == np.float64 else column


def _origin(recording: Recording) -> dict[str, Any]:
    origin = recording.origin.get("hardware")
    missing = [name for name in (*COMPARED, "machine.tick", "machine.late", "machine.counts") if name not in recording]
    if not isinstance(origin, dict) or missing:
        message = f"{recording.name} is no recording of `cosim hardware run`, which keeps what a replay needs."
        raise HardwareError(message, culprit=recording.name)
    first = int(recording["machine.tick"][0])
    if first != recording["machine.late"][0]:  # a session that wakes late begins with the cycles it missed
        message = f"{recording.name} begins at cycle {first:,}: its black box had room for the end of the session only."
        raise HardwareError(message, culprit=recording.name, value=first)
    return origin


def _records(recording: Recording, origin: dict[str, Any]) -> np.ndarray:
    records = np.zeros(len(recording), RECORD)
    sample, feedback = records["sample"], records["sample"]["feedback"]
    for key in ("counts", "encoder", "statusword", "torque"):
        feedback[key] = recording[f"machine.{key}"]
    for key in ("tick", "read", "status", "late", "request", "change", "value"):
        sample[key] = recording[f"machine.{key}"]
    if origin["machine"]["encoder"]["heads"]:
        feedback["heads"], records["heads"] = recording["machine.heads"], recording["machine.left_out"]
        for head in range(HEADS):
            feedback["head"][:, head] = recording[f"machine.head{head}"]
    for name, field in COMPARED.items():
        records[field] = recording[name]
    for place, name in enumerate(origin["inputs"]):
        if name != origin["encoder"]:
            sample["input"][:, place] = recording[name]
    return records


def _wired(origin: dict[str, Any], stack: ExitStack) -> Wired:
    stated = origin["controller"]
    path = Path(stated["path"])
    if not path.is_file():
        raise HardwareError(f"The controller of the session, {path}, is not there any more.", culprit=str(path))
    if sha256(path) != stated["sha256"]:
        raise HardwareError(f"{path} is another controller than that of the session.", culprit=str(path))
    controller = stack.enter_context(open_fmu(path, "controller"))
    controller.start(stated["parameters"])
    return Wired(
        controller=controller,
        plant=controller,
        inputs=tuple(origin["inputs"]),
        encoder=origin["encoder"],
        command=origin["output"],
        torque="",
        position="",
        quantum=origin["quantum"],
        setpoints=np.zeros((0, 0)),
        units=origin["units"],
    )
