"""Least squares over several starts, with the weights of outputs found by the fit.

    minimise  sum rho(z^2)  over x in its bounds,        rho(s) = s, or 2 (sqrt(1 + s) - 1) for "soft_l1"

Weights are first one over the spread of each measured output, then one over the RMS of its residual, which makes the
least squares those of greatest likelihood for independent noise of the outputs. Reference: Ljung, System Identification
(1999), 7.4; solver: SciPy's trust region reflective (Branch, Coleman, Li, 1999).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Literal, get_args

import numpy as np
from scipy.optimize import least_squares

from cosim.support.statistics import robust_rms
from cosim_calibration.experiment import Array
from cosim_calibration.free import Free
from cosim_calibration.residuals import Residuals

Loss = Literal["linear", "soft_l1"]
LOSSES: tuple[Loss, ...] = get_args(Loss)
FACTOR = 5.0
"""Further starts lie within this factor of the numbers that were given."""
TRIED = 8
"""Random points that are simulated for each further start, of which the best becomes the start."""
EVALUATIONS = 60
"""Evaluations of one start; derivatives come on top."""
TOLERANCE = 1e-8
ROUGH = 1e-4
"""Tolerance of a first look: weights are found after it, and the fit goes on with them."""
AGREE = 1e-3
"""Share by which the sums of two starts may differ to have found the same minimum."""
ROUNDS = 3
"""Rounds in which the weights of outputs are found."""
SETTLED = 0.1
"""Share by which a weight may still change: standard errors follow it, the numbers hardly."""
EXACT = 1e-6
"""Least residual of an output relative to its spread: no solver is more exact."""
WIDTHS = (3.0, 1.5, 0.8, 0.8)
"""Standard errors over which points are drawn on a staircase, round by round."""
DRAWN = 25
"""Points of a round for each number."""
REACH = 0.1
"""Greatest deviation that is drawn, relative to a number's scale."""
BAD = 10.0
"""Rows of a point that cannot be simulated, times the RMS at the start."""


@dataclass(frozen=True)
class Fit:
    """Where a fit ended: x = p / scale, the weighted residual there, its derivatives, and the sum by start."""

    x: Array
    z: Array
    jacobian: Array
    loss: str
    outlier: float
    """Residual beyond which the loss is linear."""
    starts: tuple[float, ...]
    agreeing: int
    """Starts that ended at the same least sum."""


def fit(
    residuals: Residuals,
    x: Array,
    starts: int,
    seed: int,
    loss: Loss,
    say: Callable[[str], None],
    directional: bool = False,
) -> Fit:
    """Fit from the point given and from random ones near it.

    Args:
        residuals: of the experiments, with weights for a first look; they are changed.
        x: start, x = p / scale.
        starts: how many starts.
        seed: of the random ones.
        loss: one of `LOSSES`.
        say: told in a few words what is being done.
        directional: whether the FMU's own derivatives are taken where they agree with differences.
    """
    spread = residuals.rows.spread
    residuals.weights = 1 / spread
    if directional:
        residuals.notes = residuals.use_directional(residuals.inside(x))
    z = residuals.at(x)
    residuals.bad = BAD * max(float(np.sqrt(np.mean(z**2))), 1.0)
    residuals.quick = True
    found: list[tuple[float, Array]] = []
    for k, one in enumerate(_starts(residuals, x, starts, seed)):
        say(f"start {k + 1} of {starts}")
        found.append(_minimum(residuals, one, loss, _outlier(z, loss), ROUGH))
        if _agreeing(found) > 1:
            break
    best = min(found, key=lambda pair: pair[0])[1]
    residuals.quick = False
    agreeing = _agreeing(found)
    residuals.settle(best)
    best, outlier = _weighted(residuals, best, loss, say)
    if residuals.stairs:
        say("searching among the steps of the model")
        best = _searched(residuals, best, loss, outlier, seed)
    jacobian = residuals.jacobian(best, final=True)
    return Fit(best, residuals.at(best), jacobian, loss, outlier, tuple(one for one, _ in found), agreeing)


