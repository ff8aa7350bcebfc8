"""Time series in CSV as FMI's tools write them: first column `time`, then variables by name.

A cell holds a number, true or false, text, hexadecimal digits of a binary, or the elements of an array with blanks
between them.
"""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.fmi.component import Port
from cosim.fmi.description import complaint_of
from cosim.fmi.types import OPAQUE, elements, indexed
from cosim.support.archive import read
from cosim.support.errors import FmuError

Array = npt.NDArray[np.float64]
TIME = "time"
HEAD = 512
"""Bytes among which a binary file has a zero."""
_TRUTHS = {"true": 1.0, "false": 0.0}


@dataclass(frozen=True)
class Series:
    """A table in time: numbers of shape (rows,) by scalar or element, texts by variable, and columns of no variable."""

    times: Array
    numbers: Mapping[str, Array]
    texts: Mapping[str, tuple[str, ...]]
    strange: tuple[str, ...]


def series_of(path: Path, member: str, ports: Mapping[str, Port]) -> Series:
    """Read a time series of an FMU's archive.

    Raises:
        FmuError: it is not there, has no time that grows, or a cell is no value of its variable.
    """
    content = read(path, member, complaint_of(path))
    if b"\0" in content[:HEAD]:
        kind = "HDF5" if content.startswith(b"\x89HDF") else "of no known kind"
        rule = 'a table as text, with the first column "time", is read in its place'
        raise FmuError(f"{path}: {member} is no CSV but binary ({kind}); {rule}.", culprit=member)
    text = content.decode("utf-8-sig", "replace")
    rows = [row for row in csv.reader(StringIO(text)) if row]
    if len(rows) < 2 or rows[0][0].strip().lower() != TIME:
        raise FmuError(f'{path}: {member} is no time series: its first column must be "time".', culprit=member)
    names = [name.strip() for name in rows[0]]
    twice = next((name for k, name in enumerate(names) if name in names[:k]), None)
    if twice is not None:
        raise FmuError(f'{path}: {member} has two columns "{twice}"; one is enough.', culprit=member, value=twice)
    for number, row in enumerate(rows[1:], 2):
        if len(row) != len(names):
            rule = f"line {number} has {len(row)} cells, and there are {len(names)} columns"
            raise FmuError(f"{path}: {member}: {rule}.", culprit=member)
    columns = {name: [row[k].strip() for row in rows[1:]] for k, name in enumerate(names)}
    times = _numbers(path, member, names[0], columns[names[0]])
    if np.any(np.diff(times) < 0):
        raise FmuError(f"{path}: {member}: the time must not go back.", culprit=member)
    numbers: dict[str, Array] = {}
    texts: dict[str, tuple[str, ...]] = {}
    for name in names[1:]:
        port = ports.get(name)
        if port is None:
            continue
        if port.type in OPAQUE:
            texts[name] = tuple(columns[name])
        elif port.shape:
            numbers |= _elements(path, member, port, columns[name])
        else:
            numbers[name] = _numbers(path, member, name, columns[name])
    return Series(times, numbers, texts, tuple(name for name in names[1:] if name not in ports))


def _elements(path: Path, member: str, port: Port, cells: list[str]) -> dict[str, Array]:
    places = [indexed(port.name, index) for index in elements(port.shape)]
    parts = [cell.split() for cell in cells]
    wrong = next((k for k, one in enumerate(parts) if len(one) != len(places)), None)
    if wrong is not None:
        rule = f"{port.name} has {len(places)} elements, and line {wrong + 2} has {len(parts[wrong])}"
        raise FmuError(f"{path}: {member}: {rule}.", culprit=port.name)
    return {name: _numbers(path, member, name, [one[k] for one in parts]) for k, name in enumerate(places)}


def _numbers(path: Path, member: str, name: str, cells: list[str]) -> Array:
    values = []
    for line, cell in enumerate(cells, 2):
        try:
            values.append(_TRUTHS[cell.lower()] if cell.lower() in _TRUTHS else float(cell))
        except ValueError:
            text = f'{path}: {member}: {name} in line {line} is "{cell}"; it must be a number.'
            raise FmuError(text, culprit=name, value=cell) from None
    return np.array(values, dtype=np.float64)
