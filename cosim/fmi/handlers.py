"""Handlers of signals that foreign code installs: those of this program are put back, others left while it is open."""

import ctypes
import os
import signal
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

LIBC: Any = ctypes.CDLL(None, use_errno=True) if os.name == "posix" else None
"""The C library of this process; None on Windows, whose library has other functions."""
OURS = tuple(
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP", "SIGCHLD", "SIGALRM", "SIGPIPE", "SIGXFSZ")
    if hasattr(signal, name)
)
"""Signals by which a person or the system speaks to this process: their handlers are never left to foreign code."""
HEARD = OURS[:3]
"""Those of which Python code may have another handler while the system's stays the same: Python's."""
NUMBERS = [number for number in range(1, 32) if number not in (9, 19)]
"""Signals with a meaning of their own, without SIGKILL and SIGSTOP; real-time signals are for programs."""
ROOM = 256
"""Bytes for what the system says of a signal (`struct sigaction` has at most 152) or of a stack."""


class _Action(ctypes.Structure):
    """What the system says of a signal, or of a stack; both begin with the address."""

    _fields_ = (("address", ctypes.c_void_p), ("more", ctypes.c_char * (ROOM - ctypes.sizeof(ctypes.c_void_p))))


@dataclass(frozen=True)
class Handling:
    """Handlers by the number of their signal, 0 for the stack: addresses, all that the system says, Python's own."""

    addresses: tuple[int | None, ...]
    content: bytes = field(compare=False)
    ours: tuple[Any, ...]

    def of(self, number: int) -> bytes:
        """Return what `Handlers.put` needs for a signal."""
        return self.content[ROOM * number : ROOM * (number + 1)]


class Handlers:
    """Handlers of signals, as the system and as Python know them, and the stack that they run on.

    Those of `OURS`, and those that this program handles or ignores itself, are put back. Others are left: a runtime
    inside an FMU (Java, .NET, Julia, Go) lives by its handlers of faults and of signals that it sends to itself.
    """

    def __init__(self) -> None:
        self._room = (_Action * (NUMBERS[-1] + 1))()
        self._places = [(number, ctypes.addressof(self._room) + ROOM * number) for number in NUMBERS]
        LIBC.sigaction.argtypes = [ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p]
        LIBC.sigaltstack.argtypes = [ctypes.c_void_p, ctypes.c_void_p]

    def read(self) -> Handling:
        """Return what there is now."""
        sigaction = LIBC.sigaction
        for number, place in self._places:
            sigaction(number, None, place)
        LIBC.sigaltstack(None, ctypes.addressof(self._room))
        ours = tuple(map(signal.getsignal, HEARD))
        return Handling(tuple(one.address for one in self._room), bytes(self._room), ours)

    def say(self, before: Handling, now: Handling) -> list[str]:
        """Name those that are put back."""
        names = [signal.Signals(number).name for number in _changed(before, now) if _is_ours(number)]
        return [f"the handler{'s' * (len(names) > 1)} of {', '.join(names)}"] if names else []

    def restore(self, before: Handling) -> None:
        """Put back those that are this program's."""
        for number, handler in zip(HEARD, before.ours, strict=True):
            if handler is not None and signal.getsignal(number) != handler:
                with suppress(ValueError):  # only the main thread may
                    signal.signal(number, handler)
        for number in filter(_is_ours, _changed(before, self.read())):
            self.put(number, before.of(number))

    def put(self, number: int, content: bytes) -> None:
        """Give a signal its handler, or the thread its stack (0)."""
        one = ctypes.create_string_buffer(content, ROOM)
        if number:
            LIBC.sigaction(number, ctypes.addressof(one), None)
        else:
            LIBC.sigaltstack(ctypes.addressof(one), None)


def changed_signals(before: Handling, now: Handling) -> list[int]:
    """List the signals whose handlers were changed and are left so; 0 is the stack."""
    return [number for number in _changed(before, now) if not _is_ours(number)]


def _changed(before: Handling, now: Handling) -> list[int]:
    rows = enumerate(zip(before.addresses, now.addresses, strict=True))
    mine = {number for number, one, other in zip(HEARD, before.ours, now.ours, strict=True) if one != other}
    return sorted({number for number, (one, other) in rows if one != other} | mine)


def _is_ours(number: int) -> bool:
    return number in OURS or (number > 0 and signal.getsignal(number) not in (signal.SIG_DFL, None))


HANDLERS = Handlers() if os.name == "posix" else None
"""Reads and puts back handlers; None on Windows."""
