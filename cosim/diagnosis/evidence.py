"""How much better a candidate explains recordings it was not fitted to.

Everything is a quadratic form: columns (residual, tangents of the base, nuisances, candidates) are whitened per
recording and cut into blocks, each block keeps only its Gram matrix, and fits, cross-validation and significance are
algebra on those (grams.py). Nuisances carry a prior: what friction laws cannot agree on (bank.py), a slowly wandering
friction level, and a timing convention of a fraction of a sample are explained away before any effect may earn
something.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.linalg import solve_toeplitz

from cosim.diagnosis.prepare import Array, Prepared

BLOCK_SECONDS = 5.0
AR_ORDER = 8
SPEED_BINS = 16
FOLDS = 4
"""Folds of a single training recording; with several, each recording is a fold ..."""
MOST_FOLDS = 8
"""... up to this many; of more every fourth one shares a fold, so that each fold holds motions of all kinds."""
NOISE_SHARE = 0.03
"""Share of a fold's rows that the noise of one coefficient may cost there: what an effect must gain at least."""
LEAST_ROWS = 10 * AR_ORDER
"""Recordings with fewer kept rows have one noise filter together."""

Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Blocks:
    """Contiguous blocks of the kept rows, and the fold each belongs to."""

    rows: tuple[Index, ...]
    fold: Index
    recording: Index

    @classmethod
    def of(cls, prepared: Prepared, seconds: float = BLOCK_SECONDS) -> "Blocks":
        """Cut each piece into blocks of about so many seconds."""
        rows, recording, first = [], [], 0
        for piece in prepared.pieces:
            kept = np.arange(first, first + len(piece.kept))
            count = max(1, round(len(kept) * piece.dt * piece.stride / seconds))
            rows += np.array_split(kept, count)
            recording += [piece.recording] * count
            first += len(kept)
        owner = np.array(recording)
        count = len(set(recording))
        fold = np.arange(len(rows)) * FOLDS // len(rows) if count == 1 else owner
        fold = owner % FOLDS if count > MOST_FOLDS else fold
        return cls(tuple(rows), fold, owner)

    @cached_property
    def folds(self) -> list[Index]:
        """Rows of each fold."""
        owners = list(zip(self.rows, self.fold.tolist(), strict=True))
        return [np.concatenate([r for r, owner in owners if owner == fold]) for fold in np.unique(self.fold)]

    def untold(self, columns: Array) -> Mask:
        """Which columns (rows, n) act in one fold nearly alone, as a drive's knee that no other reaches: (folds, n).

        The others, where the column has the energy E, tell its coefficient with the variance 1/E, which costs
        E_fold / E rows by noise alone: what they never met they can neither foretell nor deny.
        """
        own = np.array([(columns[rows] ** 2).sum(0) for rows in self.folds])
        many = np.array([[len(rows)] for rows in self.folds])
        return np.asarray((len(own) > 1) & (own > NOISE_SHARE * many * (own.sum(0) - own)))


@dataclass(frozen=True)
class Whitening:
    """How the noise looks: autoregressive prediction-error filters of a recording, and a scale that depends on speed.

    The first rows of a block are predicted from the few before: no row is lost, and in a short block the mean counts.
    Friction is least certain where the motion turns, so the innovations are larger at low speed; `scale` holds their
    RMS at every row.
    """

    filters: dict[int, Array]
    """For each recording a triangle of taps: row k predicts from k rows before, divided by its RMS error."""
    scale: Array

    @classmethod
    def of(cls, residual: Array, blocks: Blocks, speed: Array) -> "Whitening":
        """Estimate the filters (Yule-Walker) and the scale from a residual at the kept rows moving at `speed`."""
        owners = zip(blocks.rows, blocks.recording.tolist(), strict=True)
        rows_of: dict[int, list[Index]] = {}
        for rows, owner in owners:
            rows_of.setdefault(owner, []).append(rows)
        of = {owner: residual[np.concatenate(rows)] for owner, rows in rows_of.items()}
        short = [part for part in of.values() if len(part) < LEAST_ROWS]
        together = _yule_walker(np.concatenate(short)) if short else np.eye(1)
        filters = {owner: _yule_walker(part) if len(part) >= LEAST_ROWS else together for owner, part in of.items()}
        plain = cls(filters, np.ones(len(residual)))
        white = np.concatenate(plain.apply(residual[:, None], blocks))[:, 0]
        used = np.concatenate(blocks.rows)
        return cls(filters, _scale_by_speed(white, np.abs(speed[used]), np.abs(speed)))

    def apply(self, columns: Array, blocks: Blocks) -> list[Array]:
        """Whiten columns (rows, n) block by block."""
        return [
            _filtered(columns[rows], self.filters[owner]) / self.scale[rows, None]
            for rows, owner in zip(blocks.rows, blocks.recording.tolist(), strict=True)
        ]


