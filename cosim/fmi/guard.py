"""Foreign code leaves this process as it found it: what it changed is put back, and named.

    guard = Guard()
    with guard.kept():
        ...                    # an FMU is loaded, initialised, stepped, freed
    guard.notes()              # ["changed the working directory; restored"]

An FMU, or a function of the user's, runs in the process of the loop. Whatever it changes there (working directory,
umask, locale, environment, signals, standard streams, limits, rounding) would change other components and this program.
Within the loop the C code looks at the arithmetic after each call (foreign.h); the rest is looked at after each chunk.
"""

import ctypes
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from signal import Signals
from typing import Any

from cosim.fmi.handlers import HANDLERS, Handling, changed_signals
from cosim.fmi.process import ARITHMETIC, PROPERTIES, Property, in_words, streams_kept, threads

PATIENCE = 0.2
"""Seconds that a thread has to end which was told to."""


class Guard:
    """Puts back what foreign code changes, and remembers it; each component has one."""

    def __init__(self) -> None:
        self._cell = ctypes.c_int64()
        self._arithmetic = ARITHMETIC.read() if ARITHMETIC else []
        self._put_back: dict[str, None] = {}
        self._stuck: dict[str, None] = {}
        self._installed: dict[int, tuple[bytes, int | None]] = {}
        self._handled: dict[int, None] = {}
        self._threads = threads()
        self._left = 0

    @property
    def address(self) -> int:
        """Where the C loop notes what a call changed of the arithmetic."""
        return ctypes.addressof(self._cell)

    def after(self, status: int) -> int:
        """Put the arithmetic back behind a call that Python made, and return its status; foreign.h does so in C."""
        if ARITHMETIC is not None and (now := ARITHMETIC.read()) != self._arithmetic:
            self._cell.value |= ARITHMETIC.changed(self._arithmetic, now)
            ARITHMETIC.restore(self._arithmetic)
        return status

    def watched(self, call: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that calls another one and puts the arithmetic back."""

        def called(*arguments: Any) -> Any:
            try:
                return call(*arguments)
            finally:
                self.after(0)

        return called

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Put back at the end of the block what was changed in it."""
        before = [one.read() for one in PROPERTIES]
        handlers: Any = HANDLERS.read() if HANDLERS else None
        with streams_kept(self._changed):
            try:
                yield
            finally:
                for one, value in zip(PROPERTIES, before, strict=True):
                    self._compare(one, value)
                if HANDLERS:
                    self._leave(handlers, self._compare(HANDLERS, handlers))

    def release(self) -> None:
        """Put back the handlers that were left to a component which is closed now, as far as they are still its own."""
        if HANDLERS is None:
            return
        now = HANDLERS.read()
        for number, (before, installed) in self._installed.items():
            if now.addresses[number] == installed:
                HANDLERS.put(number, before)
        self._installed.clear()

    def left_threads(self) -> bool:
        """Say whether threads that came into being since this guard are still running."""
        until = time.monotonic() + PATIENCE
        while (left := len(threads() - self._threads)) and time.monotonic() < until:
            time.sleep(0.01)
        self._left = left
        return left > 0

    def notes(self) -> list[str]:
        """Say in sentences without a subject what was changed and what became of it."""
        found = []
        back = [*self._put_back, *(one for one in in_words(self._cell.value) if one not in self._put_back)]
        if back:
            found.append(f"changed {_listed(back)}; restored")
        if self._stuck:
            found.append(f"changed {_listed([*self._stuck])}, which could not be restored")
        signals = [Signals(number).name for number in self._handled if number]
        if signals:
            found.append(f"handles {_listed(signals)} itself until it is closed; then restored")
        if self._left:
            found.append(f"left {self._left} thread{'s' * (self._left > 1)} running; its library stays loaded")
        return found

    def _compare(self, one: Property, before: Any) -> Any:
        """Put a property back where it differs, and remember it; returns what it was after the block."""
        now = one.read()
        names = one.say(before, now) if now != before else []
        if names:
            with suppress(Exception):  # whatever the system says, what counts is whether it is as before
                one.restore(before)
            still = one.say(before, again) if (again := one.read()) != before else []
            for name in names:
                self._changed(name, back=name not in still)
        return now

    def _leave(self, before: Handling, now: Handling) -> None:
        """Remember which handlers are left to the component, with those before its first."""
        for number in changed_signals(before, now):
            first = self._installed.get(number, (before.of(number), None))[0]
            self._installed[number], self._handled[number] = (first, now.addresses[number]), None

    def _changed(self, name: str, back: bool = True) -> None:
        (self._put_back if back else self._stuck)[name] = None


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))
