"""MAT files: version 5 and older by SciPy, 7.3 as HDF5. Fields of a struct are columns."""

from math import prod
from pathlib import Path

import numpy as np

from cosim.data.binary import hdf5
from cosim.data.binary.packages import vectors
from cosim.data.columns import Columns
from cosim.data.limits import check_cells


def read(path: Path) -> Columns:
    """Read a MAT file."""
    with path.open("rb") as file:
        if b"MATLAB 7.3" in file.read(128):
            return hdf5.read(path)
    from scipy.io import loadmat, whosmat

    check_cells(path, sum(prod(shape) for _, shape, _ in whosmat(path)), 1)
    found: dict[str, np.ndarray] = {}
    for name, value in loadmat(path, squeeze_me=True, simplify_cells=True).items():
        fields = value.items() if isinstance(value, dict) else [(name, value)]
        found |= {key: np.asarray(item) for key, item in fields if not name.startswith("__")}
    return Columns(vectors(path, found))
