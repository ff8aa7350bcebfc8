"""How the READMEs of measured recordings judge a model: an RMS by each one's own protocol, with its 95 % interval.

An error is the root of what some blocks leave, over what they weigh: seconds of residual over their rows, or mean
torques over mean torques. The interval draws whole blocks with replacement (seeded), as neighbouring rows are alike.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.data.recording import Recording
from cosim.estimation.inverse import Inverse
from cosim.estimation.prepare import Piece, prepare
from pyfmi_models.mount import Mount

Array = npt.NDArray[np.float64]
Rows = list[tuple[Piece, Array]]
"""Pieces with their torque residual."""
BLOCK = 1.0
"""Seconds of a block."""
FEWEST = 5
"""Blocks below which no interval is told."""
DRAWS = 1000


@dataclass(frozen=True)
class Judge:
    """An error in units of `scale`: the root of the sum of the first column of `blocks` over that of the second."""

    blocks: Callable[[Mount, Sequence[Recording]], Array]
    scale: float = 1.0

    def __call__(self, mount: Mount, recordings: Sequence[Recording]) -> float:
        """The error."""
        return self._error(self.blocks(mount, recordings)[None])[0]

    def interval(self, mount: Mount, recordings: Sequence[Recording]) -> str:
        """95 % of draws of whole blocks; empty where there are few."""
        found = self.blocks(mount, recordings)
        if len(found) < FEWEST:
            return ""
        drawn = np.random.default_rng(0).integers(len(found), size=(DRAWS, len(found)))
        low, high = np.quantile(self._error(found[drawn]), (0.025, 0.975))
        return f"{low:.3g} to {high:.3g}"

    def _error(self, blocks: Array) -> Array:
        left, weight = np.moveaxis(blocks.sum(axis=1), -1, 0)
        return self.scale * np.sqrt(left / weight)


def residuals(mount: Mount, recordings: Sequence[Recording], cutoff: float) -> Rows:
    """Measured minus model torque at all rows of each piece, and the pieces."""
    pieces = prepare(recordings, cutoff).pieces
    inverse = Inverse(mount, ())
    return [(piece, piece.tau - inverse.torque(piece, np.zeros(0))[0]) for piece in pieces]


def moving(least: float, cutoff: float, scale: float = 1.0) -> Judge:
    """RMS of the residual while faster than `least`, low-passed at `cutoff` [Hz] on both sides, times a scale."""

    def left(mount: Mount, recordings: Sequence[Recording]) -> Array:
        found = residuals(mount, recordings, cutoff)
        return _seconds((p, rest, p.inside & (np.abs(p.v) > least)) for p, rest in found)

    return Judge(left, scale)


def slow_volts(volts: float) -> Judge:
    """RMS in V of the recorded duty, unfiltered, less that of the model's torque along the motion below 8 Hz."""

    def left(mount: Mount, recordings: Sequence[Recording]) -> Array:
        found = []
        for piece, rest in residuals(mount, recordings, 8.0):
            run = recordings[piece.recording]
            raw = rest - piece.tau + np.interp(piece.t, run.t, run["tau"])
            found.append((piece, raw, piece.inside & (np.abs(piece.v) > 0.08)))
        return _seconds(found)

    return Judge(left, 12.0 / volts)


def _means(mount: Mount, recordings: Sequence[Recording]) -> Array:
    found = residuals(mount, recordings, 30.0)
    return np.array([(rest.mean() ** 2, piece.tau.mean() ** 2) for piece, rest in found])


PER_SPEED = Judge(_means, 100.0)
"""RMS over recordings of one speed each of the mean residual, in percent of the RMS of the mean torques."""


def _seconds(found: Iterator[tuple[Piece, Array, Array]] | Sequence[tuple[Piece, Array, Array]]) -> Array:
    """Squares of what is left, and rows, of each second that has any."""
    blocks = []
    for piece, left, kept in found:
        of = ((piece.t - piece.t[0]) / BLOCK).astype(int)[kept]
        blocks.append(np.column_stack([np.bincount(of, left[kept] ** 2), np.bincount(of)]))
    stacked = np.concatenate(blocks)
    return stacked[stacked[:, 1] > 0]
