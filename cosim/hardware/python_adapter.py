"""An adapter written in Python: for slow or prototype drives.

    # my_drive.py; adapter = "my_drive.py:MyDrive" in the machine file
    class MyDrive(PythonAdapter):
        def write(self, order: Order) -> None: ...
        def read(self) -> Reading | None: ...

The loop calls it in every cycle, `write` first, and waits for it: some microseconds of its own, and whatever the
interpreter does meanwhile (collection of garbage, other threads: hundreds of microseconds). Good for cycles of a
millisecond or more; a drive that is to be fast gets an adapter in C. The loop is then a thread of the process, not a
process of its own: who kills Python kills the loop too, and the drive's own watchdog is what is left.
"""

import ctypes
from abc import ABC, abstractmethod
from collections.abc import Callable
from ctypes import POINTER, c_int, c_void_p
from dataclasses import dataclass
from typing import Any

from cosim.fmi.function import load_function
from cosim.fmi.guard import Guard
from cosim.hardware.structures import CAdapter, CFeedback, COrder
from cosim.support.errors import HardwareError
from cosim.support.plain import JsonObject

READ_OK, READ_STALE, READ_ERROR = 0, 1, 2
_READ = ctypes.CFUNCTYPE(c_int, c_void_p, POINTER(CFeedback))
_WRITE = ctypes.CFUNCTYPE(c_int, c_void_p, POINTER(COrder))
_STATUS = ctypes.CFUNCTYPE(c_int, c_void_p)


@dataclass(frozen=True)
class Order:
    """What the drive shall do from now on: controlword (0x6040) and torque [N m] at a tick of the loop."""

    tick: int
    controlword: int
    torque: float


@dataclass(frozen=True)
class Reading:
    """What the drive says: counts of the encoder (0x6064), taken modulo 2^32; a number that differs with each sample of
    it; statusword (0x6041); torque that it gives (0x6077) [N m].
    """

    counts: int
    encoder: int
    statusword: int
    torque: float


class PythonAdapter(ABC):
    """The contract; see the module. An instance is made with the cycle of the loop in s.

    What it raises is a fault of the session (`adapter_failed`), and its text stands in the statistics.
    """

    def __init__(self, step: float) -> None:
        self.step = step

    @abstractmethod
    def write(self, order: Order) -> None:
        """Send an order. Called at each edge, also without torque, and last of all with an order of zero."""

    @abstractmethod
    def read(self) -> Reading | None:
        """Return what the drive says now; None if it has said nothing new."""

    def status(self) -> int:
        """Return 0 while all is well; anything else is a fault. Called once a cycle, after `read`."""
        return 0

    def close(self) -> None:  # noqa: B027 an adapter need not have anything to close
        """Let go of the drive; nothing is called any more."""


class PythonTransport:
    """A way to a drive through an adapter in Python."""

    python = True

    def __init__(self, one: PythonAdapter) -> None:
        self.one, self._error = one, ""
        self._functions = (_READ(self._read), _WRITE(self._write), _STATUS(self._status))
        read, write, status = (ctypes.cast(function, c_void_p) for function in self._functions)
        self.adapter = CAdapter(read=read, write=write, status=status)

    def statistics(self) -> JsonObject:
        """Return what the adapter raised first, if it did."""
        return {"adapter_error": self._error} if self._error else {}

    def close(self) -> None:
        """Close the adapter."""
        self.one.close()

    def _read(self, _: Any, feedback: Any) -> int:
        def read() -> int:
            found = self.one.read()
            if found is None:
                return READ_STALE
            into = feedback.contents
            into.counts, into.encoder = found.counts & 0xFFFFFFFF, found.encoder & 0xFFFFFFFF
            into.statusword, into.torque = found.statusword, found.torque
            return READ_OK

        return self._guarded(read, READ_ERROR)

    def _write(self, _: Any, order: Any) -> int:
        def write() -> int:
            given = order.contents
            self.one.write(Order(given.tick, given.controlword, given.torque))
            return 0

        return self._guarded(write, 1)

    def _status(self, _: Any) -> int:
        return self._guarded(lambda: int(self.one.status()), 1)

    def _guarded(self, call: Callable[[], int], otherwise: int) -> int:
        """Return what the call returns; an exception must not get into C."""
        try:
            return call()
        except Exception as error:
            self._error = self._error or f"{type(error).__name__}: {error}"
            return otherwise


def load_adapter(source: str, step: float) -> PythonAdapter:
    """Make the adapter "FILE.py:CLASS".

    Raises:
        HardwareError: there is no such class, or it is no adapter.
    """
    kind, _ = load_function(source, "adapter", Guard())
    if not (isinstance(kind, type) and issubclass(kind, PythonAdapter)):
        raise HardwareError(f"{source} is no PythonAdapter (cosim.hardware.python_adapter).", culprit=source)
    return kind(step)
