"""A virtual drive: the plant of a scenario in real time behind CiA 402, at the other end of UDP (virtual.c)."""

import ctypes
import errno
import os
import socket
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from threading import Thread
from time import sleep

from cosim.fmi.component import FATAL
from cosim.fmi.fmu import FmuComponent
from cosim.hardware.library import library
from cosim.hardware.loops import period_of
from cosim.hardware.machine import Machine
from cosim.hardware.simulated import Plant, make_drive
from cosim.hardware.structures import COUNTED, KEY, CAdapter, CVirtual
from cosim.hardware.udp import key_of
from cosim.hardware.words import STATES
from cosim.support.errors import HardwareError
from cosim.support.plain import JsonObject

POLL, LONGEST = 0.01, 5.0
"""Seconds between two looks at the drive; seconds that its plant may take to end a step."""
LEASE, AHEAD = 1e9, 1000
"""Least ns without an order after which a drive is free; least ticks that an order may be ahead, or its watchdog."""


@dataclass(frozen=True)
class Event:
    """Something that happened to a drive: what, the state it is in, and numbers by name."""

    what: str
    state: str
    numbers: dict[str, float]


class VirtualDrive:
    """A drive that serves while it is entered; its watchdog takes the torque away where orders stop.

    Args:
        plant: its FMU, started.
        machine: limits, watchdog, key and faults.
        step: cycle in s, also that of the loop.
        quantum: rad a count of its encoder; the loop may believe another one.
        host, port: where it listens; port 0: any that is free.
        lockstep: its time is that of the orders; no clock, and no watchdog but in ticks of the orders.

    Raises:
        HardwareError: the port is taken, the key is none, no clock has such a step, or the plant does not start.
    """

    def __init__(
        self,
        plant: Plant,
        machine: Machine,
        step: float,
        quantum: float,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        lockstep: bool,
    ) -> None:
        period = 0 if lockstep else period_of(step)
        self._adapter, self._plant, key = CAdapter(), plant, key_of(machine.key_file)
        self.drive, self._kept = make_drive(plant, machine, step, quantum, self._adapter)
        self._socket = listen(host, port)
        self.host, self.port = self._socket.getsockname()
        self.virtual = CVirtual(
            drive=ctypes.pointer(self.drive),
            socket=self._socket.fileno(),
            period=period,
            watchdog=round(machine.watchdog_ms * 1e6),
            lease=round(max(machine.watchdog_ms * 1e6, LEASE)),
            ahead=max(self.drive.watchdog, AHEAD),
            secret=(ctypes.c_byte * KEY).from_buffer_copy(os.urandom(KEY)),
        )
        arguments = (self.virtual, self._adapter, key)
        self._thread = Thread(target=library().virtual_run, args=arguments, daemon=True)

    def __enter__(self) -> "VirtualDrive":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.virtual.stop = 1
        self._thread.join(LONGEST)
        if self._thread.is_alive():  # it ends with the process; who frees what it works with now crashes
            self._plant.component.failed(FATAL)
            raise HardwareError("The plant of the drive does not end its step; the drive ends without it.")
        self._socket.close()

    @property
    def url(self) -> str:
        """Where it listens."""
        return f"udp://{self.host}:{self.port}"

    @property
    def statistics(self) -> JsonObject:
        """Count the orders of this session by what became of them; trips of the watchdog; what its limits met."""
        link = {name: int(getattr(self.virtual.link, name)) for name in COUNTED if name != "sent"}
        own = {"beyond_limits": int(self.drive.limited), "overspeeds": int(self.drive.overspeeds)}
        trips = {"watchdog_trips": int(self.virtual.trips), "torque": float(self.drive.held)}
        return {"orders": link, **trips, **own}

    def events(self) -> Iterator[Event]:
        """Yield what happens to it, without an end: changes of state, and torques that its watchdog took away."""
        state, trips = -1, 0
        while True:
            if self.virtual.trips != trips:
                trips = self.virtual.trips
                yield self._event("watchdog", self._trip())
            if self.drive.state != state:
                state = self.drive.state
                yield self._event("state", {"torque": self.drive.held})
            sleep(POLL)

    def _trip(self) -> dict[str, float]:
        virtual = self.virtual
        return {"silence_ms": virtual.silence / 1e6, "torque_taken": virtual.taken, "clock_ns": virtual.let_go}

    def _event(self, what: str, numbers: dict[str, float]) -> Event:
        return Event(what, STATES[self.drive.state], numbers)


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens there.

    Raises:
        HardwareError: it cannot.
    """
    found = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        found.bind((host, port))
    except OSError as error:
        found.close()
        taken = "it is taken" if error.errno == errno.EADDRINUSE else (error.strerror or str(error)).lower()
        raise HardwareError(f"A drive cannot listen at udp://{host}:{port}: {taken}.", culprit=str(port)) from error
    return found


def plant_of(component: FmuComponent, torque: str = "tau", position: str = "q") -> Plant:
    """Start an FMU as the plant of a drive.

    Raises:
        HardwareError: it has no such input or output.
    """
    for name, causality in ((torque, "input"), (position, "output")):
        if name not in component.ports or component.ports[name].causality != causality:
            message = f'{component.name} is no plant of a drive: it has no {causality} "{name}".'
            raise HardwareError(message, culprit=name)
    component.start({})
    return Plant(component, torque, position)


def parse_injection(text: str) -> JsonObject:
    """Read KIND[:AT[:LASTS[:SIZE]]] as an entry of `[[inject]]`.

    Raises:
        HardwareError: it is not of that form.
    """
    kind, *numbers = text.split(":")
    with suppress(ValueError):
        values = dict(zip(("at", "lasts", "size"), map(float, numbers), strict=False))
        if len(numbers) <= 3:
            return {"kind": kind, "at": 0.0, **values}
    raise HardwareError(f'"{text}" is no fault to inject; the form is KIND[:AT[:LASTS[:SIZE]]].', culprit=text)
