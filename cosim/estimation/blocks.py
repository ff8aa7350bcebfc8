"""Blocks of rows that count as one observation each, and standard errors that hold whatever the noise in them is."""

from dataclasses import dataclass
from math import sqrt
from sys import float_info

import numpy as np
import numpy.typing as npt

from cosim.estimation.prepare import Array, Prepared

BLOCK_SECONDS = 5.0
FEWEST = 5
"""Blocks, at least: of one alone a fit leaves a score of zero, and no error. Short recordings have shorter blocks."""
Index = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Blocks:
    """Contiguous blocks of the kept rows, and the recording each belongs to."""

    rows: tuple[Index, ...]
    recording: Index

    @classmethod
    def of(cls, prepared: Prepared, seconds: float = BLOCK_SECONDS) -> "Blocks":
        """Cut each piece into blocks of about so many seconds, shorter where all pieces together have few of them."""
        rows, recording, first = [], [], 0
        total = sum(len(piece.kept) * piece.dt * piece.stride for piece in prepared.pieces)
        seconds = min(seconds, total / FEWEST)
        for piece in prepared.pieces:
            kept = np.arange(first, first + len(piece.kept))
            count = max(1, round(len(kept) * piece.dt * piece.stride / seconds))
            rows += np.array_split(kept, count)
            recording += [piece.recording] * count
            first += len(kept)
        return cls(tuple(rows), np.array(recording))


def sandwich(columns: Array, left: Array, blocks: Blocks, rcond: float = 1e-10) -> Array:
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


def covariance(slopes: Array, left: Array, blocks: Blocks) -> Array:
    """Covariance of parameters that least squares fitted, from weighted derivatives (rows, parameters); see `sandwich`.

    Parameters have units of their own, so directions are told apart in units of their derivatives' sizes.
    """
    size = np.sqrt((slopes**2).sum(0))
    scale = np.where(size > sqrt(float_info.min), size, 1.0)  # a product of two that are smaller is none
    return np.asarray(sandwich(slopes / scale, left, blocks) / np.outer(scale, scale))
