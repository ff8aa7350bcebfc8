"""Which points of the parameter space are run: a grid, a Latin hypercube or independent draws; a seed repeats them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod

import numpy as np

from cosim.system.address import Value
from cosim_sweeps.variation import Variation

Point = tuple[Value, ...]
"""Values of one run, in the order of the variations."""


@dataclass(frozen=True)
class Design:
    """A countable set of points; `points` yields them in the order of their numbers."""

    runs: int
    points: Callable[[], Iterator[Point]]


def grid(variations: Sequence[Variation]) -> Design:
    """Every combination; the last one varies fastest."""
    axes = [variation.grid() for variation in variations]
    return Design(prod(map(len, axes)), lambda: product(*axes))


def latin_hypercube(variations: Sequence[Variation], runs: int, seed: int) -> Design:
    """Cut each range into as many equally likely parts as there are runs; each part is met once.

    Reference: McKay, Beckman, Conover, Technometrics 21 (1979) 239.
    """

    def shares() -> np.ndarray:
        random = np.random.default_rng(seed)
        columns = [(random.permutation(runs) + random.random(runs)) / runs for _ in variations]
        return np.stack(columns, axis=1)

    return Design(runs, lambda: _at(variations, shares()))


def monte_carlo(variations: Sequence[Variation], runs: int, seed: int) -> Design:
    """Independent draws."""
    return Design(runs, lambda: _at(variations, np.random.default_rng(seed).random((runs, len(variations)))))


def _at(variations: Sequence[Variation], shares: np.ndarray) -> Iterator[Point]:
    return (tuple(one.at(u) for one, u in zip(variations, row, strict=True)) for row in shares.tolist())
