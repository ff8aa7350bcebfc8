"""The process that looks at files, one after the other; a file that kills it costs a sentence."""

from collections.abc import Callable
from threading import Lock
from typing import Any

from cosim.support.cell import Cell, LostError
from cosim.support.plain import Parsed
from cosim.support.system_errors import surroundings
from cosim_serve import looks
from cosim_serve.job import Options

LONGEST = 120.0
"""Seconds that looking at a file may take; 1 GB of text takes some 60 s."""


class Reader:
    """Looks at files in a process of its own, which stays for the next one."""

    def __init__(self) -> None:
        self._cell, self._lock, self._closed = Cell(), Lock(), False

    def look(self, path: str, options: Options) -> Parsed:
        """Tell what a recording holds, or its problem (OSError: the system refuses to look)."""
        return self._call(looks.look, path, options)

    def card(self, text: str, name: str) -> Parsed:
        """Tell what a card says, or its problem."""
        return self._call(looks.look_at_card, text, name)

    def estimate(self, given: list[tuple[str, Options]]) -> Parsed:
        """Estimate a card from recordings: {"text": ...}, or its problem."""
        return self._call(looks.estimated_card, given)

    def warm(self) -> None:
        """Start the process before the first file comes."""
        with self._lock:
            self._cell.begin()

    def pid(self) -> int:
        """Return the number of the process, 0 if there is none."""
        return self._cell.pid

    def close(self) -> None:
        """End the process; nothing is looked at any more."""
        self._closed = True
        self._cell.close()

    def _call(self, function: Callable[..., Parsed], *arguments: Any) -> dict[str, Any]:
        with self._lock:
            if self._closed:
                return {"problem": "This file was not looked at: the server has ended."}
            try:
                told: Parsed = self._cell.call(function, *arguments, timeout=LONGEST)
                return told
            except (LostError, KeyboardInterrupt) as error:
                return {"problem": f"This file could not be read; the process that read it is gone. {error}"}
            except MemoryError as error:
                return {"problem": f"This file could not be read. {surroundings(error)}"}
