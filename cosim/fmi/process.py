"""What belongs to the process, or to its thread, and foreign code can change: how each thing is read and put back.

A `Property` is one such thing. It is read before foreign code runs and after it; where both differ, `say` names what
was changed and `restore` puts it back. `PROPERTIES` holds those that this platform lets Python read; signals are in
`handlers`.
"""

import ctypes
import locale
import os
import platform
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, Protocol

from cosim.fmi.handlers import LIBC

MOST_NAMED = 5
"""Environment variables that a note names at most."""
ROOM = 256
"""Bytes for what the system says of the arithmetic (`fenv_t` has at most 32)."""
_STREAMS = {0: "the standard input", 1: "the standard output", 2: "the standard error"}
_LIMITS = {
    "RLIMIT_AS": "memory",
    "RLIMIT_CORE": "core dumps",
    "RLIMIT_CPU": "processor time",
    "RLIMIT_DATA": "data",
    "RLIMIT_FSIZE": "file sizes",
    "RLIMIT_NOFILE": "open files",
    "RLIMIT_NPROC": "processes",
    "RLIMIT_STACK": "the stack",
}
_TIMERS = {"ITIMER_REAL": "alarm", "ITIMER_VIRTUAL": "virtual", "ITIMER_PROF": "profiling"}
_REGISTERS: Mapping[tuple[str, str], tuple[tuple[int, int, str], ...]] = {
    ("Linux", "x86_64"): ((0, 0x0F3F, "x87"), (7, 0xFFC0, "sse")),
    ("Darwin", "x86_64"): ((0, 0x0F3F, "x87"), (1, 0xFFC0, "sse")),
    ("Linux", "aarch64"): ((0, 0xFFFFFFFF, "fpcr"),),
    ("Darwin", "arm64"): ((2, 0xFFFFFFFF, "fpcr"),),
}
"""Where `fenv_t` has the control registers: a number of 32 bits, which bits are settings (others are flags), name."""
_BITS = {
    "x87": (0x0C00, 0, 0x003F, 0x0300),
    "sse": (0x6000, 0x8040, 0x1F80, 0),
    "fpcr": (0x00C00000, 0x01080003, 0x9F00, 0x04000000),
}
"""Bits of a register that set rounding, flush to zero, traps and precision, as in foreign.h."""
SETTINGS = (
    "the rounding mode",
    "the flush of subnormal numbers to zero",
    "the traps of floating-point errors",
    "the floating-point precision",
)
"""What the bits 1, 2, 4 and 8 of foreign.h mean."""


class Property(Protocol):
    """A property of the process."""

    def read(self) -> Any:
        """Return what it is now, to be compared with `==`."""

    def say(self, before: Any, now: Any) -> list[str]:
        """Name what was changed."""

    def restore(self, before: Any, /) -> object:
        """Put it back; raises OSError or ValueError where the system refuses."""


@dataclass(frozen=True)
class Plain:
    """A property with one name that is read and put back by one function each."""

    name: str
    read: Callable[[], Any]
    restore: Callable[[Any], object]

    def say(self, before: Any, now: Any) -> list[str]:
        """Name it."""
        return [self.name]


def _directory() -> str:
    try:
        return os.getcwd()
    except OSError:  # it was removed: there is nothing to come back to
        return ""


def _set_directory(before: str) -> None:
    if before:
        os.chdir(before)


def _mask() -> int:
    """Read the umask; where the system shows it, without setting it, because other threads may be making files."""
    with suppress(OSError), open("/proc/self/status", "rb", 0) as file:
        _, found, after = file.read(2_048).partition(b"\nUmask:")
        if found:
            return int(after.split(None, 1)[0], 8)
    mask = os.umask(0o077)
    os.umask(mask)
    return mask


