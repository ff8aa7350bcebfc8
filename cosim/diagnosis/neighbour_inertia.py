"""The inertia of an axis among others that move with it, where their motion was recorded.

    tau = J a + Fc sign(v) + sigma2 v + c + w(q) + sum_n [ h_n a_n + w(q_n) + w(q + q_n) + w(q - q_n) ]

with w(x) = s sin(x) + r cos(x): the neighbours' accelerations and weights that turn with one axis or with both. Linear
least squares; what the neighbours do is a nuisance here, which a diagnosis names. An arm of seven joints that all move
leaves .2 N m of 11 so, and 3.7 without the neighbours.
"""

from collections.abc import Iterator
from math import sqrt

import numpy as np

from cosim.data.neighbours import Neighbour
from cosim.estimation.blocks import Blocks, covariance
from cosim.estimation.neighbours import key
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.row_weights import CLEAR_MOTION
from cosim.support.statistics import column_rms

LEAST_ROWS = 3
"""Rows for each number that is estimated, at least. Unit: 1. Of fewer the error of the inertia is not known."""


def inertia_with_neighbours(prepared: Prepared, turns: bool) -> tuple[float, float]:
    """Estimate the inertia beside the motion of the neighbours.

    Args:
        prepared: recordings with columns of neighbours.
        turns: whether this axis turns: then weights hang on it.

    Returns:
        Inertia and its standard error [kg m2, kg]; an infinite error where no neighbour moves or rows are too few.
    """
    columns = np.column_stack([*_own(prepared, turns), *_others(prepared, turns)])
    rows, count = columns.shape
    if not prepared.neighbours or rows < LEAST_ROWS * count:
        return 0.0, np.inf
    size = column_rms(columns) + 1e-300
    columns, tau = columns / size, prepared.stacked("tau")
    value = np.linalg.lstsq(columns, tau, rcond=1e-9)[0]
    spread = covariance(columns, tau - columns @ value, Blocks.of(prepared))[0, 0]
    return float(value[0] / size[0]), sqrt(spread * rows / (rows - count)) / float(size[0])


def _own(prepared: Prepared, turns: bool) -> Iterator[Array]:
    """Shapes of this axis, the acceleration first."""
    v = prepared.stacked("v")
    yield from (prepared.stacked("a"), np.tanh(v / (CLEAR_MOTION * np.abs(v).max() + 1e-300)), v, np.ones_like(v))
    yield from _weight(prepared.stacked("q")) if turns else ()


def _others(prepared: Prepared, turns: bool) -> Iterator[Array]:
    """Shapes of the neighbours that move by themselves."""
    q = prepared.stacked("q")
    for one in prepared.neighbours:
        yield prepared.of_neighbour(key(one.name, "acceleration"))
        if turns and _is_angle(one):
            angle = prepared.of_neighbour(key(one.name, "position"))
            for together in (angle, q + angle, q - angle):
                yield from _weight(together)


def _weight(angle: Array) -> tuple[Array, Array]:
    return np.sin(angle), np.cos(angle)


def _is_angle(one: Neighbour) -> bool:
    return one.turns and bool(one.position)
