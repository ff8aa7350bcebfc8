"""What the command line says and where: data on stdout, everything else on stderr.

Progress bars appear on a terminal only; elsewhere each stage is one line. NO_COLOR and TERM=dumb are honoured.
"""

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console

Progress = Callable[[int, int], None]


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


@contextmanager
def stage(title: str) -> Iterator[Progress]:
    """Show that a stage is under way; call what this yields with (done, of) as it goes on."""
    console = messages()
    if not console.is_terminal or console.is_dumb_terminal:
        console.print(title, markup=False)
        yield lambda done, of: None
        return
    from rich.progress import Progress as Bar

    with Bar(console=console, transient=True) as bar:
        task = bar.add_task(title, total=None)
        yield lambda done, of: bar.update(task, completed=done, total=of)
