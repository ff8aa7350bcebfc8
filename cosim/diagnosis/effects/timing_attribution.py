"""Is the reading late, or the torque? Between the two of them nothing tells; the set point does.

A torque that acts late and a reading that is late are the same relation of torque and motion. But a loop that sees its
encoder in time corrects what the drive delays, and follows slow motion as before; a reading that reaches the recording
late trails the set point beside it by just that time. So the reading's lag behind slow set points is measured,

    q_d - q = L v_d + (terms in acceleration, jerk, direction and a constant),

and compared with the lag T that torque and motion show. L = T: the clock. L well below T: the drive. More than
that a loop may trail by itself, so either may be true; and without a recorded set point nothing is known.
"""

from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np

from cosim.estimation.filters import derivative, lowpass
from cosim.estimation.prepare import Array, Piece, Prepared

SLOW = 1.0
"""Hz: a loop follows motion this slow as well as it ever will."""
AGREES = 0.1
"""The two lags are one and the same if they differ by less than this share: a loop trails so by rare accident."""
SURE = 3.0
"""Standard errors of the lag that are allowed for."""


class ReadingLag(NamedTuple):
    """Time [s] by which the reading trails the set point in slow motion, and its standard error."""

    seconds: float
    error: float


def attributed(prepared: Prepared, seconds: float, sample_time: float) -> Literal["drive", "clock", "either"]:
    """What a torque that acts `seconds` late, to judge by torque and motion, is due to.

    Less than a sample is no matter of two clocks: one loop writes torque and reading of a row in the same tick.
    """
    if seconds < sample_time:
        return "drive"
    late = reading_lag(prepared)
    if late is None or SURE * late.error > seconds / 4:
        return "either"
    if abs(late.seconds - seconds) < AGREES * seconds + SURE * late.error:
        return "clock"
    return "drive" if late.seconds < seconds / 2 else "either"


@lru_cache(maxsize=4)
def reading_lag(prepared: Prepared) -> ReadingLag | None:
    """Measure it on all pieces together; None where position or set point was not recorded, or nothing moved."""
    if not prepared.has_position or any("q_d" not in piece.extras for piece in prepared.pieces):
        return None
    parts = [_followed(piece) for piece in prepared.pieces]
    behind, shapes = np.concatenate([b for b, _ in parts]), np.concatenate([s for _, s in parts])
    size = np.abs(shapes).max(0)
    if not size[0] > 0:
        return None
    scaled = shapes / np.where(size > 0, size, 1.0)
    fitted = np.linalg.lstsq(scaled, behind, rcond=1e-9)[0]
    own = scaled[:, 0] - scaled[:, 1:] @ np.linalg.lstsq(scaled[:, 1:], scaled[:, 0], rcond=1e-9)[0]
    independent = 2 * SLOW * sum(float(piece.t[-1] - piece.t[0]) for piece in prepared.pieces)
    error = np.std(behind - scaled @ fitted) / (np.std(own) + 1e-300) / np.sqrt(independent)
    return ReadingLag(float(fitted[0] / size[0]), float(error / size[0]))


def _followed(piece: Piece) -> tuple[Array, Array]:
    """How far the slow reading is behind its set point, (rows,), and what it may depend on, the lag first."""
    wanted = lowpass(piece.extras["q_d"], piece.dt, SLOW)
    v = derivative(wanted, piece.dt)
    a = derivative(v, piece.dt)
    turning = np.tanh(v / (0.01 * np.abs(v).max() + 1e-300))
    shapes = np.column_stack([v, a, derivative(a, piece.dt), turning, np.ones_like(v)])
    return (wanted - lowpass(piece.q, piece.dt, SLOW))[piece.inside], shapes[piece.inside]
