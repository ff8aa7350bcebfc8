"""`kill -9` of loop, Python and drive in real time: is the torque gone, and is the black box whole?"""

import os
import signal
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from hardware_drives import PATIENT, STEP, drive, kept, lively, over

from cosim.hardware.blackbox import read_black_box
from cosim.hardware.loops import Forked
from cosim.hardware.machine import Machine, changed
from cosim.hardware.session import Session
from cosim.hardware.virtual import VirtualDrive
from cosim.support.errors import HardwareError


def kills(trials: int) -> dict[str, Any]:
    """Kill each process so many times; what was left."""
    given = changed(PATIENT, "benchmark", reactions=PATIENT.reactions.model_dump() | {"heartbeat_ms": 200.0})
    found: dict[str, list[dict[str, Any]]] = {"loop": [], "Python": [], "drive": []}
    with tempfile.TemporaryDirectory() as folder:
        box = Path(folder) / "box"
        for _ in range(trials):
            for name, kill in (("loop", kill_loop), ("Python", kill_python), ("drive", kill_drive)):
                found[name].append(in_operation(kill, box, given))
    return {
        "watchdog_ms": given.watchdog_ms,
        "heartbeat_ms": given.reactions.heartbeat_ms,
        "lost_cycles": given.reactions.lost_cycles,
        **{name: summary(ones) for name, ones in found.items()},
    }


def summary(ones: list[dict[str, Any]]) -> dict[str, Any]:
    zero = [one["ms_to_zero"] for one in ones]
    return {
        "trials": len(ones),
        "torque_zero": sum(one["torque"] == 0 for one in ones),
        "whole_boxes": sum(one["torn"] == 0 and one["gaps"] == 0 for one in ones),
        "replayed": sum(one["replayed_bit_for_bit"] for one in ones),
        "ms_to_zero": {"median": float(np.median(zero)), "worst": max(zero)},
        "torque_taken": [min(one["taken"] for one in ones), max(one["taken"] for one in ones)],
    }


def operating(session: Session) -> None:
    """Bring a session into operation and let it follow for 0.1 s, to some torque."""
    for _ in range(200):
        with suppress(HardwareError):
            session.enable()
            if abs(session.track(1000).torque) > 1.0:
                return
    raise SystemExit("this computer is never in time for 0.1 s of operation")


def in_operation(kill: Callable[[Path, Machine], dict[str, Any]], box: Path, given: Machine) -> dict[str, Any]:
    """Kill until there was a torque to take away: this computer may have been late, and tripped, the moment before."""
    while not (found := kill(box, given))["taken"]:
        pass
    return found


def kill_loop(box: Path, given: Machine) -> dict[str, Any]:
    with (
        drive(given, lockstep=False) as there,
        Session(lively(5.0), over(there.url, given), box, force=True) as session,
    ):
        assert isinstance(session.loop, Forked)
        operating(session)
        trips, killed = there.virtual.trips, time.monotonic_ns()
        os.kill(session.loop.process, signal.SIGKILL)
        wait_for(lambda: there.drive.held == 0)
        torque, taken = abs(there.drive.held), abs(there.virtual.taken) if there.virtual.trips > trips else 0.0
        wait_for(lambda: not session.loop.alive)
    return kept(box) | {"torque": torque, "taken": taken, "ms_to_zero": (there.virtual.let_go - killed) / 1e6}


def kill_python(box: Path, given: Machine) -> dict[str, Any]:
    """Kill a supervisor; its loop must see that itself and leave."""
    with drive(given, lockstep=False) as there:
        child, loop = forked(lambda write: supervise(there, box, given, write))
        taken, killed = abs(there.drive.held), time.monotonic_ns()
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        wait_for(lambda: there.drive.held == 0)
        zero = time.monotonic_ns()
        wait_for(lambda: not Path(f"/proc/{loop}").exists())
        torque = abs(there.drive.held)
    return kept(box) | {"torque": torque, "taken": taken, "ms_to_zero": (zero - killed) / 1e6}


def supervise(there: VirtualDrive, box: Path, given: Machine, write: int) -> None:
    """Bring a session into operation, say so by the number of its loop's process, and keep it there."""
    with Session(lively(30.0), over(there.url, given), box, force=True) as session:
        assert isinstance(session.loop, Forked)
        operating(session)
        os.write(write, f"{session.loop.process}\n".encode())
        while True:
            session.advance(1000)


def serve(given: Machine, write: int) -> None:
    """Be a drive, and say at which port."""
    with drive(given, lockstep=False) as there:
        os.write(write, f"{there.port}\n".encode())
        while True:
            time.sleep(1)


def forked(work: Callable[[int], None]) -> tuple[int, int]:
    """Start a process that writes one number; return its own and that."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        work(write)
    number = int(os.read(read, 64))
    os.close(read)
    os.close(write)
    return child, number


def kill_drive(box: Path, given: Machine) -> dict[str, Any]:
    """Kill a drive; the loop must order zero, and the next drive at that port starts without torque."""
    child, port = forked(lambda write: serve(given, write))
    with Session(lively(5.0), over(f"udp://127.0.0.1:{port}", given), box, force=True) as session:
        operating(session)
        taken = abs(session.status.torque)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        wait_for(lambda: not session.advance(1).running)
        ordered = abs(session.advance(4).torque)
    with drive(given, lockstep=False, port=port) as again:
        held = abs(again.drive.held)
    return kept(box) | {"torque": max(ordered, held), "taken": taken, "ms_to_zero": 1e3 * silence(box)}


def silence(box: Path) -> float:
    """Return the time from the last answer of a drive to the first order of zero after it [s]."""
    records = read_black_box(box).records
    tick, answered = records["sample"]["tick"], np.flatnonzero(records["sample"]["read"] == 0)[-1]
    zero = answered + np.flatnonzero(records["torque"][answered:] == 0)[0]
    return float(tick[zero] - tick[answered]) * STEP


def wait_for(condition: Callable[[], bool], seconds: float = 10.0) -> None:
    last = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > last:
            raise SystemExit("what should follow a kill did not follow within 10 s")
        time.sleep(2e-4)
