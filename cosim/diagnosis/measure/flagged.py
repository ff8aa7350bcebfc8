"""When torque is missing: spans of time in which what the base leaves is louder than the noise at the same speed.

Noise is what the better model leaves, or the base where there is none better. What is there only some of the time must
not set the measure: the base is fitted once more by least absolute deviations, noise is a median, and both come from
the training recordings. A span is loud where a chain of two states says so, noise of the usual size or `loud` times
that, three at least,

    log p(loud) - log p(quiet) = z^2 (1 - 1 / loud^2) / 2 - log(loud),     z = residual / noise at this speed,

a change of state costing `CHANGE`: residual and reversals say nothing and do not end a span. Reference: Viterbi, IEEE
Trans. Inf. Theory 13 (1967) 260.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.diagnosis.evidence.bands import noise_over_speed
from cosim.estimation.prepare import Array
from cosim.estimation.row_weights import CLEAR_MOTION
from cosim.support.statistics import SURELY, rms, robust_rms

Mask = npt.NDArray[np.bool_]
Spans = tuple[tuple[float, float], ...]

CELL = 0.1
"""Seconds of one step of the chain: the residual is averaged over it."""
INDEPENDENT = 0.3
"""Share of a cell that counts as an independent observation: the residual of neighbouring cells is alike."""
CHANGE = 5.0
"""Log-odds that a change of state costs: quiet at three times the noise, some two seconds."""
MOST = 3.0
"""Times log(loud) that one cell says at most for being loud: one spike is no span."""
MOST_NOISE = 3.0
"""Noise at one speed is no larger than this times that at the others: few moves are that fast, and what is missing may
be in most of them."""
ROUNDS = 20


@dataclass(frozen=True)
class Residual:
    """A contiguous piece of a recording at its rows: time, speed, and what base and better model leave."""

    t: Array
    v: Array
    residual: Array
    after: Array
    slopes: Array
    """Derivative of the needed torque by each number of the base, (rows, n)."""
    fitted: bool
    """Whether the base may be fitted to it."""


def noise_at(speed: Array, residual: Array, wanted: Array) -> Array:
    """Standard deviation of a residual at the wanted speeds, from medians in bins of equal count."""
    return noise_over_speed(residual, speed, robust_rms, MOST_NOISE).at(wanted)


def flagged(residuals: Sequence[Residual]) -> list[Spans]:
    """Spans of each piece in which the residual is loud."""
    least = CLEAR_MOTION * max(float(np.abs(one.v).max()) for one in residuals)
    cells = [_cells(one, left, least) for one, left in zip(residuals, _robust_residuals(residuals, least), strict=True)]
    known = [cell for cell, one in zip(cells, residuals, strict=True) if one.fitted]
    names = ("speed", "residual", "after")
    speed, residual, after = (np.concatenate([cell[name][cell["moving"] > 0] for cell in known]) for name in names)
    if not len(speed):
        return [() for _ in residuals]

    def noise(wanted: Array) -> Array:
        return np.minimum(noise_at(speed, residual, wanted), noise_at(speed, after, wanted))

    sizes = np.abs(residual) / noise(speed)
    beyond = sizes[sizes > SURELY]
    loud = max(SURELY, rms(beyond)) if len(beyond) else SURELY
    return [_spans(cell, noise(cell["speed"]), loud) for cell in cells]


def _robust_residuals(residuals: Sequence[Residual], least: float) -> list[Array]:
    """What the base leaves when it is fitted by least absolute deviations to the clear motion of what may be fitted."""
    slopes = np.concatenate([one.slopes for one in residuals if one.fitted])
    residual = np.concatenate([one.residual for one in residuals if one.fitted])
    counts = np.concatenate([np.abs(one.v) > least for one in residuals if one.fitted])
    scale = np.sqrt((slopes**2).sum(0)) + 1e-300
    change, weight = np.zeros(len(scale)), counts.astype(float)
    for _ in range(ROUNDS if counts.any() else 0):
        weighted = (slopes / scale).T * weight
        normal = weighted @ (slopes / scale) + 1e-9 * weight.mean() * np.eye(len(scale))
        change = np.linalg.solve(normal, weighted @ residual)
        left = np.abs(residual - slopes @ (change / scale))
        weight = counts / (left + 0.1 * float(np.median(left[counts])) + 1e-300)
    return [one.residual - one.slopes @ (change / scale) for one in residuals]


def _cells(one: Residual, left: Array, least: float) -> dict[str, Array]:
    """Means over cells of `CELL` seconds of what moves: residuals, speed; whether most of a cell moves; its start."""
    number = ((one.t - one.t[0]) / CELL).astype(int)
    moving = (np.abs(one.v) > least).astype(float)
    count, rows = np.bincount(number, moving), np.bincount(number)
    mean = {
        name: np.bincount(number, moving * values) / np.maximum(count, 1.0)
        for name, values in (("residual", left), ("after", one.after), ("speed", np.abs(one.v)))
    }
    return {**mean, "moving": (2 * count > rows).astype(float), "start": one.t[0] + CELL * np.arange(len(rows))}


def _spans(cell: dict[str, Array], noise: Array, loud: float) -> Spans:
    gain = 0.5 * (cell["residual"] / noise) ** 2 * (1 - loud**-2)
    odds = INDEPENDENT * cell["moving"] * (np.minimum(gain, MOST * np.log(loud)) - np.log(loud))
    state = np.concatenate([[False], loud_states(odds, CHANGE), [False]])
    edges = np.append(cell["start"], cell["start"][-1] + CELL)
    starts, ends = np.flatnonzero(~state[:-1] & state[1:]), np.flatnonzero(state[:-1] & ~state[1:])
    return tuple((float(a), float(b)) for a, b in zip(edges[starts], edges[ends], strict=True))


def loud_states(odds: Array, change: float) -> Mask:
    """The likeliest chain of two states from the log-odds of the second in each step, a change costing `change`."""
    score, back = np.zeros(2), np.zeros((len(odds), 2), int)
    for step, odd in enumerate(odds):
        changed = score[::-1] - change
        back[step] = np.where(score >= changed, [0, 1], [1, 0])
        score = np.maximum(score, changed) + np.array([0.0, odd])
    state, chain = int(score[1] > score[0]), np.zeros(len(odds), bool)
    for step in range(len(odds) - 1, -1, -1):
        chain[step], state = bool(state), int(back[step, state])
    return chain
