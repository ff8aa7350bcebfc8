"""The loop's end of process data over UDP: a greeting from here, then frames from C (udp.c).

Every frame bears an HMAC. Its key comes from both nonces of the greeting and from the key file that both ends have
(`key_file` of the machine, `--key`). Without a file it keeps out who does not see the greeting, and no one else.

The greeting finds out, before any torque, whether there is a drive, whether it is free, and whether it keeps the same
time. What the encoder's counts mean it cannot find out: that takes a move (`cosim hardware check --move`).
"""

import hashlib
import hmac
import os
import socket
import struct
import zlib
from dataclasses import dataclass
from time import sleep
from typing import Any
from urllib.parse import urlsplit

from cosim.hardware.library import library, shared
from cosim.hardware.machine import Machine
from cosim.hardware.structures import COUNTED, NONCE, TAG, CAdapter, CUdp
from cosim.support.errors import HardwareError
from cosim.support.plain import JsonObject

FRAME = struct.Struct("<4I q 4I d 16s 16s I")
"""A frame of udp.h up to its CRC."""
TAGGED = struct.calcsize("<4I q 4I d 16s")
"""Bytes of a frame that its tag covers."""
MAGIC, HELLO, WELCOME, BUSY, DENIED = 0x3243534D, 1, 2, 3, 7
TRIES, PATIENCE = 8, 0.2
"""Greetings before nobody is there, or free, and s between them; a loop that was killed frees its drive in 1 s."""
SHORTEST_KEY, LONGEST_KEY = 16, 65_536
"""Bytes of a key file."""
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
            session, key = int.from_bytes(os.urandom(4), "little") | 1, key_of(machine.key_file)
            found = self._greet(session, step, key)
            self._agree(found, step, fast)
        except BaseException:
            self._socket.close()
            raise
        clock, descriptor = machine.clock, self._socket.fileno()
        patience, spin = (LOCKSTEP_PATIENCE, 0.0) if fast else (clock.answer_us / 1e6, clock.answer_spin_us / 1e6)
        numbers = {"patience": round(patience * 1e9), "spin": round(spin * 1e9)}
        self.udp = shared(CUdp(socket=descriptor, session=session, **numbers))
        self.adapter = CAdapter()
        library().udp_open(self.udp, self.adapter, found.key)

    def statistics(self) -> JsonObject:
        """Count frames: `lost` are orders to which no whole answer has come, in time or not."""
        link = self.udp.link
        counted = {name: int(getattr(link, name)) for name in COUNTED}
        counted["lost"] = link.sent - link.good - link.late - link.reordered
        return {"link": counted | {"worst_round_trip_us": link.worst / 1000}}

    def close(self) -> None:
        """Say that the session is over, and close the socket."""
        library().udp_bye(self.udp)
        self._socket.close()

    def _greet(self, session: int, step: float, key: bytes) -> "Welcome":
        """Return what answers to a greeting; a drive that is taken is asked again, for its loop may have ended."""
        nonce = os.urandom(NONCE)
        hello = sealed(HELLO, session, step, nonce, key)
        heard, found = b"", None
        for _ in range(TRIES):
            try:
                self._socket.send(hello)
                heard = self._socket.recv(256)
            except TimeoutError:
                continue
            except OSError as error:
                raise self._nobody(error.strerror or str(error)) from error
            found = opened(heard, session, nonce, key)
            if found is not None and found.kind != BUSY:
                return found
            sleep(PATIENCE if found is not None else 0)
        if found is not None:
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

    def _agree(self, found: "Welcome", step: float, fast: bool) -> None:
        kind, period, cycle = found.kind, found.period, found.cycle
        if kind == BUSY:
            raise HardwareError(f"The drive at {self._url} is taken by another loop.", culprit=self._url)
        if kind == DENIED:
            message = f"The drive at {self._url} was given another key than this loop (--key, key_file)."
            raise HardwareError(message, culprit=self._url)
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


@dataclass(frozen=True)
class Welcome:
    """What a drive says to a greeting: kind, ns of a cycle (0: no clock), s of a cycle; and the key of the session."""

    kind: int
    period: int
    cycle: float
    key: bytes = b""


def key_of(file: str) -> bytes:
    """Return the key that a file gives; where there is none, the one that everybody knows.

    Raises:
        HardwareError: the file cannot be read, or is too short to be a secret.
    """
    try:
        with open(file or os.devnull, "rb") as opened_:
            content = opened_.read(LONGEST_KEY + 1)
    except OSError as error:
        raise HardwareError(f"The key {file} cannot be read: {error.strerror}.", culprit=file) from error
    if file and not SHORTEST_KEY <= len(content) <= LONGEST_KEY:
        rule = f"a key has {SHORTEST_KEY} to {LONGEST_KEY:,} random bytes (head -c 32 /dev/urandom > {file})"
        raise HardwareError(f"{file} is no key: {rule}.", culprit=file)
    return hashlib.sha256(content).digest()


def session_key(key: bytes, hello: bytes, welcome: bytes) -> bytes:
    """Return the key of a session from that of both ends and the two nonces."""
    return hmac.digest(key, hello + welcome, "sha256")


def sealed(kind: int, session: int, step: float, nonce: bytes, key: bytes) -> bytes:
    """Return a frame of a greeting."""
    return closed((MAGIC, kind, session, 0, 0, 0, 0, 0, 0, step, nonce), key)


def closed(values: tuple[Any, ...], key: bytes) -> bytes:
    """Return a frame with its tag and CRC; the values are those before the tag."""
    body = FRAME.pack(*values, b"", 0)[:TAGGED]
    body += hmac.digest(key, body, "sha256")[:TAG] + bytes(4)
    return body + zlib.crc32(body).to_bytes(4, "little")


def opened(raw: bytes, session: int, hello: bytes, key: bytes) -> Welcome | None:
    """Return what an answer to the greeting with the nonce `hello` says; None if it is none."""
    if len(raw) != FRAME.size + 4 or zlib.crc32(raw[:-4]) != int.from_bytes(raw[-4:], "little"):
        return None
    magic, kind, whose, _, period, *_, cycle, welcome, tag, _ = FRAME.unpack(raw[:-4])
    if magic != MAGIC or whose != session or kind not in (WELCOME, BUSY, DENIED):
        return None
    own = session_key(key, hello, welcome) if kind == WELCOME else key
    if kind != DENIED and not hmac.compare_digest(tag, hmac.digest(own, raw[:TAGGED], "sha256")[:TAG]):
        return None
    return Welcome(kind, period, cycle, own)