def _scale_by_speed(white: Array, at: Array, speed: Array) -> Array:
    """RMS of innovations in speed bins of equal count, joined by straight lines; at least a fifth of the median."""
    parts = [part for part in np.array_split(np.argsort(at), SPEED_BINS) if len(part)]
    centre = np.array([float(np.median(at[part])) for part in parts])
    size = np.array([float(np.sqrt(np.mean(white[part] ** 2))) for part in parts])
    return np.asarray(np.interp(speed, centre, np.maximum(size, 0.2 * np.median(size) + 1e-300)))


def _yule_walker(x: Array) -> Array:
    """Taps of the prediction-error filters of orders 0 .. `AR_ORDER`, a row each, newest row first."""
    x = x - x.mean()
    order, length = AR_ORDER, len(x)
    padded = np.fft.rfft(x, 2 * length)
    covariance = np.fft.irfft(np.abs(padded) ** 2)[: order + 1] / length
    covariance[0] *= 1 + 1e-3
    if covariance[0] <= 0:
        return np.eye(1)
    taps = np.zeros((order + 1, order + 1))
    for k in range(order + 1):
        predictor = solve_toeplitz(covariance[:k], covariance[1 : k + 1]) if k else np.zeros(0)
        power = max(covariance[0] - predictor @ covariance[1 : k + 1], 1e-12 * covariance[0])
        taps[k, : k + 1] = np.concatenate([[1.0], -predictor]) / np.sqrt(power)
    return taps


def _filtered(columns: Array, taps: Array) -> Array:
    order = min(len(taps) - 1, max(len(columns) - 1, 0))
    out = np.zeros_like(columns)
    for lag, tap in enumerate(taps[order, : order + 1]):
        out[order:] += tap * columns[order - lag : len(columns) - lag]
    for row in range(order):
        out[row] = taps[row, : row + 1] @ columns[row::-1]
    return out


@dataclass(frozen=True)
class Score:
    """What an addition earns: cross-validated energy per block without and with it, and the rows of each block.

    Gains are geometric means over blocks, as if each block had its own noise level: a few seconds in which no model is
    any good must not decide.
    """

    before: Array
    after: Array
    rows: Array

    @property
    def _better(self) -> Array:
        return self.rows * np.log(np.maximum(self.before, 1e-300) / np.maximum(self.after, 1e-300))

    @property
    def gain(self) -> float:
        """Share of the cross-validated energy removed."""
        return float(1 - np.exp(-self._better.sum() / self.rows.sum()))

    @property
    def t(self) -> float:
        """Mean improvement over blocks in units of its standard error."""
        return t_value(self._better)

    @property
    def nats(self) -> float:
        """Gain of cross-validated log-likelihood."""
        return float(self._better.sum() / 2)


def t_value(better: Array) -> float:
    """Mean over standard error of the mean."""
    error = better.std(ddof=1) / np.sqrt(len(better)) if len(better) > 1 else 0.0
    return float(better.mean() / error) if error > 0 else 0.0


def sandwich(columns: Array, left: Array, blocks: Blocks, rcond: float) -> Array:
    """Covariance of least-squares coefficients that holds whatever the noise is like within a block.

        B (sum of s s') B n / (n - 1),   B = (X'X)^+,   s = X_block' left_block

    Args:
        columns: X, (rows, coefficients).
        left: what the fit leaves at each row.
        blocks: n blocks, which count as one observation each.
        rcond: directions of X'X weaker than this share of the strongest are not estimated.

    Reference: Liang and Zeger, Biometrika 73 (1986) 13.
    """
    bread = np.linalg.pinv(columns.T @ columns, rcond=rcond)
    scores = np.array([columns[rows].T @ left[rows] for rows in blocks.rows])
    return np.asarray(bread @ (scores.T @ scores) @ bread * len(scores) / max(len(scores) - 1, 1))
