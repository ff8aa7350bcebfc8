"""Means over windows of a second, of some of their rows."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from cosim.estimation.prepare import Array

SECONDS = 1.0
"""Length of a window [s]."""
LEAST_ROWS = 8
"""Rows that a window must hold of those that count, and at least half of its own."""


def window_means(
    t: Array, counts: Array | npt.NDArray[np.bool_], columns: Sequence[Array], seconds: float = SECONDS
) -> Array:
    """Mean of each column over the rows that count: (windows, columns); not a number where they are too few.

    Args:
        t: time of each row [s].
        counts: 1 for rows that count, else 0.
        columns: one value a row.
        seconds: length of a window [s].
    """
    window = np.floor((t - t[0]) / seconds).astype(np.int64)
    rows, count = np.bincount(window), np.bincount(window, counts)
    enough, count = count >= np.maximum(LEAST_ROWS, rows / 2), np.maximum(count, 1.0)
    means = [np.bincount(window, counts * one) / count for one in columns]
    return np.where(enough[:, None], np.column_stack(means), np.nan)
