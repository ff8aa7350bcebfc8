"""Quantities that no moment tells, along a recorded motion: what the plant's own states follow (`learned_base.py`)."""

import numpy as np

from cosim.estimation.prepare import Array, Piece
from cosim.estimation.rowwise import recurrence
from pyfmi_models.effects.learned_base import SEEN_WITHIN


def followed(name: str, piece: Piece) -> Array:
    """The acceleration or the way travelled at all rows of a piece."""
    if name == "way":
        return np.concatenate([[0.0], np.cumsum(np.abs(piece.v[1:] + piece.v[:-1]) / 2 * piece.dt)])
    keep = np.exp(-piece.dt / SEEN_WITHIN)
    middle = np.concatenate([[0.0], (piece.v[1:] + piece.v[:-1]) / 2])
    past = recurrence(np.full(len(middle), keep), (1 - keep) * middle[None])[0, 1:]
    return np.asarray((piece.v - past) / SEEN_WITHIN)


def since_reversal(name: str, piece: Piece) -> Array:
    """The time or the way since the speed last changed its sign, or since the start, at all rows of a piece."""
    turned = np.diff(np.sign(piece.v), prepend=np.sign(piece.v[:1])) != 0
    last = np.maximum.accumulate(np.where(turned, np.arange(len(turned)), 0))
    return np.asarray(piece.t - piece.t[last] if name == "time since reversal" else np.abs(piece.q - piece.q[last]))
