"""Quantities that a state follows along a recorded motion, as the plant's own state would (`learned_base.py`)."""

import numpy as np
from scipy.signal import lfilter

from cosim.estimation.prepare import Array, Piece
from pyfmi_models.effects.learned_base import SEEN_WITHIN


def followed(name: str, piece: Piece) -> Array:
    """The acceleration or the way travelled at all rows of a piece."""
    if name == "way":
        return np.concatenate([[0.0], np.cumsum(np.abs(piece.v[1:] + piece.v[:-1]) / 2 * piece.dt)])
    keep = np.exp(-piece.dt / SEEN_WITHIN)
    middle = np.concatenate([[0.0], (piece.v[1:] + piece.v[:-1]) / 2])
    past = lfilter([1 - keep], [1.0, -keep], middle)
    return np.asarray((piece.v - past) / SEEN_WITHIN)