def _weighted(residuals: Residuals, best: Array, loss: Loss, say: Callable[[str], None]) -> tuple[Array, float]:
    """Find the weights of outputs and fit on with them."""
    rows, outlier = residuals.rows, 1.0
    for k in range(ROUNDS):
        rest = residuals.at(best) / residuals.weights[rows.output]
        noise = np.array([_size(rest[rows.output == one], loss) for one in range(len(rows.names))])
        weights = 1 / np.maximum(noise, EXACT * rows.spread)
        change = float(np.abs(weights / residuals.weights - 1).max())
        residuals.weights, outlier = weights, 1.0
        if k and change < SETTLED:
            break
        say(f"weights of outputs, round {k + 1}")
        residuals.bad = BAD * max(float(np.sqrt(np.mean(residuals.at(best) ** 2))), 1.0)
        best = _minimum(residuals, best, loss, outlier)[1]
    return best, outlier


def _minimum(
    residuals: Residuals, x: Array, loss: Loss, outlier: float, tolerance: float = TOLERANCE
) -> tuple[float, Array]:
    low = np.array([one.low for one in residuals.free]) / residuals.scales
    high = np.array([one.high for one in residuals.free]) / residuals.scales
    edge = np.where(np.isfinite(high - low), 1e-9 * (high - low), 1e-9)
    fixed = high - low <= 0
    high = np.where(fixed, high + 1e-9, high)
    inside = np.clip(x, low + np.where(fixed, 0, edge), high - np.where(fixed, 0, edge))
    done = least_squares(
        residuals.at,
        inside,
        residuals.jacobian,
        (low, high),
        x_scale="jac",
        loss=loss,
        f_scale=outlier,
        ftol=tolerance,
        xtol=tolerance,
        gtol=1e-12,
        max_nfev=EVALUATIONS,
    )
    return float(done.cost), np.asarray(done.x, np.float64)


def _searched(residuals: Residuals, x: Array, loss: Loss, outlier: float, seed: int) -> Array:
    """Search around a minimum of a staircase, which has many: points drawn from the normal distribution of its errors.

    Each round is narrower than the one before and begins at the best point so far.
    """
    random = np.random.default_rng(seed)
    best, least = x, _cost(residuals.at(x), loss, outlier)
    for width in WIDTHS:
        slopes = residuals.jacobian(best)
        noise = sqrt(2 * least / max(1, len(slopes) - len(best)))
        spans, turns = np.linalg.svd(slopes, full_matrices=False)[1:]
        errors = noise / np.maximum(spans, np.finfo(float).eps * max(float(spans[0]), 1e-300))
        reach = np.minimum(errors, REACH)
        points = [
            best + width * (reach * random.standard_normal(len(best))) @ turns
            for _ in range(DRAWN * len(residuals.groups))
        ]
        costs = [_cost(z, loss, outlier) for z in residuals.many([residuals.inside(one) for one in points])]
        k = int(np.argmin(costs))
        if costs[k] < least:
            best, least = residuals.inside(points[k]), costs[k]
    return best


def _cost(z: Array, loss: Loss, outlier: float) -> float:
    """Half the sum of rho(z^2), as the solver has it."""
    u = (z / outlier) ** 2
    return 0.5 * outlier**2 * float(np.sum(u if loss == "linear" else 2 * (np.sqrt(1 + u) - 1)))


def _starts(residuals: Residuals, x: Array, count: int, seed: int) -> list[Array]:
    """The start that is given, and the best of random points for each further one."""
    if count < 2:
        return [x]
    random = np.random.default_rng(seed)
    points = [_drawn(residuals.free, residuals.scales, random) for _ in range(TRIED * (count - 1))]
    costs = [float(z @ z) for z in residuals.many(points)]
    groups = np.array_split(np.argsort(costs), count - 1)
    return [x, *(points[int(group[0])] for group in groups)]


def _drawn(free: Sequence[Free], scales: Array, random: np.random.Generator) -> Array:
    """A random point: within a factor of the start, or within a scale of zero."""
    values = []
    for one in free:
        u = float(random.uniform(-1, 1))
        near = one.start * FACTOR**u if one.start else one.start + u * one.scale
        value = near if one.experiment < 0 else one.start  # a reading is near the truth
        values.append(np.clip(value, one.low, one.high))
    return np.array(values, np.float64) / scales


def _agreeing(found: Sequence[tuple[float, Array]]) -> int:
    """How many starts ended at the least sum."""
    least = min(cost for cost, _ in found)
    return sum(cost <= least * (1 + AGREE) + 1e-300 for cost, _ in found)


def _outlier(z: Array, loss: str) -> float:
    return 1.0 if loss == "linear" else max(robust_rms(z), EXACT)


def _size(rest: Array, loss: str) -> float:
    """Size of the residuals of an output; a robust one where outliers are expected."""
    return float(np.sqrt(np.mean(rest**2))) if loss == "linear" else robust_rms(rest)
