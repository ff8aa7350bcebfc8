"""Exports of machines' own tools that a plain table of text is not: each is recognised by its first lines."""

from collections.abc import Callable, Sequence
from pathlib import Path

from cosim.data.columns import Columns
from cosim.data.importers import epics, halscope, phd2, twincat

Importer = Callable[[Path, bytes, Sequence[str]], Columns]
"""From the path, the whole text and its first lines to columns."""
IMPORTERS = (twincat, halscope, phd2, epics)


def importer_of(lines: Sequence[str]) -> Importer | None:
    """Return what reads a text that begins with these lines, or None if it is a plain table."""
    return next((one.read for one in IMPORTERS if one.recognises(lines)), None)
