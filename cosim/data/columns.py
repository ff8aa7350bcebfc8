"""What a file holds before anything is judged: columns by name, units and origin where they are stated."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.support.errors import RecordingError
from cosim.support.plain import JsonObject

Array = npt.NDArray[np.float64]
ORIGIN_KEY = b"cosim.origin"
"""Key of a Parquet file's metadata under which the origin stands, as JSON."""
UNIT_KEY = b"unit"
"""Key of a field's metadata under which the unit of a column stands."""


@dataclass(frozen=True)
class Columns:
    """Columns by name, as a file has them; of equal length unless they have clocks.

    A column is float64; int64 where a double would lose digits; datetime64 or timedelta64 for time stamps; object
    where the file holds text.

    Args:
        values: the columns, in the order of the file.
        units: units that the file states for columns by name, as it writes them.
        origin: what the file says of where it comes from.
        format: name of the tool that wrote the file, where its export was recognised ("TwinCAT Scope").
        layout: how a text was read, in words; empty for a binary file.
        start: time of the first sample as an ISO text, where the file states one.
        roles: columns whose meaning the format fixes, {"q": "POSITION"}; they need no guess.
        lacks: why there is no column of a meaning, {"tau": "a guide log holds no torque"}.
        notes: sentences on what was left out.
        missing: those of the notes that say that rows were left out: what is left is not evenly spaced.
        rows: which rows of the file these are, where they are one recording of many: "4,378 to 8,755".
        numbered: the file names no columns; they are called #1, #2 ...
        restarts: rows (from 0) before which the names of the columns stand again: a logger that was started anew.
        clocks: times [s] of the samples of channels by name, where channels have times of their own: those of one
            clock share the array, no column is the time, and NaN is an invalid sample. Lengths may then differ;
            `cosim.data.joining` makes a table of them.
        contradictions: units that two places of the file state differently, by the name of the column.
        header: the line above the samples of a text whose names do not fit its columns, which are numbered then.
    """

    values: dict[str, np.ndarray]
    units: dict[str, str] = field(default_factory=dict)
    origin: JsonObject = field(default_factory=dict)
    format: str = ""
    layout: str = ""
    start: str = ""
    roles: dict[str, str] = field(default_factory=dict)
    lacks: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    rows: str = ""
    numbered: bool = False
    restarts: tuple[int, ...] = ()
    clocks: dict[str, np.ndarray] = field(default_factory=dict)
    contradictions: dict[str, tuple[str, str]] = field(default_factory=dict)
    header: str = ""


@dataclass(frozen=True)
class Request:
    """What is wanted of a file: which recording of it, what the user says of it, and the columns that are needed.

    Args:
        path: the file, and which recording of it; messages and notes name it.
        columns: what the user says of names, ours to the file's; `#3` is the third column.
        units: what the user says of units, by our name.
        layout: what the user says of rows: `period`, their distance where there is no time; `nan` ("gap"), which leaves
            out those in which a column that is needed has no value; `repeated` ("first", "last"), which of those of one
            time that differ is kept: none is left out without.
        required: columns that are needed, `q|v` for one of two; nothing but the time where it is empty.
    """

    path: Path
    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    layout: Mapping[str, str] = field(default_factory=dict)
    required: tuple[str, ...] = ()


def doubles(chunks: Sequence[Any]) -> np.ndarray:
    """Look at chunks of Arrow doubles without nulls; `to_numpy` would import pandas, a third of a second of a verb."""
    parts = [np.frombuffer(one.buffers()[1], np.float64, len(one), 8 * one.offset) for one in chunks if len(one)]
    return parts[0] if len(parts) == 1 else np.concatenate([np.empty(0), *parts])


def as_columns(name: str, table: Mapping[str, npt.ArrayLike]) -> dict[str, np.ndarray]:
    """Return the columns as arrays of one length; raises RecordingError where shapes differ."""
    values = {str(key): _array(column) for key, column in table.items()}
    shapes = {key: column.shape for key, column in values.items()}
    first = next(iter(shapes.values()), ())
    for key, shape in shapes.items():
        if len(shape) != 1 or shape != first:
            rule = f'as "{next(iter(shapes))}" has {first}; every column needs the shape (rows,)'
            raise RecordingError(f'{name}: column "{key}" has the shape {shape}, {rule}.', culprit=name, value=shape)
    return values


def sha256_of(values: Mapping[str, np.ndarray]) -> str:
    """Return the SHA-256 of names and values, so that a table can be told from another."""
    digest = hashlib.sha256()
    for key, column in values.items():
        digest.update(f"{key} {column.dtype.str} {column.shape}\n".encode())
        plain = column.dtype != object
        digest.update(np.ascontiguousarray(column).tobytes() if plain else repr(column.tolist()).encode())
    return digest.hexdigest()


def _array(column: Any) -> np.ndarray:
    """Numbers as they are; text that says numbers as these; dates and all else as texts, as a file would hold them."""
    array = np.asarray(column)
    if array.dtype.kind in "biuf":
        return array
    try:
        return array.astype(np.float64) if array.dtype.kind in "OUS" else array.astype(str).astype(object)
    except (TypeError, ValueError):
        return array.astype(object)
