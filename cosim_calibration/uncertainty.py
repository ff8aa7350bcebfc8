"""How well the numbers of a calibration are known, and which combinations the recordings do not determine.

    C = g s^2 (J' J)^-1,     s^2 = |z|^2 / (N - p),     g = N / N_eff = 1 + 2 sum rho_k

with rho_k the autocorrelation of the residual of an output in its recording, summed up to a window of 6 times the sum
(Sokal): residuals that hang together count once for each time that they take to forget. Each output has a g of its own
(its rows of J are divided by sqrt(g)). For the loss "soft_l1" s^2 is mean(psi^2) / mean(psi')^2 (Huber 1981, 7.6).

A singular direction v of J, for relative changes of the numbers, is not determined where a change by all of it moves
the outputs by less than their noise: |J v| < s. Two numbers that only act as a product leave v = (1, -1) / sqrt(2).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from cosim_calibration.experiment import Array
from cosim_calibration.fit import Fit
from cosim_calibration.free import Free
from cosim_calibration.residuals import Rows

WINDOW = 6.0
"""Lags that are summed, times the sum so far."""
PART = 0.2
"""Share of a direction from which a number belongs to it."""
ALIKE = 0.1
"""Share by which two parts of a direction may differ and still be called equal."""
NOTHING = 1e-9
"""Derivative, relative to the largest, below which a number changes nothing."""
LEAST = 1e-3
"""Size of a number that ended near zero, in scales, for relative changes."""
FEW = 8
"""Rows from which an autocorrelation is estimated."""


@dataclass(frozen=True)
class Direction:
    """A combination of numbers that is not determined: each with its relative change; and a sentence on it."""

    parts: dict[str, float]
    statement: str
    idle: bool = False
    """Whether it is one number that changes nothing at all."""


@dataclass(frozen=True)
class Uncertainty:
    """Standard errors by number (inf where it is not determined), correlations, effective samples by output."""

    standard_errors: tuple[float, ...]
    correlation: Array
    samples: dict[str, float]
    not_determined: tuple[Direction, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Numbers that take part in a direction which is not determined."""
        return tuple(dict.fromkeys(name for one in self.not_determined for name in one.parts))

    def of_shared(self, free: Sequence[Free]) -> tuple["Uncertainty", tuple[str, ...]]:
        """What holds for the numbers that all experiments share, which come first; and a note on the others."""
        count = sum(one.experiment < 0 for one in free)
        own = {one.name for one in free[count:]}
        kept = tuple(one for one in self.not_determined if not own.issuperset(one.parts))
        lost = own.intersection(self.names)
        said = (f"{len(lost)} of {len(own)} start values are not determined.",) if lost else ()
        correlation = self.correlation[:count, :count]
        return replace(
            self, standard_errors=self.standard_errors[:count], correlation=correlation, not_determined=kept
        ), said


def uncertainty_of(found: Fit, free: Sequence[Free], scales: Array, rows: Rows) -> Uncertainty:
    """Judge a fit."""
    factors = [_forgetting(found.z[run]) for run in rows.runs]
    inflation = np.concatenate([np.full(r.stop - r.start, f) for r, f in zip(rows.runs, factors, strict=True)])
    samples = {name: float(np.sum(1 / inflation[rows.output == k])) for k, name in enumerate(rows.names)}
    size = np.maximum(np.abs(found.x), LEAST)
    relative = found.jacobian * size / np.sqrt(inflation)[:, None]
    noise = max(_noise(found, len(free)), LEAST)  # weights count in units of no less than a solver's exactness
    directions, covariance = _judged(relative, noise, [one.name for one in free])
    lost = {name for one in directions for name in one.parts}
    deviations = np.sqrt(np.maximum(np.diag(covariance), 0))
    errors = np.where([one.name in lost for one in free], np.inf, deviations * size * scales)
    outer = np.outer(deviations, deviations)
    correlation = np.divide(covariance, outer, out=np.eye(len(free)), where=outer > 0)
    return Uncertainty(tuple(errors.tolist()), correlation, samples, directions)


def _judged(relative: Array, noise: float, names: Sequence[str]) -> tuple[tuple[Direction, ...], Array]:
    """Directions that are not determined, and the covariance of relative changes of the rest.

    Numbers that change nothing go first, for what is left of a singular space is then as plain as it can be.
    """
    slopes = np.linalg.norm(relative, axis=0)
    directions = [
        _alone(names[k], float(slopes[k]), float(slopes.max())) for k in range(len(names)) if slopes[k] < noise
    ]
    kept = [k for k in range(len(names)) if slopes[k] >= noise]
    covariance = np.zeros((len(names), len(names)))
    if len(kept):
        spans, turns = np.linalg.svd(relative[:, kept], full_matrices=False)[1:]
        weak = spans < noise
        directions += [_together(turn, [names[k] for k in kept]) for turn in _plain(turns[weak])]
        strong = turns[~weak] / spans[~weak, None]
        covariance[np.ix_(kept, kept)] = noise**2 * strong.T @ strong
    return tuple(directions), covariance


def _plain(turns: Array) -> Array:
    """A basis of the same space in which each vector has as few parts as elimination gives, of length 1."""
    rows = turns.copy()
    for k in range(len(rows)):
        pivot = int(np.argmax(np.abs(rows[k])))
        rows[k] /= rows[k, pivot]
        for other in range(len(rows)):
            if other != k:
                rows[other] -= rows[other, pivot] * rows[k]
    lengths = np.linalg.norm(rows, axis=1, keepdims=True)
    found: Array = rows / np.where(lengths > 0, lengths, 1)
    return found


def _noise(found: Fit, count: int) -> float:
    """Standard deviation of a residual, as the loss weighs it."""
    if found.loss == "linear":
        return sqrt(float(found.z @ found.z) / max(1, len(found.z) - count))
    u = found.z / found.outlier
    slope = (1 + u**2) ** -0.5
    psi, bend = found.z * slope, slope**3
    return sqrt(float(np.mean(psi**2))) / max(float(np.mean(bend)), 1e-3)


def _forgetting(z: Array) -> float:
    """N / N_eff of a residual in its order; its mean counts, for an offset is what hangs together most."""
    count, power = len(z), float(z @ z)
    if count < FEW or power == 0:
        return 1.0
    spectrum = np.abs(np.fft.rfft(z, 2 * count)) ** 2
    rho = np.fft.irfft(spectrum)[: count // 2] / power
    total = 1.0
    for lag in range(1, len(rho)):
        if lag > WINDOW * total:
            break
        total += 2 * float(rho[lag])
    return max(1.0, total)


def _alone(name: str, slope: float, largest: float) -> Direction:
    if slope <= NOTHING * largest:
        return Direction({name: 1.0}, f"{name} changes nothing that was recorded.", True)
    said = f"The recordings do not determine {name}: doubling it moves what was recorded by less than its noise."
    return Direction({name: 1.0}, said)


def _together(turn: Array, names: Sequence[str]) -> Direction:
    parts = {name: float(part) for name, part in zip(names, turn, strict=True) if abs(part) >= PART}
    *others, last = parts
    if len(parts) == 1:
        return Direction(parts, f"The recordings do not determine {last} well enough beside the others.")
    first, second = list(parts.values())[:2]
    if len(parts) == 2 and abs(abs(first) - abs(second)) <= ALIKE:
        what = "product" if first * second < 0 else "ratio"
        return Direction(parts, f"{others[0]} and {last} act only as a {what}: one of them must be known.")
    return Direction(parts, f"{', '.join(others)} and {last} are determined only together: one of them must be known.")
