"""Tables in memory: columns given as arrays, made ready to be judged as those of a file are."""

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.support.errors import RecordingError


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
