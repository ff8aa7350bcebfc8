"""A drive that follows motions: the controller of the scenario in the hardware loop, in the limits of a machine file.

Each motion is a session of its own: enabled, followed to its end, brought to rest. Its black box stays beside the
recording. A session that ends in a fault ends the investigation; what was recorded until then is kept.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from cosim.data.recording import Recording
from cosim.hardware.blackbox import read_black_box, recording_of
from cosim.hardware.machine import Machine as Hardware
from cosim.hardware.session import Session, run_session
from cosim.hardware.words import ENTERED
from cosim.models.cache import with_fmus
from cosim.support.errors import HardwareError
from cosim.support.scratch import Scratch
from cosim_investigation.limits import Limits
from cosim_investigation.machine import CoSimulated
from cosim_investigation.motions import Motion

CYCLES = 100
"""Cycles of the loop in which the position at rest is read."""
RATE = 500.0
"""Rows a second, at most, of a recording that is diagnosed [Hz]; the black box keeps every cycle."""
COLUMNS = ("q_d",)
"""What the controller is told that a diagnosis reads, beside torque and position."""


@dataclass(frozen=True)
class Driven:
    """An axis behind a machine file: simulated, a virtual drive over UDP, or a drive of your own."""

    loop: CoSimulated
    hardware: Hardware
    fast: bool = False
    """Without a clock."""
    limits: Limits | None = None
    """Limits by which the loop's own are tightened."""

    @cached_property
    def home(self) -> float:
        """Where the axis stands before the first motion; every motion ends there."""
        with Scratch() as folder:
            path = Path(folder) / "box"
            with Session(with_fmus(self.loop.scenario), self.hardware, path, fast=self.fast) as session:
                session.advance(CYCLES)
            return float(recording_of(read_black_box(path), "rest")["q"][-1])

    def within(self, limits: Limits) -> Limits:
        """Limits of a motion that keep to the machine file's too."""
        own = self.hardware.limits
        return limits.tightened(own.speed, own.torque)

    def record(self, motion: Motion, number: int, path: Path) -> Recording:
        """Run one session.

        Raises:
            HardwareError: it ended in a fault; its recording and black box are kept.
        """
        path.parent.mkdir(parents=True, exist_ok=True)
        box = path.with_suffix(".box")
        scenario = with_fmus(self.loop.follows(motion, self.home))
        with Session(scenario, self.hardware, box, fast=self.fast) as session:
            self._tighten(session)
            done = run_session(session)
        thinned(recording_of(read_black_box(box), motion.family), RATE).write(path)
        ended = ", ".join(done["faults"]) or ("" if done["completed"] else str(done["state"]))
        if ended:
            message = f"{self.hardware.name} ended in {ended} on {motion.title}; nothing more was moved."
            raise HardwareError(message, culprit=self.hardware.name, value=ended)
        return Recording.read(path)

    def _tighten(self, session: Session) -> None:
        """Let the loop itself hold the torque, and stop at the speed, that the investigation may use."""
        for name in ("torque", "speed") if self.limits else ():
            session.tighten(name, min(getattr(self.limits, name), getattr(self.hardware.limits, name)))
            session.advance(2)


def thinned(found: Recording, rate: float) -> Recording:
    """What a diagnosis reads, from the first cycle of the controller on: torque as the mean over a row."""
    entered = int(np.flatnonzero(found["machine.notes"].astype(int) & ENTERED)[0])
    step = max(1, round(1 / (rate * found.sample_time)))
    rows = np.arange(entered + step, len(found) - step, step)
    total = np.concatenate([[0.0], np.cumsum(found["tau"])])
    half = step / 2
    edges = np.arange(len(total)) - 0.5  # a cycle's torque is the mean over the interval around its time
    mean = (np.interp(rows + half, edges, total) - np.interp(rows - half, edges, total)) / step
    table = {"t": found.t[rows] - found.t[entered], "tau": mean, "q": found["q"][rows]}
    table |= {name: found[name][rows] for name in COLUMNS if name in found}
    return Recording(found.name, table, {name: unit for name, unit in found.units.items() if name in table}, {})


__all__ = ["Driven", "thinned"]
