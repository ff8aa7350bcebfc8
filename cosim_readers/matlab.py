"""MAT files: version 5 and older by SciPy, 7.3 as HDF5. Fields of a struct are columns."""

import os
import struct
import warnings
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from math import prod
from pathlib import Path
from typing import IO

from cosim.data.binary.channels import columns_of_arrays
from cosim.data.columns import Columns
from cosim.data.limits import allowance, check_cells, check_time, check_unpacked, listed
from cosim_readers import hdf5
from cosim_readers.matlab_structs import arrays_of

PACKED = 15
"""Type of an element of MAT 5 that is packed by zlib (miCOMPRESSED)."""
BEST = 1032
"""Times that zlib packs at best."""
PIECE = 2**20


def read(path: Path) -> Columns:
    """Read a MAT file.

    Raises:
        RecordingError: it holds no arrays of numbers, or more than a file of its size may.
    """
    with path.open("rb") as file:
        if b"MATLAB 7.3" in file.read(128):
            return hdf5.read(path)
    from scipy.io import loadmat

    _check_packed(path)
    check_cells(path, _claimed(path), 1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # objects without a name, which are told below
        found = arrays_of(loadmat(path, squeeze_me=True, simplify_cells=True))
    objects = f"{path.stem}: objects that only MATLAB can open were left out: {listed(tuple(found.objects))}."
    notes = (objects,) if found.objects else ()
    columns = columns_of_arrays(path, found.arrays, found.units, ".")
    if found.objects and not columns.values:
        raise hdf5.opaque(path)
    return replace(columns, notes=notes + columns.notes)


def _check_packed(path: Path) -> None:
    """Refuse variables that unpack to more than the file may; what they hold (cells, structs) no table says before."""
    if path.stat().st_size * BEST <= allowance(path).unpacked:
        return
    unpacked = 0
    with path.open("rb") as file:
        order = {b"\x00\x01IM": "<", b"\x01\x00MI": ">"}.get(file.read(128)[124:], "")
        while order and len(tag := file.read(8)) == 8:
            kind, length = struct.unpack(f"{order}II", tag)
            if kind != PACKED:
                file.seek(length, os.SEEK_CUR)
                continue
            for size in _inflated(file, length):
                unpacked += size
                check_unpacked(path, unpacked)
                check_time(path)


def _inflated(file: IO[bytes], length: int) -> Iterator[int]:
    """Yield the sizes of the pieces to which the next bytes of a file unpack; damage is left to SciPy to say."""
    packer = zlib.decompressobj()
    with suppress(zlib.error):
        while length > 0 and (piece := file.read(min(PIECE, length))):
            length -= len(piece)
            while piece:
                yield len(packer.decompress(piece, PIECE))
                piece = packer.unconsumed_tail
    file.seek(length, os.SEEK_CUR)


def _claimed(path: Path) -> int:
    """Return how many numbers the variables of a file claim to hold; SciPy cannot list those beside an object."""
    from scipy.io import whosmat

    try:
        return sum(prod(shape) for _, shape, _ in whosmat(path))
    except TypeError:
        return 0
