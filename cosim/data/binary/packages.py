"""Vectors of equal length out of whatever arrays a file holds."""

from collections import Counter
from collections.abc import Collection
from pathlib import Path

import numpy as np

from cosim.data.limits import check_cells, listed

MOST_BESIDE = 100
"""Signals of one table: of two dimensions the longer one is time, as tools for simulation log to arrays."""


def is_table(shape: tuple[int, ...]) -> bool:
    """Whether an array holds several signals beside each other."""
    return len(shape) == 2 and 1 < min(shape) <= MOST_BESIDE and max(shape) > min(shape)


def vectors(path: Path, found: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Keep the numeric vectors that have the commonest length longer than one; a table is its columns, `data_1` ...

    A table counts once: many columns of gains must not outnumber the few vectors of a recording.
    """
    signals = {name: as_columns(value) for name, value in found.items() if value.dtype.kind in "fiub"}
    lengths = Counter(len(one) for one in signals.values() if len(one) > 1)
    rows = lengths.most_common(1)[0][0] if lengths else 0
    kept = {name: value for name, value in signals.items() if len(value) == rows}
    check_cells(path, rows, sum(value.shape[1] for value in kept.values()))
    return {
        f"{name}_{k + 1}" if is_table(value.shape) else name: np.asarray(value[:, k], dtype=np.float64)
        for name, value in kept.items()
        for k in range(value.shape[1])
    }


def left_out(path: Path, found: dict[str, np.ndarray], kept: Collection[str]) -> tuple[str, ...]:
    """Note the arrays of numbers that `vectors` did not keep; a number alone is a setting and needs no note."""
    numeric = [name for name, value in found.items() if value.dtype.kind in "fiub" and value.size > 1]
    lost = [name for name in numeric if name not in kept and f"{name}_1" not in kept]
    shapes = [f"{name} ({' x '.join(map(str, found[name].shape))})" for name in lost]
    return (f"{path.stem}: arrays of other lengths were left out: {listed(tuple(shapes))}.",) if shapes else ()


def as_columns(value: np.ndarray) -> np.ndarray:
    """Signals of an array as columns (rows, k); none of what is neither a vector nor a table."""
    if value.ndim == 1:
        return value[:, None]
    if not is_table(value.shape):
        return np.empty((0, 0))
    return value if len(value) > value.shape[1] else value.T
