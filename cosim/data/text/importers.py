"""Exports of machines' own tools that a plain table of text is not: each is recognised by its first lines.

They are plugged in: modules with `recognises(lines)` and `read(path, whole, lines)`, see `cosim.support.plugins`.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

from cosim.data.columns import Columns
from cosim.support.plugins import IMPORTERS, loaded, names

Importer = Callable[[Path, bytes, Sequence[str]], Columns]
"""From the path, the whole text and its first lines to columns."""


def importer_of(lines: Sequence[str]) -> Importer | None:
    """Return what reads a text that begins with these lines, or None if it is a plain table.

    Raises:
        PlugInError: one cannot be loaded; its texts would be read as tables of something else.
    """
    return next(
        (one.read for one in (loaded(IMPORTERS, name) for name in names(IMPORTERS)) if one.recognises(lines)), None
    )