class Variables:
    """The environment as C has it; Python's own copy follows where it was changed too."""

    def __init__(self) -> None:
        self._list = ctypes.POINTER(ctypes.c_void_p).in_dll(LIBC, "environ")
        self._pointers, self._parsed = b"", dict[bytes, bytes]()

    def read(self) -> dict[bytes, bytes]:
        """Return the variables; C's list is parsed again only where its pointers have changed."""
        count = 0
        while self._list and self._list[count]:  # there is no list after clearenv()
            count += 1
        pointers = ctypes.string_at(self._list, count * ctypes.sizeof(ctypes.c_void_p)) if count else b""
        if pointers != self._pointers:
            lines = (ctypes.string_at(self._list[number] or 0) for number in range(count))
            self._parsed = {key: content for key, _, content in (line.partition(b"=") for line in lines) if key}
            self._pointers = pointers
        return self._parsed

    def say(self, before: dict[bytes, bytes], now: dict[bytes, bytes]) -> list[str]:
        """Name the variables."""
        names = sorted(map(os.fsdecode, _changed(before, now)))
        if not names:
            return []
        more = [f"{len(names) - MOST_NAMED} more"] if len(names) > MOST_NAMED else []
        return [f"the environment variable{'s' * (len(names) > 1)} {', '.join([*names[:MOST_NAMED], *more])}"]

    def restore(self, before: dict[bytes, bytes]) -> None:
        """Put them back."""
        now = self.read()
        for key in _changed(before, now):
            if os.environb.get(key) == now.get(key):  # changed through Python, or never known to it
                os.environb.pop(key, None)
                os.environb.update({key: before[key]} if key in before else {})
            elif key in before:
                os.putenv(key, before[key])
            else:
                os.unsetenv(key)
            if key == b"TZ":
                time.tzset()


def _changed(before: dict[bytes, bytes], now: dict[bytes, bytes]) -> list[bytes]:
    """Variables that are other ones now.

    In a thread beside the main one those that Python knows of are left out: other threads may set them meanwhile.
    """
    keys = [key for key in {**before, **now} if before.get(key) != now.get(key)]
    if threading.current_thread() is threading.main_thread():
        return keys
    return [key for key in keys if os.environb.get(key) != now.get(key)]


class Arithmetic:
    """The control registers of floating-point arithmetic of this thread."""

    def __init__(self, registers: tuple[tuple[int, int, str], ...]) -> None:
        library = _libm()
        self._registers, self._get, self._set = registers, library.fegetenv, library.fesetenv
        self._room = ctypes.create_string_buffer(ROOM)
        self._get.argtypes = self._set.argtypes = [ctypes.c_void_p]
        self._address = ctypes.addressof(self._room)
        self._numbers = memoryview(self._room).cast("B").cast("I")
        self._places = [(place, mask) for place, mask, _ in registers]

    def read(self) -> list[int]:
        """Return the settings of each register."""
        self._get(self._address)
        return [self._numbers[place] & mask for place, mask in self._places]

    def changed(self, before: list[int], now: list[int]) -> int:
        """Return which settings differ, as foreign.h adds them up."""
        found = 0
        for (*_, name), one, other in zip(self._registers, before, now, strict=True):
            for place, bits in enumerate(_BITS[name]):
                found |= ((one ^ other) & bits != 0) << place
        return found

    def say(self, before: list[int], now: list[int]) -> list[str]:
        """Name the settings."""
        return in_words(self.changed(before, now))

    def restore(self, before: list[int]) -> None:
        """Put the settings back and leave the flags."""
        self._get(self._address)
        for (place, mask), value in zip(self._places, before, strict=True):
            self._numbers[place] = self._numbers[place] & ~mask | value
        self._set(self._address)


def in_words(bits: int) -> list[str]:
    """Name what a sum of foreign.h says."""
    return [name for place, name in enumerate(SETTINGS) if bits & 1 << place]


def _libm() -> Any:
    """Return the library that holds `fegetenv`.

    Raises:
        OSError: it cannot be found.
    """
    for name in ("libm.so.6", None):
        with suppress(OSError):
            found = ctypes.CDLL(name)
            if hasattr(found, "fegetenv"):
                return found
    raise OSError("no library with fegetenv")


class Timers:
    """Timers that end in a signal: whether they run and how often they repeat; the time left is always another."""

    def read(self) -> tuple[tuple[bool, float], ...]:
        """Return for each whether it runs, and its interval [s]."""
        times = (signal.getitimer(getattr(signal, name)) for name in _TIMERS)
        return tuple((left > 0, interval) for left, interval in times)

    def say(self, before: Any, now: Any) -> list[str]:
        """Name them."""
        rows = zip(_TIMERS.values(), before, now, strict=True)
        return [f"the {name} timer" for name, one, other in rows if one != other]

    def restore(self, before: tuple[tuple[bool, float], ...]) -> None:
        """Stop those that did not run; one that ran begins a new interval."""
        for name, one, now in zip(_TIMERS, before, self.read(), strict=True):
            if one != now:
                signal.setitimer(getattr(signal, name), one[1], one[1])


