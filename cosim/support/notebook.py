"""Progress in a notebook: one line below the cell that is written over, and gone at the end."""

import sys
import time
from collections.abc import Callable
from functools import wraps
from importlib import import_module
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")
PAUSE = 0.2
"""Seconds between two changes of the line: a browser draws each."""


def shows_progress(
    says: Callable[..., str] = lambda text: str(text),
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Make a function that has `on_progress` show it as a line in a notebook, where nobody else listens.

    Args:
        says: makes a text of what `on_progress` is called with.
    """

    def made(function: Callable[P, R]) -> Callable[P, R]:
        @wraps(function)
        def shown(*given: P.args, **named: P.kwargs) -> R:
            display = None if "on_progress" in named else _notebook()
            if display is None:
                return function(*given, **named)
            line = _Line(display)
            named["on_progress"] = lambda *given: line.tell(says(*given))
            try:
                return function(*given, **named)
            finally:
                line.show("")

        return shown

    return made


def _notebook() -> Any:
    """Return the `display` of a notebook, None where there is none; loads nothing that is not there already."""
    module = sys.modules.get("IPython")
    shell = module.get_ipython() if module is not None and hasattr(module, "get_ipython") else None
    if shell is None or "IPKernelApp" not in getattr(shell, "config", {}):
        return None
    return import_module("IPython.display").display


class _Line:
    """A line that is written over."""

    def __init__(self, display: Callable[..., Any]) -> None:
        self._handle = display({"text/plain": ""}, raw=True, display_id=True)
        self._last = 0.0

    def tell(self, text: str) -> None:
        """Write the line, unless it was written just now."""
        if time.monotonic() - self._last >= PAUSE:
            self.show(text)

    def show(self, text: str) -> None:
        """Write the line."""
        self._last = time.monotonic()
        if self._handle is not None:
            self._handle.update({"text/plain": text}, raw=True)
