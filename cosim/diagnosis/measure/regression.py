"""What a black box would do with the missing torque: no names, no equations, only smooth functions of the motion.

A ceiling to compare named physics with, and one of the baselines of `cosim_studies.proof`.
"""

from collections.abc import Callable, Sequence

import numpy as np

from cosim.diagnosis.answer.result import Trace
from cosim.estimation.discrepancy_basis import since_reversal
from cosim.estimation.prepare import Array
from cosim.support.statistics import ROUNDING

Model = Callable[[Array], Array]
"""From features (rows, features) to torque (rows,)."""
EVERY = 4
"""Rows of a trace for each row that is fitted: the trace is filtered at 30 Hz and has eight rows a period of that."""
CENTRES, MOST_ROWS = 800, 20_000
"""Rows that a kernel is placed at, and rows that it is fitted to."""
RIDGE = 1e-2
"""Added to the diagonal, relative to the mean of the normal matrix. Unit: 1."""
CHUNK = 256
"""Rows lifted at once: they stay in the cache."""


def features(trace: Trace) -> Array:
    """Position, speed, acceleration, direction, logarithm of the time since the last reversal."""
    since = np.log(since_reversal(trace.t, trace.v) + 1e-2)
    return np.column_stack([trace.q, trace.v, np.gradient(trace.v, trace.t), np.sign(trace.v), since])


def stacked(traces: Sequence[Trace]) -> tuple[Array, Array]:
    """Features and missing torque of several recordings, thinned."""
    rows = np.concatenate([features(trace) for trace in traces])[::EVERY]
    return rows, np.concatenate([trace.missing for trace in traces])[::EVERY]


def kernel(rows: Array, target: Array) -> Model:
    """Kernel ridge regression on evenly spaced centres; widths are the spread of each feature.

    k(x, c) = exp(-|x - c|^2 / 2) of features scaled to unit spread.
    """
    middle, spread = rows.mean(0), rows.std(0)
    spread = np.where(spread > ROUNDING * np.abs(rows).max(0), spread, 1.0)  # one way only, in training
    centres = ((rows - middle) / spread)[:: max(1, len(rows) // CENTRES)]

    half = (centres**2).sum(1) / 2

    def lifted(others: Array) -> Array:
        x = (others - middle) / spread
        powers = x @ centres.T
        powers -= (x**2).sum(1)[:, None] / 2
        powers -= half
        return np.asarray(np.exp(powers, out=powers))

    normal, right = np.zeros((len(centres), len(centres))), np.zeros(len(centres))
    for part, own in zip(_chunks(rows), _chunks(target), strict=True):
        columns = lifted(part)
        normal += columns.T @ columns
        right += columns.T @ own
    weights = np.linalg.solve(normal + RIDGE * np.trace(normal) / len(normal) * np.eye(len(normal)), right)
    return lambda others: np.concatenate([lifted(part) @ weights for part in _chunks(others)])


def _chunks(rows: Array) -> list[Array]:
    return [rows[first : first + CHUNK] for first in range(0, len(rows), CHUNK)]


def black_box_rms(traces: Sequence[Trace]) -> float:
    """Held-out RMS that the refitted base leaves with a black box beside it, learnt on the training recordings."""
    rows, target = stacked([trace for trace in traces if not trace.heldout])
    few = slice(None, None, max(1, len(rows) // MOST_ROWS))
    model = kernel(rows[few], target[few])
    squares = [(one.missing - model(features(one))) ** 2 for one in traces if one.heldout]
    return float(np.sqrt(np.mean(np.concatenate(squares))))
