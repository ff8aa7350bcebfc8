"""How much better a candidate explains recordings it was not fitted to.

Everything is a quadratic form: columns (residual, tangents of the base, nuisances, candidates) are whitened per
recording and cut into blocks, each block keeps only its Gram matrix, and fits, cross-validation and significance are
algebra on those. Nuisances carry a prior: what friction laws cannot agree on (bank.py), a slowly wandering friction
level, and a timing convention of a fraction of a sample are explained away before any effect may earn something.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import solve_toeplitz

from cosim.diagnosis.prepare import Array, Prepared

BLOCK_SECONDS = 5.0
AR_ORDER = 12
FOLDS = 4
"""Folds of a single training recording; with several, each recording is a fold."""

Index = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Blocks:
    """Contiguous blocks of the kept rows, and the fold each belongs to."""

    rows: tuple[Index, ...]
    fold: Index
    recording: Index

    @classmethod
    def of(cls, prepared: Prepared) -> "Blocks":
        """Cut each piece into blocks of about `BLOCK_SECONDS`."""
        rows, recording, first = [], [], 0
        for piece in prepared.pieces:
            kept = np.arange(first, first + len(piece.kept))
            count = max(1, round(len(kept) * piece.dt * piece.stride / BLOCK_SECONDS))
            rows += np.array_split(kept, count)
            recording += [piece.recording] * count
            first += len(kept)
        owner = np.array(recording)
        single = len(set(recording)) == 1
        fold = np.arange(len(rows)) * FOLDS // len(rows) if single else owner
        return cls(tuple(rows), fold, owner)


@dataclass(frozen=True)
class Whitening:
    """One autoregressive prediction-error filter a recording: coefficients and innovation RMS."""

    filters: dict[int, tuple[Array, float]]

    @classmethod
    def of(cls, residual: Array, blocks: Blocks, order: int = AR_ORDER) -> "Whitening":
        """Estimate the filters from a residual at the kept rows (Yule-Walker)."""
        filters = {}
        for number in np.unique(blocks.recording):
            rows = np.concatenate(
                [r for r, owner in zip(blocks.rows, blocks.recording, strict=True) if owner == number]
            )
            filters[int(number)] = _yule_walker(residual[rows], order)
        return cls(filters)

    def apply(self, columns: Array, blocks: Blocks) -> list[Array]:
        """Whiten columns (rows, n) block by block; each block loses its first `order` rows."""
        return [
            _filtered(columns[rows], *self.filters[int(owner)])
            for rows, owner in zip(blocks.rows, blocks.recording, strict=True)
        ]


def _yule_walker(x: Array, order: int) -> tuple[Array, float]:
    x = x - x.mean()
    length = len(x)
    padded = np.fft.rfft(x, 2 * length)
    covariance = np.fft.irfft(np.abs(padded) ** 2)[: order + 1] / length
    covariance[0] *= 1 + 1e-6
    if covariance[0] <= 0:
        return np.array([1.0]), 1.0
    predictor = solve_toeplitz(covariance[:order], covariance[1:])
    power = max(covariance[0] - predictor @ covariance[1:], 1e-12 * covariance[0])
    return np.concatenate([[1.0], -predictor]), float(np.sqrt(power))


def _filtered(columns: Array, taps: Array, scale: float) -> Array:
    order = len(taps) - 1
    out = np.zeros((max(len(columns) - order, 0), columns.shape[1]))
    for lag, tap in enumerate(taps):
        out += tap * columns[order - lag : len(columns) - lag]
    return out / scale


@dataclass(frozen=True)
class Score:
    """What a group of columns earns: cross-validated energy per block without and with it, and its coefficients."""

    before: Array
    after: Array
    coefficients: Array

    @property
    def gain(self) -> float:
        """Share of the cross-validated energy removed."""
        return float(1 - self.after.sum() / self.before.sum())

    @property
    def t(self) -> float:
        """Mean improvement over blocks in units of its standard error."""
        better = self.before - self.after
        error = better.std(ddof=1) / np.sqrt(len(better)) if len(better) > 1 else np.inf
        return float(better.mean() / error) if error > 0 else 0.0


class Grams:
    """Gram matrices of whitened columns, one a block; column 0 is the target.

    Args:
        columns: whitened columns of each block, (rows, n) with the target first.
        wander: whitened columns of each block whose coefficients are random per block (friction level wander), with
            unit prior variance; they are integrated out.
        blocks: the blocks.
        prior: prior variance of the coefficient of each column but the target (inf: free), in whitened units.
    """

    def __init__(self, columns: Sequence[Array], wander: Sequence[Array], blocks: Blocks, prior: Array) -> None:
        self.fold, self.prior = blocks.fold, prior
        self.gram = np.array([_marginal(x, w) for x, w in zip(columns, wander, strict=True)])
        self.rows = np.array([len(x) for x in columns])

    def score(self, base: Sequence[int], extra: Sequence[int], instead: Sequence[int] | None = None) -> Score:
        """Compare `base + extra` with `instead` (default: base), each fold predicted from the others."""
        before = self.energy(base if instead is None else instead)
        after = self.energy([*base, *extra])
        return Score(before, after, self.fit([*base, *extra])[len(base) :])

    def energy(self, chosen: Sequence[int]) -> Array:
        """Cross-validated energy of the target in each block."""
        energy = np.zeros(len(self.gram))
        for fold in np.unique(self.fold):
            test = self.fold == fold
            beta = self.fit(chosen, ~test if not test.all() else test)
            full = np.concatenate([[1.0], -beta])
            index = np.concatenate([[0], np.asarray(chosen, int)])
            energy[test] = np.einsum("i,bij,j->b", full, self.gram[test][:, index][:, :, index], full)
        return energy

    def fit(self, chosen: Sequence[int], blocks: npt.NDArray[np.bool_] | None = None) -> Array:
        """Coefficients of the chosen columns from the given blocks."""
        total = self.gram.sum(0) if blocks is None else self.gram[blocks].sum(0)
        index = np.asarray(chosen, int)
        normal = total[np.ix_(index, index)] + np.diag(1 / self.prior[index - 1])
        scale = 1 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
        scaled = normal * np.outer(scale, scale) + 1e-9 * np.eye(len(index))
        solution: Array = scale * np.linalg.solve(scaled, scale * total[index, 0])
        return solution

    def covariance(self, chosen: Sequence[int]) -> Array:
        """Block-robust (sandwich) covariance of the coefficients of the chosen columns."""
        index = np.asarray(chosen, int)
        beta = self.fit(chosen)
        scores = self.gram[:, index, 0] - self.gram[:, index][:, :, index] @ beta
        bread = np.linalg.pinv(self.gram.sum(0)[np.ix_(index, index)] + np.diag(1 / self.prior[index - 1]))
        count = len(scores)
        return np.asarray(bread @ (scores.T @ scores) @ bread * count / max(count - 1, 1))


def _marginal(x: Array, w: Array) -> Array:
    """Gram matrix of x under the covariance I + w w'."""
    if not w.shape[1]:
        return np.asarray(x.T @ x)
    cross = w.T @ x
    inner = np.eye(w.shape[1]) + w.T @ w
    return np.asarray(x.T @ x - cross.T @ np.linalg.solve(inner, cross))
