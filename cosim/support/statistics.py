"""Statistics that more than one place needs: the root mean square, one window, one bootstrap."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Z95 = 1.96
"""Standard errors on either side of an estimate that hold 95 % of a normal distribution."""
NORMAL_MEDIAN = 0.6744897501960817
"""Median of the absolute value of a normal variable, relative to its standard deviation."""
MIDDLE = (0.025, 0.975)
"""Quantiles between which 95 % lie."""
ROUNDING = 1e-12
"""Change of a column, relative to its largest value, that rounding of numbers and filters may make of a constant."""
SURELY = 3.0
"""Standard errors from which a number surely differs: noise alone comes to that once in 370."""


def rms(values: npt.NDArray[np.floating]) -> float:
    """Root of the mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else float("nan")


def robust_rms(values: npt.NDArray[np.floating]) -> float:
    """RMS of normal values, from their median size: a few large ones do not move it."""
    return float(np.median(np.abs(values))) / NORMAL_MEDIAN


def column_rms(columns: npt.NDArray[np.floating]) -> Array:
    """Root of the mean square of each column (rows, n), never quite zero: columns are divided by it."""
    return np.asarray(np.sqrt(np.mean(columns**2, axis=0)) + 1e-300)


def hann(length: int) -> Array:
    """Hann window of so many samples, with zeros at both ends."""
    return np.hanning(length)


def bootstrap_range(
    statistic: Callable[[Index], Array], count: int, draws: int = 400, seed: int = 0
) -> tuple[float, float]:
    """95 % percentile range of a statistic of independent blocks, drawn with replacement.

    Args:
        statistic: takes numbers of blocks, shape (draws, count), and returns a value each draw; NaN is "undefined".
        count: how many blocks there are.
        draws: how often as many blocks are drawn.
        seed: of the draws.

    Reference: Efron, Tibshirani, An Introduction to the Bootstrap (1993), chapter 13.
    """
    drawn = np.random.default_rng(seed).integers(0, count, (draws, count))
    low, high = np.nanquantile(statistic(drawn), MIDDLE)
    return float(low), float(high)
