"""Any text to columns: an export that is recognised, or a plain table whose layout is found out."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cosim.data.columns import Columns
from cosim.data.limits import check_cells, check_columns, short
from cosim.data.text import json_records, transposed
from cosim.data.text.cells import with_quotes, without_brackets, without_remarks, without_units
from cosim.data.text.encoding import text_of
from cosim.data.text.layout import find_layout
from cosim.data.text.table import table_of
from cosim.data.text.vocabulary import with_vocabulary
from cosim.support.errors import RecordingError
from cosim.support.plugins import IMPORTERS, loaded, names

LEAST = 10
"""Lines of one number each that are a column; fewer are a preamble or a setting."""
LINES, HEAD = 400, 1 << 20
"""Lines, and bytes, from which a layout is found out."""


def read_text(path: Path, stated: Mapping[str, str] | None = None) -> Columns:
    """Read a table of text.

    Args:
        path: the file, also .gz.
        stated: what `--layout` says; see `find_layout`, and `encoding`.

    Raises:
        RecordingError: it is no table, or can be read in two ways; the message names the option that decides.
    """
    data, encoding = text_of(path, (stated or {}).get("encoding", ""))
    if json_records.is_records(data):
        return json_records.columns_of(path, data)
    if turned := transposed.read(path, data):
        return turned
    _check_first_line(path, data)
    lines = head_of(data)
    if not stated and (importer := _importer_of(lines)):
        return importer(path, data, lines)
    data = without_brackets(without_remarks(data), lines)
    data = with_quotes(data, lines)
    data, units = without_units(path, data, head_of(data))
    lines = head_of(data)
    layout = find_layout(path, lines, stated or {})
    if layout is None:
        return _one_column(path, data) or _nothing(path, lines)
    layout = replace(layout, labels=units) if len(units) == layout.count else layout
    told = f"{layout}{'' if encoding == 'utf-8' else f', {encoding}'}"
    return with_vocabulary(replace(table_of(path, data, layout), layout=told))


def _importer_of(lines: Sequence[str]) -> Callable[[Path, bytes, Sequence[str]], Columns] | None:
    """Return what is plugged in for a text that begins with these lines; None for a plain table.

    Raises:
        PlugInError: one cannot be loaded; its texts would be read as tables of something else.
    """
    plugged = (loaded(IMPORTERS, name) for name in names(IMPORTERS))
    return next((one.read for one in plugged if one.recognises(lines)), None)


def head_of(data: bytes) -> list[str]:
    """Return the first lines of a text; a line that the head cuts is left out."""
    head = data[:HEAD]
    whole = head if len(data) <= HEAD else head[: head.rfind(b"\n") + 1] or head
    return [line.rstrip("\r") for line in whole.decode("utf-8", "replace").split("\n")[:LINES]]


def _check_first_line(path: Path, data: bytes) -> None:
    """Refuse a line of more fields than a table may have columns before it is cut into them."""
    line = data[: data.find(b"\n")] if b"\n" in data[:HEAD] else data[: 50 * HEAD].partition(b"\n")[0]
    check_columns(path, 1 + max(line.count(sign) for sign in (b",", b";", b"\t")))


def _one_column(path: Path, data: bytes) -> Columns | None:
    """Return a text of one number a line as a column without a name; None for any other."""
    check_cells(path, data.count(b"\n"), 1)  # before each becomes an object
    values = data.split()
    if len(values) < LEAST or len(values) != sum(bool(line.strip()) for line in data.split(b"\n")):
        return None
    try:
        column = np.array(values, np.float64)
    except ValueError:
        return None
    note = f"{path.stem}: it is one column of numbers, a value a line; signals that take turns in it cannot be parted."
    return Columns({"#1": column}, numbered=True, notes=(note,), layout="one column")


def _nothing(path: Path, lines: Sequence[str]) -> Columns:
    """Refuse what holds no line of values; names alone mean that nothing was recorded."""
    if sum(bool(line.strip()) for line in lines) <= 1:
        return Columns({})
    text = f"{path} holds no table of numbers; its first line is: {short(lines[0])!r}. --layout says how it is written."
    raise RecordingError(text, culprit=str(path))
