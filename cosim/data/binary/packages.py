"""Packages that only some formats need, and vectors of equal length out of whatever a file holds."""

from collections import Counter
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from cosim.data.limits import check_cells
from cosim.support.errors import MissingPackageError


def package(name: str, extra: str, path: Path) -> Any:
    """Import a package that an extra of this project brings (MissingPackageError says how to get it)."""
    try:
        return import_module(name)
    except ImportError as error:
        install = f"pip install 'mount-cosim[{extra}]'"
        root = name.partition(".")[0]
        raise MissingPackageError(f"{path} needs the package {root} to be read: {install}") from error


def vectors(path: Path, found: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Keep the numeric vectors that have the commonest length longer than one."""
    numeric = {name: value for name, value in found.items() if value.ndim == 1 and value.dtype.kind in "fiub"}
    lengths = Counter(len(value) for value in numeric.values() if len(value) > 1)
    rows = lengths.most_common(1)[0][0] if lengths else 0
    kept = {name: value for name, value in numeric.items() if len(value) == rows}
    check_cells(path, rows, len(kept))
    return {name: np.asarray(value, dtype=np.float64) for name, value in kept.items()}
