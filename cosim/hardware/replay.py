"""The recorded samples through the same controller and the same loop: the recording again, bit for bit.

Samples go from the recording into the loop; what comes out of it is made into a recording as after the session, and
each of its columns is compared with that of the file. So is the file with its seal (`story`).
"""

from contextlib import ExitStack
from ctypes import POINTER
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosim.data.recording import Recording
from cosim.hardware.axis import make_axis
from cosim.hardware.blackbox import Kept, recording_of
from cosim.hardware.library import library
from cosim.hardware.story import Story, broken_seal, story_in
from cosim.hardware.structures import HEADS, RECORD, CRecord
from cosim.hardware.wired import Wired
from cosim.master.exchange import open_fmu
from cosim.support.errors import HardwareError
from cosim.support.files import cache_home, sha256

FEEDBACK = ("counts", "encoder", "statusword", "torque", "link")
SAMPLE = ("tick", "read", "status", "late", "request", "change", "value")
"""Columns that go into the loop."""
MADE = {"machine.order": "torque", "machine.command": "command", "machine.state": "state"}
MADE |= {"machine.faults": "faults", "machine.notes": "notes", "machine.controlword": "controlword"}
"""Columns that come out of it, and their fields of a record."""
LAST = 2**53
"""Last of the cycles that are counted exactly."""


@dataclass(frozen=True)
class Replay:
    """What came out.

    Cycles compared, cycles of the controller, how many differ by column, the tick of the first that does (-1: none),
    what else shows that the file is not the one that was written, and the hash of the controller.
    """

    cycles: int
    stepped: int
    different: dict[str, int]
    first: int
    noticed: str
    controller: str

    @property
    def identical(self) -> bool:
        """Whether every bit of every column is the recorded one, and the file is whole."""
        return not any(self.different.values()) and not self.noticed


def replay(recording: Recording, controller: Path | None = None) -> Replay:
    """Take the samples of a recorded session through its controller.

    Args:
        recording: of `cosim hardware run`.
        controller: its FMU; where not given it is looked for in the cache, by the hash that the recording states.

    Raises:
        HardwareError: it is no recording of a session, does not begin with it, or its controller is gone or another.
    """
    story = story_in(recording)
    made = _records(recording, story)
    _check_ticks(recording, made["sample"]["tick"], made["sample"]["late"])
    with ExitStack() as stack:
        wired = _wired(story, controller or find_controller(story), stack)
        axis, _kept = make_axis(wired, story.machine, story.step)
        library().hardware_replay(axis, made.ctypes.data_as(POINTER(CRecord)), len(made))
    again = recording_of(Kept(made, 0, story.model_dump()), recording.name)
    wrong = {name: _differs(recording, again, name) for name in dict.fromkeys((*again, *recording))}
    rows = np.flatnonzero(np.logical_or.reduce(list(wrong.values())))
    return Replay(
        cycles=len(made),
        stepped=int(np.count_nonzero(made["notes"] & 2)),
        different={name: int(np.count_nonzero(one)) for name, one in wrong.items()},
        first=int(made["sample"]["tick"][rows[0]]) if len(rows) else -1,
        noticed=broken_seal(recording),
        controller=story.controller.sha256,
    )


def find_controller(story: Story) -> Path:
    """Find the controller of a session in the cache, by its content alone.

    Raises:
        HardwareError: it is not there.
    """
    folder, wanted = cache_home() / "fmus", story.controller
    files = sorted(folder.glob("*.fmu"), key=lambda one: one.name != wanted.file)  # the one of that name first
    for path in files:
        if sha256(path) == wanted.sha256:
            return path
    cards = ", ".join(sorted({said.card for said in story.cards.values()}))
    built = f"; it was built from {cards}" if cards else ""
    message = f"The controller of the session (SHA-256 {wanted.sha256[:16]}...) is not in the cache{built}."
    raise HardwareError(f"{message} Give it by --controller, or its card by --card.", culprit=wanted.sha256)


