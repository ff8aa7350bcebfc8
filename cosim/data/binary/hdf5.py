"""HDF5, and MAT v7.3 which is HDF5: every dataset that is a vector or a table of them, whatever its group."""

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from cosim.data.binary.packages import is_table, left_out, opaque, package, vectors
from cosim.data.columns import Columns
from cosim.data.limits import check_cells, check_columns

INTERNAL, HANDLE = "#", "MATLAB_object_decode"
"""First sign of the groups in which MATLAB keeps its objects, and the attribute of what leads to one."""
UNITS = ("unit", "units")
"""Attributes of a dataset in which tools write its unit."""


def read(path: Path) -> Columns:
    """Read an HDF5 file; datasets of one name in several groups keep the name of their group."""
    h5py = package("h5py", "hdf5", path)
    with h5py.File(path, "r") as file:
        items = _vectors(path, file)
        often = Counter(name.split("/")[-1] for name in items)
        names = {whole: whole.split("/")[-1] if often[whole.split("/")[-1]] == 1 else whole for whole in items}
        found = {names[whole]: np.squeeze(item[()]) for whole, item in items.items()}
        units = {names[whole]: _unit(item) for whole, item in items.items()}
        objects = any(name.startswith(INTERNAL) for name in file)
    values = vectors(path, found)
    if objects and not values:
        raise opaque(path)
    stated = {name: unit for name, unit in units.items() if unit and name in values}
    return Columns(values, stated, notes=left_out(path, found, values))


def _vectors(path: Path, file: Any) -> dict[str, Any]:
    """Return the numeric datasets by path that have at most one dimension longer than one, and tables."""
    items: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        numeric = getattr(item, "dtype", None) is not None and item.dtype.kind in "fiub" and item.shape is not None
        if name.startswith(INTERNAL) or HANDLE in item.attrs:
            return
        if numeric and (sum(length > 1 for length in item.shape) <= 1 or is_table(item.shape)):
            items[name] = item
            check_columns(path, len(items))

    file.visititems(visit)
    check_cells(path, sum(int(item.size) for item in items.values()), 1)
    return items


def _unit(item: Any) -> str:
    stated = next((item.attrs[key] for key in UNITS if key in item.attrs), "")
    return stated.decode("utf-8", "replace") if isinstance(stated, bytes) else stated if isinstance(stated, str) else ""