class Limits:
    """Limits of what the process may use."""

    def __init__(self) -> None:
        import resource

        self._resource = resource
        self._names = {getattr(resource, key): name for key, name in _LIMITS.items() if hasattr(resource, key)}

    def read(self) -> tuple[tuple[int, int], ...]:
        """Return the soft and the hard limit of each."""
        return tuple(map(self._resource.getrlimit, self._names))

    def say(self, before: Any, now: Any) -> list[str]:
        """Name them."""
        rows = zip(self._names.values(), before, now, strict=True)
        return [f"the limit of {name}" for name, one, other in rows if one != other]

    def restore(self, before: tuple[tuple[int, int], ...]) -> None:
        """Put those back that differ; a hard limit cannot be raised again by everybody."""
        for number, one, now in zip(self._names, before, self.read(), strict=True):
            if one != now:
                self._resource.setrlimit(number, one)


def _properties() -> list[Property]:
    """List what this platform has."""
    found: list[Property] = [
        Plain("the working directory", _directory, _set_directory),
        Plain("the umask", _mask, os.umask),
        Plain("the locale", lambda: locale.setlocale(locale.LC_ALL), lambda one: locale.setlocale(locale.LC_ALL, one)),
    ]
    if ARITHMETIC is not None:
        found.append(ARITHMETIC)
    if os.name == "posix":
        uselocale = LIBC.uselocale
        uselocale.argtypes, uselocale.restype = [ctypes.c_void_p], ctypes.c_void_p
        found += [Plain("the locale of the thread", lambda: uselocale(None), uselocale)]
        found += [Plain("the blocked signals", _blocked, _block), Variables(), Timers(), Limits()]
    if hasattr(os, "sched_getaffinity"):
        found.append(
            Plain("the cores of the thread", lambda: os.sched_getaffinity(0), lambda one: os.sched_setaffinity(0, one))
        )
    return found


def _blocked() -> set[int]:
    return signal.pthread_sigmask(signal.SIG_BLOCK, ())


def _block(before: set[int]) -> None:
    signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def streams_kept(say: Callable[[str], None]) -> Iterator[None]:
    """Lead the three standard streams back to where they led before the block; `say` is told which had changed."""
    before = {number: _file(number) for number in _STREAMS}
    objects = sys.stdin, sys.stdout, sys.stderr
    held = {number: os.dup(number) for number, file in before.items() if file}
    try:
        yield
    finally:
        changed = [number for number, file in before.items() if _file(number) != file]
        if changed and os.name == "posix":
            LIBC.fflush(None)  # what was printed goes where the foreign code led it
        for number in changed:
            _lead_back(number, before[number], held)
            say(_STREAMS[number])
        for name, one in zip(("stdin", "stdout", "stderr"), objects, strict=True):
            if getattr(sys, name) is not one:
                setattr(sys, name, one)
                say(f"sys.{name}")
        for handle in held.values():
            with suppress(OSError):  # whoever closes everything closes this too
                os.close(handle)


def _lead_back(number: int, file: tuple[int, ...], held: Mapping[int, int]) -> None:
    if not file:
        os.close(number)  # it was closed before
        return
    os.dup2(held[number], number)
    if os.name == "posix":
        import fcntl

        fcntl.fcntl(number, fcntl.F_SETFL, file[2])


def _file(number: int) -> tuple[int, ...]:
    """Return which file a stream is, and how it was opened; nothing where it is closed."""
    try:
        status = os.fstat(number)
        if os.name != "posix":
            return status.st_dev, status.st_ino
        import fcntl

        return status.st_dev, status.st_ino, fcntl.fcntl(number, fcntl.F_GETFL)
    except OSError:
        return ()


def threads() -> set[int]:
    """Return the threads of this process that Python does not know; none where the system does not list them."""
    try:
        listed = set(map(int, os.listdir("/proc/self/task")))
    except OSError:
        return set()
    return listed - {one.native_id for one in threading.enumerate() if one.native_id is not None}


def _arithmetic() -> Arithmetic | None:
    registers = _REGISTERS.get((platform.system(), platform.machine()))
    with suppress(OSError):
        return Arithmetic(registers) if registers else None
    return None


ARITHMETIC = _arithmetic()
"""The arithmetic; None where its registers are not known or cannot be read."""
PROPERTIES = _properties()
"""What this platform lets Python read and put back, without signals and streams."""
