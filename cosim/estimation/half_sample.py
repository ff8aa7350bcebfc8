"""Torque that is stamped up to half a row early or late, as loggers stamp it.

    tau(t) of the card's equation is the mean over the row that is centred at t
    ordered at t and held until the next row: acts half a row later
    measured as the mean since the last row:  acts half a row earlier

A file does not say which of them it holds; torque and motion together do. What is late by half of a row is no delay of
the machine. Left as it is, each line of the motion leaves one in the residual, as large as the torque grows meanwhile.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cosim.data.recording import Recording
from cosim.estimation.blocks import Blocks, covariance
from cosim.estimation.filters import derivative
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import JITTER
from cosim.estimation.problem import Problem
from cosim.estimation.residuals import NO_BETTER

LEAST, MOST = 0.3, 0.65
"""Rows by which such a stamp is off; no way of logging makes less, and more is a delay (`effects.delay_and_lag`)."""
SURE = 10.0
"""Standard errors by which it must differ from zero; they are those of a few blocks. Unit: 1."""


def torque_late(problem: Problem, base: Fit) -> float:
    """Time [s] by which the recorded torque acts later than it is stamped; 0 where it is not sure, or is no stamp.

    tau(t - d) = model: to first order the residual is d times the slope of the torque, beside what the free numbers
    of the base explain. Rows that come unevenly are no ticks of what orders the torque, and nothing is said of them.
    """
    slope = np.concatenate([derivative(piece.tau, piece.dt)[piece.kept] for piece in problem.prepared.pieces])
    columns = problem.weight[:, None] * np.column_stack([slope, base.slopes])
    residual = problem.weight * base.residual
    size = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(size > 0, size, 1.0)
    found = np.linalg.lstsq(scaled, residual, rcond=1e-10)[0]
    left = residual - scaled @ found
    error = float(np.sqrt(covariance(scaled, left, Blocks.of(problem.prepared))[0, 0]))
    late = float(found[0] / max(size[0], 1e-300))
    is_sure = abs(found[0]) > SURE * error and left @ left < (1 - NO_BETTER) * (residual @ residual)
    rows = abs(late) / problem.sample_time
    return late if is_sure and LEAST < rows < MOST else 0.0


def are_even(recordings: Sequence[Recording]) -> bool:
    """Whether rows come evenly, as the ticks of a controller or of a drive do."""
    return all(recording.jitter <= JITTER for recording in recordings)


def moved(recording: Recording, seconds: float) -> Recording:
    """The recording with its torque so much later, less than a row: the mean of two orders that are held."""
    if not seconds:
        return recording
    tau = np.interp(recording.t - seconds, recording.t, recording["tau"])
    return replace(recording, table=recording.table | {"tau": tau})
