"""What the command line says and where: data on stdout, everything else on stderr.

Progress bars appear on a terminal only; elsewhere each stage is one line. NO_COLOR and TERM=dumb are honoured.
"""

import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console

USUAL = 25
"""Steps told in words that a stage usually has: where the bar is full."""


def messages() -> Console:
    """Return a console on stderr."""
    return Console(stderr=True, highlight=False, soft_wrap=True)


def say(text: str) -> None:
    """Write a message to stderr."""
    messages().print(text, markup=False)


def put(text: str) -> None:
    """Write data to stdout."""
    Console(highlight=False, soft_wrap=True).print(text, markup=False)


def put_json(data: Any) -> None:
    """Write data to stdout as one JSON document."""
    sys.stdout.write(json.dumps(data, indent=2) + "\n")


def keep_stdout() -> None:
    """Leave stdout to data alone: what FMUs of others print from C goes to stderr from here on."""
    given = sys.__stdout__
    if given and sys.stdout is given and given.fileno() == 1:
        sys.stdout = os.fdopen(os.dup(1), "w", encoding=given.encoding, errors=given.errors)
        os.dup2(2, 1)


class Stage:
    """A stage under way: call it with (done, of), or `tell` it in words what is being done; silent off a terminal."""

    def __init__(self, show: Callable[..., None] = lambda **_: None) -> None:
        self._show, self._told = show, 0

    def __call__(self, done: int, of: int) -> None:
        """Show how much is done."""
        self._show(completed=done, total=of)

    def tell(self, text: str) -> None:
        """Show what is being done, and that one thing more has been done."""
        self._told += 1
        self._show(description=text, completed=self._told, total=max(USUAL, self._told + 1))


@contextmanager
def stage(title: str) -> Iterator[Stage]:
    """Show that a stage is under way; what this yields shows how it goes on."""
    console = messages()
    if not console.is_terminal or console.is_dumb_terminal:
        console.print(title, markup=False)
        yield Stage()
        return
    from rich.progress import Progress as Bar

    with Bar(console=console, transient=True) as bar:
        task = bar.add_task(title, total=None)
        yield Stage(lambda **changes: bar.update(task, **changes))
