"""What the command line says and where: data on stdout, everything else on stderr.

Progress bars appear on a terminal only; elsewhere each stage is one line. NO_COLOR and TERM=dumb are honoured.
"""

import codecs
import io
import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from rich.console import Console

WRITABLE = "cosim-writable"
"""Name of the way in which text is written that an encoding has no letters for."""
USUAL = 25
"""Steps told in words that a stage usually has: where the bar is full."""
_ONCE_BEGUN: list[str] = []
"""What is said once work has begun, and not where it is refused."""


def messages() -> Console:
    """Return a console on stderr."""
    return Console(stderr=True, highlight=False, soft_wrap=True, emoji=False)  # `position=1:-1:` is what was given


def say(text: str) -> None:
    """Write a message to stderr."""
    messages().print(text, markup=False)


def say_once_begun(*texts: str) -> None:
    """Keep messages for stderr, in the place of those that are kept, until a stage goes on or there are results."""
    _ONCE_BEGUN[:] = texts


def begun() -> None:
    """Say what is kept: the work was not refused."""
    kept = tuple(_ONCE_BEGUN)
    _ONCE_BEGUN.clear()
    for text in kept:
        say(text)


def put(text: str) -> None:
    """Write data to stdout."""
    begun()
    Console(highlight=False, soft_wrap=True, emoji=False).print(text, markup=False)


def put_json(data: Any) -> None:
    """Write data to stdout as one JSON document."""
    begun()
    sys.stdout.write(json.dumps(data, indent=2) + "\n")


def keep_stdout() -> None:
    """Leave stdout to data alone: what FMUs of others print from C goes to stderr from here on.

    What a terminal or pipe has no letters for is written as an escape, whatever the language of the system.
    """
    codecs.register_error(WRITABLE, _writable)
    _open_what_is_closed()
    given = sys.__stdout__
    if given and sys.stdout is given and given.fileno() == 1:
        sys.stdout = os.fdopen(os.dup(1), "w", encoding=given.encoding, errors=WRITABLE)
        os.dup2(2, 1)
    if isinstance(sys.stderr, io.TextIOWrapper):
        sys.stderr.reconfigure(errors=WRITABLE)


def _open_what_is_closed() -> None:
    """Put something in the place of standard files that are closed, which the next file that is opened would take.

    To write to such a stdout is an error, as to one that is full.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDONLY if number == 1 else os.O_RDWR)  # takes the lowest number that is free
            os.set_inheritable(number, True)
    if sys.stdout is None:
        sys.stdout = os.fdopen(1, "w", encoding="utf-8", errors=WRITABLE, closefd=False)


def _writable(error: UnicodeError) -> tuple[str | bytes, int]:
    """Encode what an encoding cannot: a file name's own bytes as they are, anything else as an escape."""
    assert isinstance(error, UnicodeEncodeError)
    try:
        return codecs.lookup_error("surrogateescape")(error)
    except UnicodeEncodeError:
        return codecs.lookup_error("backslashreplace")(error)


def finish_stdout() -> None:
    """Write what is still to be written to stdout; after an error nothing is tried again at the end (OSError)."""
    try:
        sys.stdout.flush()
    except OSError:
        abandon_stdout()
        raise


def abandon_stdout() -> None:
    """Let go of a stdout that cannot be written."""
    with suppress(OSError, ValueError, io.UnsupportedOperation):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


class Stage:
    """A stage under way: call it with (done, of), or `tell` it in words what is being done; silent off a terminal."""

    def __init__(
        self, show: Callable[..., None] = lambda **_: None, line: Callable[[str], None] = lambda _: None
    ) -> None:
        self._show, self._print, self._told = show, line, 0

    def __call__(self, done: int, of: int) -> None:
        """Show how much is done."""
        begun()
        self._show(completed=done, total=of, counted=True)

    def tell(self, text: str) -> None:
        """Show what is being done, and that one thing more has been done."""
        if self._told:  # something was done, and not refused
            begun()
        self._told += 1
        self._show(description=text, completed=self._told, total=max(USUAL, self._told + 1))

    def log(self, text: str) -> None:
        """Tell what is being done in a line that stays, also off a terminal."""
        self._print(text)
        self.tell(text)


@contextmanager
def stage(title: str) -> Iterator[Stage]:
    """Show that a stage is under way; what this yields shows how it goes on."""
    console = messages()
    if not console.is_terminal or console.is_dumb_terminal:
        console.print(title, markup=False)
        yield Stage(line=say)
        return
    from cosim.support.bar import bar

    with bar(console=console, transient=True) as shown:
        task = shown.add_task(title, total=None)
        yield Stage(lambda **changes: shown.update(task, **changes), lambda text: console.print(text, markup=False))
