"""A session: the controller of a scenario in the compiled loop, against an adapter.

    with Session(scenario, machine, path) as session:
        session.enable()
        session.track()
        session.disable()

`fast` lets the clock go: the same cycles in the same order, as fast as possible. In real time the loop runs in a
process of its own (loops.py); this one only watches, and its heartbeat keeps the torque on.
"""

import ctypes
from contextlib import ExitStack
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from time import perf_counter

import numpy as np

from cosim.hardware.axis import cycles_of, make_axis, story_of
from cosim.hardware.blackbox import BlackBox
from cosim.hardware.library import library, shared
from cosim.hardware.loops import Called, Forked, Loop, Threaded, period_of
from cosim.hardware.machine import Machine
from cosim.hardware.structures import CSample, CSession
from cosim.hardware.transport import Transport, open_transport
from cosim.hardware.wired import wire_up
from cosim.hardware.words import (
    ASK_ENABLE,
    ASK_ESTOP,
    ASK_QUICK_STOP,
    ASK_RESET,
    ENABLED,
    FAULT,
    LIMITS,
    QUICK_STOP_STATE,
    STATES,
    faults_of,
    heads_of,
)
from cosim.support.errors import HardwareError
from cosim.support.plain import JsonObject, Parsed
from cosim.system.scenario import Scenario


@dataclass(frozen=True)
class Status:
    """What the loop shows: cycle, state, latched faults, ordered torque [N m], cycles of the controller."""

    tick: int
    state: str
    faults: tuple[str, ...]
    torque: float
    running: bool
    ran: int


