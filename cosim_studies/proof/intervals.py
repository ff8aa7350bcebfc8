"""Estimates with 95 % intervals: Wilson's for shares, a bootstrap over cases for everything else.

References: Wilson, J. Am. Stat. Assoc. 22 (1927) 209; Efron, Tibshirani, An Introduction to the Bootstrap (1993),
percentile intervals.
"""

from collections.abc import Callable, Sequence
from math import isfinite, sqrt
from typing import NamedTuple, TypeVar

import numpy as np

from cosim.support.plain import JsonObject
from cosim.support.statistics import Array, Index, bootstrap_range

Z95 = 1.96
RESAMPLES = 2000
One = TypeVar("One")


class Estimate(NamedTuple):
    """A value, the ends of its 95 % interval, and the cases it rests on; None where there is nothing to rest on."""

    value: float | None
    low: float | None
    high: float | None
    n: int

    def as_json(self) -> JsonObject:
        """The same as a JSON object."""
        return self._asdict()


NOTHING = Estimate(None, None, None, 0)


def share(hits: Sequence[bool]) -> Estimate:
    """Share of hits with Wilson's interval, which is honest at 0 and 1."""
    n, z2 = len(hits), Z95**2
    if n == 0:
        return NOTHING
    p = sum(hits) / n
    middle, half = (p + z2 / (2 * n)) / (1 + z2 / n), Z95 * sqrt(p * (1 - p) / n + z2 / (4 * n * n)) / (1 + z2 / n)
    return Estimate(p, max(0.0, middle - half), min(1.0, middle + half), n)


def bootstrap(cases: Sequence[One], statistic: Callable[[Sequence[One]], float], seed: int = 0) -> Estimate:
    """Any statistic of independent cases with its percentile interval; `statistic` may return NaN for "undefined"."""
    if not cases or not isfinite(value := statistic(cases)):
        return NOTHING

    def each(drawn: Index) -> Array:
        return np.array([statistic([cases[k] for k in draw]) for draw in drawn])

    return Estimate(float(value), *bootstrap_range(each, len(cases), RESAMPLES, seed), len(cases))


def median(values: Sequence[float]) -> Estimate:
    """Median with its bootstrap interval."""
    return bootstrap(values, lambda chosen: float(np.median(chosen)))


def mean(values: Sequence[float]) -> Estimate:
    """Mean with its bootstrap interval."""
    return bootstrap(values, lambda chosen: float(np.mean(chosen)))


def ratio(pairs: Sequence[tuple[float, float]]) -> Estimate:
    """Sum of the first numbers over sum of the second, with a bootstrap over the pairs."""

    def of(chosen: Sequence[tuple[float, float]]) -> float:
        above, below = np.sum(chosen, axis=0)
        return float(above / below) if below else float("nan")

    return bootstrap(pairs, of)
