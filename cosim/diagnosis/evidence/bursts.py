"""What shakes an axis now and then: energy of what a structure leaves that lasts for seconds, far above the usual.

    share = sum of max(l - ABOVE u, 0) / sum of e,    l = min(e, the larger neighbour's e),    u = median of e
    ln e = ln(variance of the rest) less a quadratic in ln(speed), ln(acceleration) and ln(jerk), RMS of each

in windows of a second of clear motion, the variance less what a level of friction of its own would take in each:
friction that changes is no shaking. Noise of any colour has the same e in each, and what a law lacks goes with the
motion; a single window that stands out is a jolt, and counts nothing.
"""

from collections.abc import Sequence
from itertools import combinations_with_replacement

import numpy as np
import numpy.typing as npt

from cosim.diagnosis.evidence.comparison import Comparison
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Array, Piece
from cosim.estimation.row_weights import far_from_turns

PERIODS = 8.0
"""Periods of the cutoff that a window holds at least: an energy of fewer rows says little. Unit: 1."""
LEAST_WINDOWS = 20
"""Windows that tell what is usual in which motion."""
ABOVE = 3.0
"""Times the usual energy from which a window stands out; noise of 16 independent rows has 2.1 in one of a hundred."""
LEAST_WAYS = 1e-3
"""Variance of the direction below which a window goes one way, and its level is its mean. Unit: 1."""
NONE = 1e-6
"""Mean square of a speed, relative to the largest, of an acceleration, relative to reaching that within a window, and
of a jerk, relative to reaching that acceleration within one, below which it is none. Unit: 1."""


def burst_share(comparison: Comparison, found: Fit) -> float:
    """Share of the energy of the training residual that comes in bursts; 0 where too little was recorded to tell."""
    prepared, parts = comparison.problem.prepared, []
    clear = (comparison.problem.weight * far_from_turns(prepared) > 0).astype(float)
    rest = found.residual / comparison.noise.at(prepared.stacked("v"))
    seconds = max(SECONDS, PERIODS / prepared.cutoff)
    for piece, rows in zip(prepared.pieces, comparison.bands.slices, strict=True):
        parts += [_windows(piece, rest[rows], clear[rows], seconds), np.full((1, 4), np.nan)]
    windows = np.concatenate(parts)
    known = np.isfinite(windows).all(1)
    if known.sum() < LEAST_WINDOWS:
        return 0.0
    energy = np.full(len(windows), np.nan)
    least = NONE * float(windows[known, 1].max()) * np.array([0.0, 1.0, seconds**-2, seconds**-4]) + 1e-300
    energy[known] = _beside_motion(np.log(np.maximum(windows[known], least)))
    above = np.maximum(_lasting(energy)[known] - ABOVE * np.median(energy[known]), 0.0)
    return float(above.sum() / energy[known].sum())


def _windows(piece: Piece, rest: Array, clear: Array, seconds: float) -> Array:
    """Variance of the rest, mean squares of speed, acceleration, jerk: (windows, 4); no number where hardly clear."""
    t, v = piece.t[piece.kept], piece.v[piece.kept]
    if len(t) < LEAST_ROWS:
        return np.full((1, 4), np.nan)
    way = np.sign(v)
    a = np.gradient(v, t)
    columns = (rest, rest**2, way, way**2, way * rest, v**2, a**2, np.gradient(a, t) ** 2)
    mean, square, ways, both, together, *motion = window_means(t, clear, columns, seconds).T
    of_level = (together - ways * mean) ** 2 / np.maximum(both - ways**2, LEAST_WAYS)
    return np.column_stack([square - mean**2 - of_level, *motion])


def _beside_motion(logs: Array) -> Array:
    """Energies relative to what a quadratic in the logarithms of speed, acceleration and jerk foretells."""
    motion = [(one - one.mean()) / (one.std() + 1e-300) for one in logs[:, 1:].T]
    shapes = [one * other for one, other in combinations_with_replacement(motion, 2)]
    columns = np.column_stack([np.ones(len(logs)), *motion, *shapes])
    return np.asarray(np.exp(logs[:, 0] - columns @ np.linalg.lstsq(columns, logs[:, 0], rcond=None)[0]))


def _lasting(energy: Array) -> Array:
    """The energy of each window that a neighbour has as well; 0 where it has none."""
    beside = np.concatenate([[np.nan], energy, [np.nan]])
    return np.asarray(np.nan_to_num(np.minimum(energy, np.fmax(beside[:-2], beside[2:]))))


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
