"""Files of NumPy: `.npz` archives of arrays by name, and `.npy`, one array without a name.

A vector is a column, a table (rows, k) is k columns; fields of a structured array are columns. Pickled objects are
programs and are never loaded. A text vector as long as a table is wide names its columns.
"""

import zipfile
from collections.abc import Mapping
from dataclasses import replace
from math import prod
from pathlib import Path
from typing import IO

import numpy as np
from numpy.lib import format as npy

from cosim.data.binary.channels import columns_of_arrays, is_table, vectors
from cosim.data.columns import Columns
from cosim.data.limits import check_columns, check_unpacked, listed
from cosim.support.errors import RecordingError

TEXTS = "US"
"""Kinds of arrays that hold text."""


def read(path: Path) -> Columns:
    """Read an archive of arrays, or one array.

    Raises:
        RecordingError: it holds no array of numbers, or unpacks to more than a file of its size may.
    """
    return _archive(path) if path.suffix.lower() == ".npz" else _single(path)


def _archive(path: Path) -> Columns:
    found: dict[str, np.ndarray] = {}
    pickled: list[str] = []
    with zipfile.ZipFile(path) as archive:
        members = {one.filename.removesuffix(".npy"): one for one in archive.infolist() if not one.is_dir()}
        check_columns(path, len(members))
        check_unpacked(path, sum(one.file_size for one in members.values()))
        for name, member in members.items():
            with archive.open(member) as file:
                array = _array(path, file, member.file_size)
            found |= {} if array is None else _fields(name, array)
            pickled += [name] if array is None else []
    if not any(value.dtype.kind in "fiub" and value.ndim for value in found.values()):
        text = f"{path} holds no arrays of numbers; it holds: {listed(tuple(members))}."
        raise RecordingError(text, culprit=str(path))
    columns = columns_of_arrays(path, _named(found), {})
    note = f"{path.stem}: pickled objects were left out, as they are programs: {listed(tuple(pickled))}."
    return replace(columns, notes=(note, *columns.notes)) if pickled else columns


def _single(path: Path) -> Columns:
    with path.open("rb") as file:
        array = _array(path, file, path.stat().st_size)
    if array is None:
        text = f"{path} holds pickled objects, which are programs and are not loaded; save arrays of numbers instead."
        raise RecordingError(text, culprit=str(path))
    if array.dtype.names:
        return Columns(vectors(path, _fields("", array)))
    columns = vectors(path, {"": array})
    return Columns({f"#{k}": column for k, column in enumerate(columns.values(), 1)}, numbered=True)


def _array(path: Path, file: IO[bytes], size: int) -> np.ndarray | None:
    """Return an array whose header claims no more than its bytes hold; None for pickled objects."""
    version = npy.read_magic(file)
    header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, by_columns, kind = header(file)
    if kind.hasobject:
        return None
    check_unpacked(path, prod(shape) * kind.itemsize)
    data = file.read(size)
    count = prod(shape)
    if len(data) < count * kind.itemsize:
        text = f"{path} ends after {len(data):,} of {count * kind.itemsize:,} bytes of an array of shape {shape}."
        raise RecordingError(text, culprit=str(path))
    array = np.frombuffer(data, kind, count) if count else np.empty(0, kind)
    return array.reshape(shape, order="F" if by_columns else "C")


def _fields(name: str, array: np.ndarray) -> dict[str, np.ndarray]:
    """Return the fields of a structured array, or the array; names of an archive lead where there are several."""
    if not array.dtype.names:
        return {name: array}
    lead = f"{name}." if name else ""
    return {f"{lead}{field}": array[field] for field in array.dtype.names}


def _named(found: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Give the columns of a table the names of the one text vector that is as long as it is wide."""
    texts = [value for value in found.values() if value.dtype.kind in TEXTS and value.ndim == 1]
    split: dict[str, np.ndarray] = {}
    for name, value in found.items():
        table = value if not is_table(value.shape) or len(value) > value.shape[1] else value.T
        fitting = [one for one in texts if is_table(table.shape) and len(one) == table.shape[1]]
        names = [str(text) for text in fitting[0]] if len(fitting) == 1 else []
        if names and len({*names} - {*found} - {*split}) == len(names):
            split |= {text: table[:, k] for k, text in enumerate(names)}
        else:
            split[name] = value
    return split
