"""Errors of models on recordings, as mean squares: whether they are noise, and how sure a difference is."""

from collections.abc import Sequence

import numpy as np

from cosim.estimation.prepare import Array
from cosim.support.statistics import bootstrap_range

NOISY = 3.0
"""Growth of the error from the band of the analysis to the protocol's from which that says nothing of the model."""


BLOCK_SECONDS = 1.0


def is_noise(narrow: Sequence[float], wide: Sequence[float]) -> bool:
    """Whether of any model's error energy most lies above the band of the analysis: noise of the reading, a late clock.

    Args:
        narrow: mean squares in the band of the analysis, one a model.
        wide: the same in the protocol's band.
    """
    return any(after > NOISY**2 * before for before, after in zip(narrow, wide, strict=True))


def interval_of(before: Array, after: Array, dt: float) -> tuple[float, float]:
    """95 % range of the difference of RMS values, from a bootstrap of blocks of `BLOCK_SECONDS`."""
    count = max(2, int(len(before) * dt / BLOCK_SECONDS))
    squares = np.array([[np.mean(x**2) for x in np.array_split(one, count)] for one in (before, after)])
    return bootstrap_range(
        lambda drawn: np.asarray(np.sqrt(squares[0][drawn].mean(1)) - np.sqrt(squares[1][drawn].mean(1))),
        count,
    )
