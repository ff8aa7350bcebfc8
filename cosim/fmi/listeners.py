"""Around FMPy: who hears what an FMI 2.0 instance says, and a working directory that stays."""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from itertools import count
from threading import Lock
from typing import Any, Protocol
from weakref import WeakValueDictionary


class Listener(Protocol):
    """A component that keeps what its FMU says."""

    def hear(self, message: bytes | None) -> None:
        """Keep a message."""


_NUMBERS = count(1)
_DIRECTORY = Lock()
_LISTENERS: WeakValueDictionary[str, Listener] = WeakValueDictionary()
"""By instance name; FMPy's logger can serve only one callback a process."""


def registered(listener: Listener, name: str) -> str:
    """Return an instance name of its own, under which the listener hears what is said."""
    instance = f"{name}.{next(_NUMBERS)}"
    _LISTENERS[instance] = listener
    return instance


@contextmanager
def same_directory() -> Iterator[None]:
    """Come back to the working directory, which FMPy leaves for good when a library does not load.

    One thread at a time: the directory is that of the whole process.
    """
    with _DIRECTORY:
        here = os.getcwd()
        try:
            yield
        finally:
            os.chdir(here)


def _tell(_: Any, name: bytes | None, status: int, category: bytes, message: bytes | None) -> None:
    """Pass on what an FMI 2.0 instance says."""
    listener = _LISTENERS.get((name or b"").decode("utf-8", "replace"))
    if listener is not None:
        listener.hear(message)


@cache
def callbacks2() -> Any:
    """Callbacks of FMI 2.0 that collect what the FMUs say; FMPy's own would print it on stdout."""
    from fmpy.fmi2 import defaultCallbacks, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
    from fmpy.logging import addLoggerProxy

    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(_tell)
    callbacks.allocateMemory, callbacks.freeMemory = defaultCallbacks.allocateMemory, defaultCallbacks.freeMemory
    with suppress(Exception):  # without the proxy, messages come with their printf formats unfilled
        addLoggerProxy(ctypes.byref(callbacks))
    return callbacks
