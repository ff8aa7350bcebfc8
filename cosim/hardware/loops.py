"""Three ways to run the compiled loop: called for some cycles, in a process of its own, in a thread of this one.

`Called` has no clock. In real time the loop is a process of its own, `Forked`: it shares session, axis and black box
with this one and outlives it, so that a supervisor that dies leaves a loop that notices. `Threaded` is for adapters
written in Python, which need the interpreter.
"""

import os
import signal
from threading import Thread
from time import sleep
from typing import Protocol

from cosim.hardware.library import library
from cosim.hardware.structures import CSample, CSession
from cosim.support.errors import HardwareError

POLL = 0.002
"""Seconds between two looks at a loop in real time."""


class Loop(Protocol):
    """A loop: `start` it, let it `go` (on) for at most some cycles, `stop` it; then no torque is ordered."""

    def start(self) -> None:
        """Begin."""

    def go(self, cycles: int) -> None:
        """Return after at most so many cycles of a loop without a clock, or a short while of one with."""

    def stop(self) -> None:
        """End, with a last order of no voltage."""

    @property
    def alive(self) -> bool:
        """Whether cycles still come."""


class Called:
    """The loop without a clock: its cycles pass while it is called."""

    alive = True

    def __init__(self, session: CSession, sample: CSample) -> None:
        self._session, self._sample = session, sample

    def start(self) -> None:
        """Nothing begins by itself."""

    def go(self, cycles: int) -> None:
        """Run so many cycles."""
        library().hardware_run(self._session, self._sample, cycles)

    def stop(self) -> None:
        """Order no torque."""
        library().hardware_release(self._session)


class Threaded(Called):
    """The loop in a thread of this process: for slow adapters that need Python."""

    def start(self) -> None:
        """Start the thread."""
        arguments = (self._session, self._sample, 2**62)
        self._thread = Thread(target=library().hardware_run, args=arguments)
        self._thread.start()

    def go(self, cycles: int) -> None:
        """Wait a little."""
        sleep(POLL)

    def stop(self) -> None:
        """Let the thread end, then order no torque."""
        self._session.stop = 1
        self._thread.join()
        super().stop()


class Forked:
    """The loop in a process of its own; it orders no torque as the last thing it does."""

    def __init__(self, session: CSession, sample: CSample) -> None:
        self._session, self._sample = session, sample
        self.process = 0
        self._ended: int | None = None

    def start(self) -> None:
        """Fork."""
        self.process = library().hardware_spawn(self._session, self._sample)
        if self.process < 0:
            raise HardwareError("The system refused a process for the loop.")

    @property
    def alive(self) -> bool:
        """Whether the process is there."""
        if self._ended is None:
            pid, status = os.waitpid(self.process, os.WNOHANG)
            self._ended = os.waitstatus_to_exitcode(status) if pid else None
        return self._ended is None

    def go(self, cycles: int) -> None:
        """Wait a little.

        Raises:
            HardwareError: the process is gone.
        """
        if not self.alive:
            how = f"by signal {signal.Signals(-self._ended).name}" if self._ended and self._ended < 0 else "by itself"
            message = f"The process of the loop has ended {how}; the drive's watchdog takes the torque away."
            raise HardwareError(message, value=self._ended)
        sleep(POLL)

    def stop(self) -> None:
        """Let it end; where it has been killed, order no torque in its place."""
        self._session.stop = 1
        if self.alive:
            _, status = os.waitpid(self.process, 0)
            self._ended = os.waitstatus_to_exitcode(status)
        if self._ended:
            library().hardware_release(self._session)


LONGEST_CYCLE = 10.0
"""A loop in real time goes round at least so often [s]: no drive waits longer for an order."""


def period_of(step: float) -> int:
    """Return the cycle of a step [s] in ns.

    Raises:
        HardwareError: no clock goes by such steps.
    """
    if not 1e-6 <= step <= LONGEST_CYCLE:
        message = f"step {step:g} s: a loop in real time has cycles of 1e-06 s to {LONGEST_CYCLE:g} s."
        raise HardwareError(message, culprit="step", value=step)
    return round(step * 1e9)


def bare_clock(step: float, spin_us: float, seconds: float) -> tuple[int, int, float]:
    """Run the clock of a loop, and nothing else, in a thread: what a loop on this computer can hope for.

    Returns:
        Edges in all, those that were missed, and the worst wake-up in us.
    """
    session = CSession(period=period_of(step), spin=round(spin_us * 1000))
    thread = Thread(target=library().hardware_bare, args=(session, round(seconds / step)))
    thread.start()
    thread.join()
    return int(session.tick), int(session.late), session.worst / 1000