def _differs(recording: Recording, again: Recording, name: str) -> np.ndarray:
    """Return by row whether a column is another; a column that only one of them has differs in all rows."""
    if name not in recording or name not in again:
        return np.ones(len(again), dtype=bool)
    found: np.ndarray = _bits(recording[name]) != _bits(again[name])
    return found


def _bits(column: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(column, dtype=np.float64).view(np.uint64)


def _records(recording: Recording, story: Story) -> np.ndarray:
    """Return the records that a recording is of; a number that a field cannot hold becomes 0, and so differs."""
    heads = [f"head{head}" for head in range(HEADS)] if story.machine.encoder.heads else []
    names = [f"machine.{key}" for key in (*FEEDBACK, *SAMPLE, *heads, *(["heads", "left_out"] if heads else []))]
    inputs = {place: name for place, name in enumerate(story.inputs) if name != story.encoder}
    missing = [name for name in (*names, *MADE, *inputs.values()) if name not in recording]
    if missing:
        message = f"{recording.name} is no whole recording of a session: it has no column {', '.join(missing)}."
        raise HardwareError(message, culprit=missing[0])
    records = np.zeros(len(recording), RECORD)
    sample, feedback = records["sample"], records["sample"]["feedback"]
    for key in FEEDBACK:
        feedback[key] = _exact(recording[f"machine.{key}"], feedback[key].dtype)
    for key in SAMPLE:
        sample[key] = _exact(recording[f"machine.{key}"], sample[key].dtype)
    for head, name in enumerate(heads):
        feedback["head"][:, head] = _exact(recording[f"machine.{name}"], feedback["head"].dtype)
    if heads:
        feedback["heads"] = _exact(recording["machine.heads"], feedback["heads"].dtype)
    for place, name in inputs.items():
        sample["input"][:, place] = recording[name]
    return records


def _exact(column: np.ndarray, kind: Any) -> np.ndarray:
    """Return a column as a field of a record holds it; 0 where it holds no such number."""
    if kind == np.float64:
        return column
    limits = np.iinfo(kind)
    fits = np.isfinite(column) & (column == np.floor(column))
    fits &= (column >= limits.min) & (column <= min(limits.max, LAST))
    return np.where(fits, column, 0).astype(kind)


def _check_ticks(recording: Recording, tick: np.ndarray, late: np.ndarray) -> None:
    """Refuse a recording whose cycles do not begin with the session, or do not follow each other."""
    if not len(tick):
        raise HardwareError(f"{recording.name} has no cycles.", culprit=recording.name)
    first = int(tick[0])
    if first != late[0]:  # a session that wakes late begins with the cycles it missed
        message = f"{recording.name} begins at cycle {first:,}: its black box had room for the end of the session only."
        raise HardwareError(message, culprit=recording.name, value=first)
    gaps = np.flatnonzero(np.diff(tick) != 1 + late[1:].astype(np.int64))
    if len(gaps):
        row = int(gaps[0]) + 1
        message = f"{recording.name} was altered: cycle {int(tick[row]):,} follows cycle {int(tick[row - 1]):,}."
        raise HardwareError(message, culprit="machine.tick", value=int(tick[row]))


def _wired(story: Story, path: Path, stack: ExitStack) -> Wired:
    if not path.is_file():
        raise HardwareError(f"{path}: there is no such controller.", culprit=str(path))
    if sha256(path) != story.controller.sha256:
        raise HardwareError(f"{path} is another controller than that of the session.", culprit=str(path))
    controller = stack.enter_context(open_fmu(path, "controller"))
    for name in (*story.inputs, story.output):
        if name not in controller.ports:
            raise HardwareError(f'The controller of the session has no "{name}".', culprit=name)
    controller.start(story.controller.parameters)
    return Wired(
        controller=controller,
        plant=controller,
        inputs=tuple(story.inputs),
        encoder=story.encoder,
        command=story.output,
        torque="",
        position="",
        quantum=story.quantum,
        setpoints=np.zeros((0, 0)),
        units=story.units,
    )
