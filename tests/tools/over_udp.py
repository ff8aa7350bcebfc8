"""A virtual drive in this process, and a session that reaches it over UDP."""

import os
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from on_hardware import SIMULATED, altered, scenario

from cosim.hardware.machine import Machine, changed, read_machine
from cosim.hardware.session import Session
from cosim.hardware.simulated import Plant
from cosim.hardware.udp import FRAME, HELLO, MAGIC, WELCOME, closed, key_of, opened, sealed
from cosim.hardware.virtual import VirtualDrive
from cosim.hardware.wired import wire_up

AT = 0.2
ORDER, BYE, SESSION = 4, 6, 77
WORDS = (0, 6, 7, 15)
"""Controlwords that take a drive to operation enabled."""


@contextmanager
def drive(
    given: Machine = SIMULATED, *, lockstep: bool = True, scale: float = 1.0, **options: Any
) -> Iterator[VirtualDrive]:
    with ExitStack() as stack:
        what = scenario()
        wired = wire_up(what, stack)
        plant = Plant(wired.plant, wired.torque, wired.position)
        yield stack.enter_context(
            VirtualDrive(
                plant, given, options.pop("step", what.step), wired.quantum * scale, lockstep=lockstep, **options
            )
        )


def over(url: str, given: Machine = SIMULATED, **changes: Any) -> Machine:
    return changed(given, "test", adapter=url, **changes)


def faulty(**inject: Any) -> Machine:
    return changed(SIMULATED, "test", inject=[{"at": AT} | inject])


def session(folder: Path, url: str, given: Machine = SIMULATED, stop: float = 0.4, **options: Any) -> Session:
    what = scenario(("stop = 0.4", f"stop = {stop}"))
    return Session(what, over(url, given), folder / "box", **({"fast": True} | options))


def impatient(one: Session, milliseconds: int = 10) -> Session:
    """Wait for an answer that does not come for so long only."""
    one.transport.udp.patience = milliseconds * 1_000_000
    return one


LATER = {"heartbeat_ms": 500.0, "late_in_a_row": 1000, "window_ms": 5.0}
PATIENT = altered(read_machine("virtual"), reactions=LATER)
"""A machine whose reactions wait for a computer that has more to do."""


def frame(
    sequence: int, session: int, key: bytes, word: int = 0, torque: float = 0.0, tick: int | None = None
) -> bytes:
    """An order, by default for the tick of its number."""
    at = sequence if tick is None else tick
    return closed((MAGIC, ORDER, session, sequence, at, word, 0, 0, 0, torque, b""), key)


class Loop:
    """A loop made of Python: what it sends is up to the test."""

    def __init__(self, there: VirtualDrive, channel: socket.socket, file: str = "", session: int = SESSION) -> None:
        self.channel, self.session, self.given, self.key = channel, session, key_of(file), b""
        self.nonce = os.urandom(16)
        channel.settimeout(5)
        channel.connect((there.host, there.port))

    def greet(self) -> int:
        """Greet; returns the kind of the answer."""
        self.send(sealed(HELLO, self.session, 1e-4, self.nonce, self.given))
        found = opened(self.channel.recv(256), self.session, self.nonce, self.given)
        assert found
        self.key = found.key if found.kind == WELCOME else b""
        return found.kind

    def send(self, raw: bytes) -> None:
        self.channel.send(raw)

    def order(self, sequence: int, word: int = 0, torque: float = 0.0, tick: int | None = None) -> bytes:
        return frame(sequence, self.session, self.key, word, torque, tick)

    def obeyed(self, sequence: int, word: int = 0, torque: float = 0.0, tick: int | None = None) -> float:
        """Send an order; returns the torque that the answer says."""
        self.send(self.order(sequence, word, torque, tick))
        return float(FRAME.unpack(self.channel.recv(256)[:-4])[9])

    def number(self) -> int:
        """Return the number of the next answer."""
        return int(FRAME.unpack(self.channel.recv(256)[:-4])[3])

    def enable(self) -> None:
        """Take the drive to operation with the first orders."""
        for sequence, word in enumerate(WORDS, 1):
            self.obeyed(sequence, word)

    def silent(self, seconds: float = 0.2) -> bool:
        """Whether nothing comes."""
        self.channel.settimeout(seconds)
        try:
            self.channel.recv(256)
        except TimeoutError:
            return True
        finally:
            self.channel.settimeout(5)
        return False


@contextmanager
def talking(there: VirtualDrive, file: str = "", session: int = SESSION, greeted: bool = True) -> Iterator[Loop]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as channel:
        loop = Loop(there, channel, file, session)
        assert not greeted or loop.greet() == WELCOME
        yield loop
