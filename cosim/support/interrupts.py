"""Ctrl-C and termination between pieces of work, never inside one: rows that are being written are written once."""

import os
import signal
import sys
import threading
from _thread import interrupt_main
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import FrameType
from typing import Any

ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that ask a process to end, beside Ctrl-C."""

AGAIN = 0.01
"""Seconds until a signal is raised again that came where exceptions are lost; by then it has left that place."""
FORGETFUL = f"{os.sep}casadi{os.sep}"
"""In the path of code that loses exceptions: CasADi asks a value for its shape, in Python, and takes an error for a no.
Of 150 signals into a search four were lost there."""


class Terminated(KeyboardInterrupt):
    """The process was asked to end; files are completed on the way out, as after Ctrl-C."""


_HEARD: list[int] = []
"""Signals that asked this process to end since `end_well`."""


def end_well() -> None:
    """Let SIGTERM (and SIGHUP) end this process as Ctrl-C does, so that no file is left half written."""
    _HEARD.clear()
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, *ENDING):
            if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
                signal.signal(number, _end)
        if not isinstance(sys.unraisablehook, _Heard):
            sys.unraisablehook = _Heard(sys.unraisablehook)


def is_interrupted() -> bool:
    """Whether this process was asked to end, by Ctrl-C or otherwise: an error that comes then may be only that."""
    return bool(_HEARD)


def is_terminated() -> bool:
    """Whether this process was asked to end by a signal that is not Ctrl-C."""
    return any(number != signal.SIGINT for number in _HEARD)


def _end(number: int, frame: FrameType | None) -> None:
    _HEARD.append(number)
    if _is_lost(frame):
        _again(number)
        return
    raise KeyboardInterrupt if number == signal.SIGINT else Terminated


def _is_lost(frame: FrameType | None) -> bool:
    """Whether an exception that is raised here may never arrive."""
    while frame:
        if FORGETFUL in frame.f_code.co_filename:
            return True
        frame = frame.f_back
    return False


def _again(number: int) -> None:
    """Raise a signal again in a moment."""
    again = threading.Timer(AGAIN, _raise_again, [number])
    again.daemon = True
    with suppress(RuntimeError):  # no thread begins while Python ends, and it does end
        again.start()


@dataclass(frozen=True)
class _Heard:
    """Hook of exceptions that Python ignores, as of finalizers and of weak references: a signal is no such exception.

    Printed and forgotten, as the hook `before` would do it, the command went on to its end.
    """

    before: Callable[[Any], object]

    def __call__(self, ignored: Any) -> None:
        if not (_HEARD and issubclass(ignored.exc_type, KeyboardInterrupt)):
            self.before(ignored)
            return
        _again(_HEARD[-1])


def _raise_again(number: int) -> None:
    if os.name == "posix":
        os.kill(os.getpid(), number)  # wakes what the main thread waits in
    else:
        interrupt_main(signal.Signals(number))


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Hold these signals back until the block has ended well; threads other than the main one never meet them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[int] = []
    numbers = [one for one in (signal.SIGINT, *ENDING) if signal.getsignal(one) is not None]
    before = {one: signal.signal(one, lambda number, frame: held.append(number)) for one in numbers}
    try:
        yield
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)
    for one in held[:1]:
        signal.raise_signal(one)