class Session:
    """A controller on a machine; see the module. It starts in fault, and nothing but `reset` leaves that.

    Args:
        scenario: with an FMU for each component; its plant is what the adapter replaces.
        machine: adapter, limits, reactions.
        path: the black box, a new file.
        fast: without a clock.
        force: overwrite the black box.
        origin: what else the black box shall say about where it comes from.

    Raises:
        HardwareError: scenario and machine do not fit; no torque was enabled.
    """

    def __init__(
        self,
        scenario: Scenario,
        machine: Machine,
        path: Path,
        *,
        fast: bool = False,
        force: bool = False,
        origin: JsonObject | None = None,
    ) -> None:
        self.scenario, self.machine, self._fast = scenario, machine, fast
        self._library, self._stack = library(), ExitStack()
        self._sample = shared(CSample())
        try:
            self.wired = wire_up(scenario, self._stack)
            self.axis, self._kept = make_axis(self.wired, machine, scenario.step)
            self.transport: Transport = open_transport(scenario, machine, self.wired, fast)
            self._stack.callback(self.transport.close)
            seconds = min(machine.black_box_seconds, scenario.stop + 10)
            story = story_of(scenario, machine, self.wired) | (origin or {})
            self._box = BlackBox(path, ceil(seconds / scenario.step), story, force)
        except BaseException:
            self._stack.close()
            raise
        self._stack.callback(self._box.close)
        self._session = shared(self._made())
        self.loop: Loop = self._kind()(self._session, self._sample)

    def __enter__(self) -> "Session":
        self.loop.start()
        return self

    def __exit__(self, *_: object) -> None:
        try:
            if self.loop.alive and self.axis.state in (ENABLED, QUICK_STOP_STATE):
                self.disable()
        finally:
            self.loop.stop()
            self._stack.close()

    @property
    def status(self) -> Status:
        """What the loop is doing now."""
        axis = self.axis
        faults = faults_of(axis.faults)
        return Status(self._session.tick, STATES[axis.state], faults, axis.torque, bool(axis.running), axis.ran)

    @property
    def statistics(self) -> JsonObject:
        """Cycles, those that were late, the worst wake-up, and what the system allowed."""
        session = self._session
        return {
            "cycles": session.tick - session.late,
            "late_cycles": session.late + session.waited,
            "worst_wake_up_us": session.worst / 1000,
            "real_time": not self._fast,
            "fifo": bool(session.fifo),
            "memory_locked": bool(session.locked),
            "refused_limits": self.axis.refused,
            **({"heads_left_out": heads_of(self.axis.heads.reasons)} if self.machine.encoder.heads else {}),
            **self.transport.statistics(),
        }

    def drain(self) -> np.ndarray:
        """Return the records of the cycles since the last call, for whoever watches; the black box keeps them."""
        return self._box.drain()

    def advance(self, cycles: int) -> Status:
        """Let the loop run for some cycles, with a heartbeat, and return its status."""
        last = self._session.tick + cycles
        beat = max(1, self._session.heartbeat_limit // 2)
        while self._session.tick < last:
            self._session.heartbeat += 1
            self.loop.go(min(beat, last - self._session.tick))
        return self.status

    def run_alone(self, cycles: int) -> Status:
        """Let a loop without a clock run for some cycles without a sign of life from here."""
        self._library.hardware_run(self._session, self._sample, cycles)
        return self.status

    def lose(self, edges: int) -> None:
        """Let a loop without a clock miss its next edges, as one with a clock may."""
        self._session.lose = edges

    def reset(self) -> Status:
        """Take back all faults by an edge; those that are still there come again."""
        self._ask(ASK_RESET)
        return self.advance(2)

    def enable(self) -> Status:
        """Reset what is latched and go to operation enabled; torque grows from zero there.

        Raises:
            HardwareError: the drive did not get there, and why.
        """
        self.advance(4)
        self.reset()
        self._ask(ASK_ENABLE)
        last = self._session.tick + 4 + 4 * self.axis.patience
        while self._session.tick < last and not self.axis.running and self.axis.state != FAULT:
            self.advance(1)
        if not self.axis.running:
            reason = ", ".join(faults_of(self.axis.faults)) or "the drive did not follow"
            raise HardwareError(f"{self.machine.name} was not enabled: {reason} (state: {self.status.state}).")
        return self.status

    def track(self, cycles: int | None = None) -> Status:
        """Follow the set points to their end, or for some cycles; ends early where the axis leaves operation."""
        last = self._done() + cycles if cycles is not None else self._session.setpoints
        while self.axis.running and self._done() < last:
            self.advance(min(1000, last - self._done()))
        return self.status

    def disable(self) -> Status:
        """Bring the torque to zero along its ramp and leave operation."""
        self._ask(ASK_QUICK_STOP)
        while self.axis.state in (ENABLED, QUICK_STOP_STATE):
            self.advance(1)
        self._ask(0)
        return self.advance(2)

    def estop(self) -> Status:
        """Take the torque to zero at once; a fault."""
        self._ask(ASK_ESTOP)
        return self.advance(3)

    def tighten(self, name: str, value: float) -> None:
        """Make a limit smaller; it acts from the next cycle on.

        Raises:
            HardwareError: the limit is unknown, or the value is larger than it is now.
        """
        if name not in LIMITS:
            message = f'"{name}" is no limit; limits are: {", ".join(LIMITS)}.'
            raise HardwareError(message, culprit=name, choices=LIMITS)
        now = self.axis.limit[LIMITS.index(name)]
        if not 0 <= value <= now:
            message = f'The limit "{name}" is {now:g} and can be tightened, not set to {value:g}.'
            raise HardwareError(message, culprit=name, value=value)
        self._session.value = value
        self._session.change = LIMITS.index(name) + 1

    def _done(self) -> int:
        """Cycles of the set point that are over; those that were late are over too."""
        return int(self._session.tick - self.axis.entered) if self.axis.running else 0

    def _ask(self, request: int) -> None:
        self._session.request = request

    def _kind(self) -> type[Called] | type[Forked]:
        if self._fast:
            return Called
        return Threaded if self.transport.python else Forked

    def _made(self) -> CSession:
        wired, step = self.wired, self.scenario.step
        reactions = self.machine.reactions
        return CSession(
            axis=ctypes.pointer(self.axis),
            adapter=ctypes.pointer(self.transport.adapter),
            box=ctypes.pointer(self._box.box),
            setpoint=wired.setpoints.ctypes.data,
            setpoints=wired.setpoints.shape[1],
            period=0 if self._fast else period_of(step),
            spin=round(self.machine.clock.spin_us * 1000),
            waits=self.machine.adapter == "simulated",
            heartbeat_limit=cycles_of(reactions.heartbeat_ms, step),
        )


def run_session(session: Session) -> Parsed:
    """Enable, follow the set points to their end, and come to rest; returns how it went."""
    begun = perf_counter()
    session.enable()
    tracked = session.track()
    completed = tracked.running
    ended = session.disable() if completed else session.advance(4)
    return session.statistics | {
        "completed": completed,
        "state": ended.state,
        "faults": list(ended.faults),
        "torque": ended.torque,
        "seconds": perf_counter() - begun,
    }
