"""The loop's end of process data over UDP: a greeting from here, then frames from C (udp.c).

The greeting finds out, before any torque, whether there is a drive, whether it is free, and whether it keeps the same
time. What the encoder's counts mean it cannot find out: that takes a move (`cosim hardware check --move`).
"""

import os
import socket
import struct
import zlib
from typing import Any
from urllib.parse import urlsplit

from cosim.errors import HardwareError
from cosim.hardware.library import library, shared
from cosim.hardware.machine import Machine
from cosim.hardware.structures import COUNTED, CAdapter, CUdp

FRAME = struct.Struct("<4I q 4I d I")
"""A frame of udp.h up to its CRC."""
MAGIC, HELLO, WELCOME, BUSY = 0x3143534D, 1, 2, 3
TRIES, PATIENCE = 5, 0.2
"""Greetings before nobody is there, and seconds between them."""
LOCKSTEP_PATIENCE = 1.0
"""Seconds that a loop without a clock waits for an answer."""


class UdpDrive:
    """The way to a drive at `udp://host:port`.

    Raises:
        HardwareError: nobody answers there, or no drive, or one that is taken, or keeps another time than the loop.
    """

    python = False

    def __init__(self, machine: Machine, step: float, fast: bool) -> None:
        self._url, self._socket = machine.adapter, reach(machine.adapter)
        try:
            session = int.from_bytes(os.urandom(4), "little") | 1
            self._agree(self._greet(session, step), step, fast)
        except BaseException:
            self._socket.close()
            raise
        clock, descriptor = machine.clock, self._socket.fileno()
        patience, spin = (LOCKSTEP_PATIENCE, 0.0) if fast else (clock.answer_us / 1e6, clock.answer_spin_us / 1e6)
        numbers = {"patience": round(patience * 1e9), "spin": round(spin * 1e9)}
        self.udp = shared(CUdp(socket=descriptor, session=session, **numbers))
        self.adapter = CAdapter()
        library().udp_open(self.udp, self.adapter)

    def statistics(self) -> dict[str, Any]:
        """Count frames: `lost` are orders to which no whole answer has come, in time or not."""
        link = self.udp.link
        counted = {name: int(getattr(link, name)) for name in COUNTED}
        counted["lost"] = link.sent - link.good - link.late - link.reordered
        return {"link": counted | {"worst_round_trip_us": link.worst / 1000}}

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _greet(self, session: int, step: float) -> tuple[int, int, float]:
        """Return kind, ns of a cycle and s of a cycle of what answers."""
        hello = sealed(HELLO, session, step)
        heard = b""
        for _ in range(TRIES):
            try:
                self._socket.send(hello)
                heard = self._socket.recv(256)
            except TimeoutError:
                continue
            except OSError as error:
                raise self._nobody(error.strerror or str(error)) from error
            if (found := opened(heard, session)) is not None:
                return found
        if heard:
            message = f"What answers at {self._url} is no drive: it does not speak this protocol."
            raise HardwareError(message, culprit=self._url)
        raise self._nobody(f"no answer within {TRIES * PATIENCE:g} s")

    def _nobody(self, reason: str) -> HardwareError:
        message = (
            f"No drive at {self._url}: {reason[0].lower()}{reason[1:]} (`cosim hardware virtual-drive` starts one)."
        )
        return HardwareError(message, culprit=self._url)

    def _agree(self, found: tuple[int, int, float], step: float, fast: bool) -> None:
        kind, period, cycle = found
        if kind == BUSY:
            raise HardwareError(f"The drive at {self._url} is taken by another loop.", culprit=self._url)
        if abs(cycle - step) > 1e-9 * step:
            message = f"The drive at {self._url} has a cycle of {cycle:g} s and the loop one of {step:g} s."
            raise HardwareError(message, culprit=self._url, value=cycle)
        if fast and period:
            message = f"The drive at {self._url} runs in real time and a loop without a clock (--fast) does not."
            raise HardwareError(message, culprit=self._url)
        if not fast and not period:
            message = (
                f"The drive at {self._url} runs in lockstep, without a watchdog: that is for loops with --fast only."
            )
            raise HardwareError(message, culprit=self._url)


def reach(url: str) -> socket.socket:
    """Return a socket that talks to udp://host:port only."""
    parts = urlsplit(url)
    found = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        found.connect((parts.hostname, parts.port))
    except OSError as error:
        found.close()
        raise HardwareError(f"{url}: no way to that host: {error.strerror}.", culprit=url) from error
    found.settimeout(PATIENCE)
    return found


def sealed(kind: int, session: int, step: float) -> bytes:
    """Return a frame of a greeting."""
    body = FRAME.pack(MAGIC, kind, session, 0, 0, 0, 0, 0, 0, step, 0)
    return body + zlib.crc32(body).to_bytes(4, "little")


def opened(raw: bytes, session: int) -> tuple[int, int, float] | None:
    """Return kind, ns of a cycle and s of a cycle of an answer to a greeting; None if it is none."""
    if len(raw) != FRAME.size + 4 or zlib.crc32(raw[:-4]) != int.from_bytes(raw[-4:], "little"):
        return None
    magic, kind, whose, _, period, *_, cycle, _ = FRAME.unpack(raw[:-4])
    known = magic == MAGIC and whose == session and kind in (WELCOME, BUSY)
    return (kind, period, cycle) if known else None
