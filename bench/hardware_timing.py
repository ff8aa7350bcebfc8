"""Time: a session in real time beside a bare clock, with and without UDP and a busy supervisor."""

import os
import signal
import subprocess
import sys
import tempfile
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from hardware_drives import PATIENT, STEP, kept, over, sidereal

from cosim.hardware.loops import bare_clock
from cosim.hardware.session import Session
from cosim.support.errors import HardwareError


@contextmanager
def drive_process() -> Iterator[str]:
    """A virtual drive in a process of its own; yields where it listens."""
    command = [
        sys.executable,
        "-m",
        "cosim",
        "hardware",
        "virtual-drive",
        "sidereal",
        "--machine",
        "virtual",
        "--port",
        "0",
    ]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    assert process.stderr is not None
    try:
        said = next(line for line in process.stderr if " listens at " in line)
        yield said.split(" at ")[1].split(",")[0]
    finally:
        process.send_signal(signal.SIGTERM)
        process.communicate()


def timing(seconds: float) -> dict[str, Any]:
    """Compare a session in real time with a bare clock."""
    load = os.getloadavg()
    with tempfile.TemporaryDirectory() as folder, drive_process() as url:
        box = Path(folder) / "box"
        whole = watched(url, box, seconds, busy=True)
        whole |= kept(box)
        rounds = [one_round(url, box, seconds / 6, turn) for turn in range(6)]
    shares = {name: [one[name] for one in rounds] for name in rounds[0]}
    mean = {name: float(np.mean(values)) for name, values in shares.items()}
    return {
        "whole": whole,
        "late_share": mean,
        "rounds": shares,
        "ratio_to_bare": mean["draining and plotting"] / mean["bare clock"] if mean["bare clock"] else None,
        "supervision_adds": mean["draining and plotting"] - mean["quiet supervisor"],
        "session_adds": mean["draining and plotting"] - mean["bare clock"],
        "load": load,
    }


def one_round(url: str, box: Path, seconds: float, turn: int) -> dict[str, float]:
    """Return the share of late cycles of each kind of loop, in an order that changes from round to round."""
    kinds: dict[str, Callable[[], float]] = {
        "bare clock": lambda: bare(seconds),
        "drive in the loop's process": lambda: watched("simulated", box, seconds, busy=False)["late_share"],
        "quiet supervisor": lambda: watched(url, box, seconds, busy=False)["late_share"],
        "draining and plotting": lambda: watched(url, box, seconds, busy=True)["late_share"],
    }
    names = list(kinds)[turn % 4 :] + list(kinds)[: turn % 4]
    found = {name: kinds[name]() for name in names}
    return {name: found[name] for name in kinds}


def bare(seconds: float) -> float:
    edges, late, _ = bare_clock(STEP, PATIENT.clock.spin_us, seconds)
    return late / edges


def watched(url: str, box: Path, seconds: float, busy: bool) -> dict[str, Any]:
    """Run a session for some seconds; where it trips it is enabled again, and that is counted."""
    trips: Counter[str] = Counter()
    supervisor, pictures = Supervisor(), 0
    with Session(sidereal(seconds + 5), over(url), box, force=True) as session:
        while session.statistics["cycles"] + session.statistics["late_cycles"] < seconds / STEP:
            if not session.status.running:
                trips.update(session.status.faults)
                with suppress(HardwareError):
                    session.enable()
            session.advance(1000)
            if busy:
                supervisor.take(session)
                pictures += 1
        statistics = session.statistics
        session.disable()
        supervisor.take(session)
    edges = statistics["cycles"] + statistics["late_cycles"]
    trips.pop("power_up", None)
    result = {"edges": edges, "late_share": statistics["late_cycles"] / edges, "trips": dict(trips), **statistics}
    return result | (
        {"drained": supervisor.drained, "missing": supervisor.missing, "pictures": pictures} if busy else {}
    )


class Supervisor:
    """Drains the black box and draws the last 2 s of torque and error, ten times a second."""

    def __init__(self) -> None:
        from matplotlib.figure import Figure

        self.drained = self.missing = self._last = 0
        self._recent: deque[np.ndarray] = deque(maxlen=20)
        self._panels = Figure(figsize=(8, 4)).subplots(2, 1)

    def take(self, session: Session) -> None:
        records = session.drain()
        if len(records):
            self.missing += int(records["sequence"][-1]) - self._last - len(records)
            self._last = int(records["sequence"][-1])
            self.drained += len(records)
            self._recent.append(records[::10].copy())
            self._draw(np.concatenate(self._recent))

    def _draw(self, records: np.ndarray) -> None:
        position = records["sample"]["feedback"]["counts"].astype(np.uint32).view(np.int32)
        for panel, column in zip(self._panels, (records["torque"], position), strict=True):
            panel.clear()
            panel.plot(records["sample"]["tick"] * STEP, column, lw=0.8)
        self._panels[0].figure.canvas.draw()
