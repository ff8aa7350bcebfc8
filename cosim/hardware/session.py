"""A session: the controller of a scenario in the compiled loop, against an adapter.

    with Session(scenario, machine, path) as session:
        session.enable()
        session.track()
        session.disable()

`fast` lets the clock go: the same cycles in the same order, as fast as possible. In real time the loop runs in a thread
of its own that holds no lock of Python; this one only watches, and its heartbeat keeps the torque on.
"""

import ctypes
from contextlib import ExitStack
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from threading import Thread
from time import perf_counter, sleep
from typing import Any

import numpy as np

import cosim
from cosim.errors import HardwareError
from cosim.hardware.blackbox import BlackBox
from cosim.hardware.library import library, part_of
from cosim.hardware.machine import Machine
from cosim.hardware.structures import CAdapter, CAxis, CDrive, CInjection, CSample, CSession
from cosim.hardware.wired import REFERENCE, Wired, wire_up
from cosim.hardware.words import (
    ASK_ENABLE,
    ASK_ESTOP,
    ASK_QUICK_STOP,
    ASK_RESET,
    ENABLED,
    FAULT,
    INJECTIONS,
    LIMITS,
    QUICK_STOP_STATE,
    STATES,
    faults_of,
)
from cosim.scenario import Scenario

POLL = 0.002
"""Seconds between two looks at a loop in real time."""


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
        origin: dict[str, Any] | None = None,
    ) -> None:
        self.scenario, self.machine, self._fast = scenario, machine, fast
        self._library, self._stack = library(), ExitStack()
        self._thread: Thread | None = None
        self._sample = CSample()
        try:
            self.wired = wire_up(scenario, self._stack)
            self.axis, self._kept = make_axis(self.wired, machine, scenario.step)
            self._adapter = self._simulated()
            seconds = min(machine.black_box_seconds, scenario.stop + 10)
            story = story_of(scenario, machine, self.wired) | (origin or {})
            self._box = BlackBox(path, ceil(seconds / scenario.step), story, force)
        except BaseException:
            self._stack.close()
            raise
        self._stack.callback(self._box.close)
        self._session = self._made()

    def __enter__(self) -> "Session":
        if not self._fast:
            self._thread = Thread(target=self._library.hardware_run, args=(self._session, self._sample, 2**62))
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        try:
            if self.axis.state in (ENABLED, QUICK_STOP_STATE):
                self.disable()
        finally:
            self._session.stop = 1
            if self._thread:
                self._thread.join()
            self._library.hardware_release(self._session)
            self._stack.close()

    @property
    def status(self) -> Status:
        """What the loop is doing now."""
        axis = self.axis
        faults = faults_of(axis.faults)
        return Status(self._session.tick, STATES[axis.state], faults, axis.torque, bool(axis.running), axis.ran)

    @property
    def statistics(self) -> dict[str, Any]:
        """Cycles, those that were late, the worst wake-up, and what the system allowed."""
        session = self._session
        return {
            "cycles": session.tick - session.late,
            "late_cycles": session.late,
            "worst_wake_up_us": session.worst / 1000,
            "real_time": not self._fast,
            "fifo": bool(session.fifo),
            "memory_locked": bool(session.locked),
            "refused_limits": self.axis.refused,
        }

    def advance(self, cycles: int) -> Status:
        """Let the loop run for some cycles, with a heartbeat, and return its status."""
        last = self._session.tick + cycles
        beat = max(1, self._session.heartbeat_limit // 2)
        while self._session.tick < last:
            self._session.heartbeat += 1
            if self._fast:
                self.run_alone(min(beat, last - self._session.tick))
            else:
                sleep(POLL)
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

    def _made(self) -> CSession:
        wired, step = self.wired, self.scenario.step
        reactions = self.machine.reactions
        return CSession(
            axis=ctypes.pointer(self.axis),
            adapter=ctypes.pointer(self._adapter),
            box=ctypes.pointer(self._box.box),
            setpoint=wired.setpoints.ctypes.data,
            setpoints=wired.setpoints.shape[1],
            period=0 if self._fast else round(step * 1e9),
            spin=round(self.machine.clock.spin_us * 1000),
            heartbeat_limit=cycles_of(reactions.heartbeat_ms, step),
        )

    def _simulated(self) -> CAdapter:
        wired, step, adapter = self.wired, self.scenario.step, CAdapter()
        plant, arrays = part_of(wired.plant, [wired.torque], [wired.position])
        faults = [
            CInjection(INJECTIONS.index(one.kind), round(one.at / step), round((one.at + one.lasts) / step), one.size)
            for one in self.machine.inject
        ]
        self._drive = CDrive(
            plant=plant,
            watchdog=cycles_of(self.machine.watchdog_ms, step),
            injections=len(faults),
            injection=(CInjection * len(faults))(*faults),
            step=step,
            quantum=wired.quantum,
        )
        self._kept += arrays
        if not self._library.drive_open(self._drive, adapter):
            raise HardwareError(f"{self.machine.name}: the plant of the simulated drive does not start.")
        return adapter


def cycles_of(milliseconds: float, step: float) -> int:
    """Return a time as cycles, at least one."""
    return max(1, round(milliseconds / 1000 / step))


def make_axis(wired: Wired, machine: Machine, step: float) -> tuple[CAxis, tuple[np.ndarray, ...]]:
    """Return an axis that has just been switched on, and the arrays that must live as long as it."""
    part, arrays = part_of(wired.controller, list(wired.inputs), [wired.command])
    reactions = machine.reactions
    axis = CAxis(
        controller=part,
        encoder_input=wired.inputs.index(wired.encoder),
        reference_input=wired.inputs.index(REFERENCE),
        step=step,
        quantum=wired.quantum,
        limit=tuple(getattr(machine.limits, name) for name in LIMITS),
        stop_slew=reactions.stop_slew,
        ramp=cycles_of(reactions.ramp_ms, step),
        patience=cycles_of(reactions.patience_ms, step),
        lost_limit=reactions.lost_cycles,
        stale_limit=reactions.stale_cycles,
        mismatch_limit=reactions.mismatch_cycles,
        late_row_limit=reactions.late_in_a_row,
        late_limit=reactions.late_in_window,
        late_window=cycles_of(reactions.window_ms, step),
    )
    if not library().hardware_ready(axis):
        raise HardwareError("The controller cannot save its state, which each entry into operation starts from.")
    return axis, arrays


def story_of(scenario: Scenario, machine: Machine, wired: Wired) -> dict[str, Any]:
    """Say all that a replay needs beside the records."""
    name = wired.controller.name
    return {
        "version": f"mount-cosim {cosim.__version__}",
        "step": scenario.step,
        "quantum": wired.quantum,
        "inputs": list(wired.inputs),
        "encoder": wired.encoder,
        "output": wired.command,
        "units": wired.units,
        "machine": machine.model_dump(),
        "controller": wired.controller.origin
        | {"path": str(wired.controller.path), "parameters": dict(scenario.components[name].parameters)},
        "scenario": scenario.text,
    }


def run_session(session: Session) -> dict[str, Any]:
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
