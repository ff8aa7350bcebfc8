"""MAT files: version 5 and older by SciPy, 7.3 as HDF5. Fields of a struct are columns."""

import warnings
from dataclasses import replace
from math import prod
from pathlib import Path

from cosim.data.binary import hdf5
from cosim.data.binary.channels import with_clocks
from cosim.data.binary.matlab_structs import arrays_of
from cosim.data.binary.packages import left_out, opaque, vectors
from cosim.data.columns import Columns
from cosim.data.limits import check_cells, listed


def read(path: Path) -> Columns:
    """Read a MAT file.

    Raises:
        RecordingError: it holds no arrays of numbers, or more than a file of its size may.
    """
    with path.open("rb") as file:
        if b"MATLAB 7.3" in file.read(128):
            return hdf5.read(path)
    from scipy.io import loadmat

    check_cells(path, _claimed(path), 1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # objects without a name, which are told below
        found = arrays_of(loadmat(path, squeeze_me=True, simplify_cells=True))
    objects = f"{path.stem}: objects that only MATLAB can open were left out: {listed(tuple(found.objects))}."
    notes = (objects,) if found.objects else ()
    if channels := with_clocks(path, found.arrays, found.units):
        return replace(channels, notes=notes + channels.notes)
    found = found.named()
    values = vectors(path, found.arrays)
    if found.objects and not values:
        raise opaque(path)
    units = {name: text for name, text in found.units.items() if name in values}
    return Columns(values, units, notes=notes + left_out(path, found.arrays, values))


def _claimed(path: Path) -> int:
    """Return how many numbers the variables of a file claim to hold; SciPy cannot list those beside an object."""
    from scipy.io import whosmat

    try:
        return sum(prod(shape) for _, shape, _ in whosmat(path))
    except TypeError:
        return 0
