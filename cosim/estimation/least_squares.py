"""Least squares inside bounds, for few parameters and many rows."""

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from cosim.estimation.prepare import Array

QUICKER, SLOWER = 5.0, 4.0
"""By how much less the steps of a fit are damped after one that kept its promise, by how much more after one that was
taken back (twice that after the next). With a fixed factor of 5 and of 8 two of five steps were taken back; with these
and the gain ratio between one in four, and the same fits took .77 of the evaluations (48 fits of the demo)."""
ENOUGH = 1e-5
"""A fit ends when a step lowers the sum of squares, or promises to lower it, by less than this share."""


def least_squares(
    residuals: Callable[[Array], Array],
    equations: Callable[[Array, Array], tuple[Array, Array]],
    start: Array,
    bounds: tuple[Array, Array],
    evaluations: int,
    enough: float = ENOUGH,
) -> Array:
    """Minimise the sum of squares inside bounds: Levenberg-Marquardt on the normal equations, steps clipped.

    It ends after `evaluations`, or when a step lowers the sum by less than the share `enough` of it, or by the linear
    model would: of a diagnosis's evaluations a tenth served such steps.

    `equations` gives of x and the residuals there the normal matrix J^T J and the slope J^T r, J being the Jacobian:
    few parameters and many rows make them 10 times cheaper than a decomposition of it.
    Reference: Marquardt, J. SIAM 11 (1963) 431; scaling by the diagonal of the normal matrix; the damping follows the
    ratio of what a step gains to what it promised (Nielsen, IMM-REP-1999-05, Technical University of Denmark).
    """
    x, damping, slower = start, 1e-3, SLOWER
    r = residuals(x)
    cost = float(r @ r)
    normal, slope = equations(x, r)
    for _ in range(evaluations - 1):
        free = ~((x <= bounds[0]) & (slope > 0) | (x >= bounds[1]) & (slope < 0))
        step = _damped(normal, slope, damping, free)
        trial = np.clip(x + step, *bounds)
        promised = _promised(normal, slope, trial - x)
        if 0 <= promised < enough * cost:
            break
        r = residuals(trial)
        lower = float(r @ r)
        if not lower < cost:
            damping, slower = damping * slower, 2 * slower
            if damping > 1e6:
                break
            continue
        ratio = (cost - lower) / promised if promised > 0 else 1.0
        damping, slower = damping * max(1 / QUICKER, 1 - (2 * ratio - 1) ** 3), SLOWER
        gained, x, cost = 1 - lower / cost, trial, lower
        normal, slope = equations(x, r)
        if gained < enough:
            break
    return x


def of_jacobian(jacobian: Callable[[Array], Array]) -> Callable[[Array, Array], tuple[Array, Array]]:
    """The equations of residuals whose Jacobian (rows, parameters) is given."""

    def equations(x: Array, residual: Array) -> tuple[Array, Array]:
        columns = jacobian(x)
        return np.asarray(columns.T @ columns), np.asarray(columns.T @ residual)

    return equations


def _promised(normal: Array, slope: Array, step: Array) -> float:
    """By how much a step lowers the sum if residuals are linear; below zero where a bound has bent it uphill."""
    return -float(2 * slope @ step + step @ normal @ step)


def _damped(normal: Array, slope: Array, damping: float, free: npt.NDArray[np.bool_]) -> Array:
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = normal / np.outer(scale, scale) + (damping + 1e-10) * np.eye(len(scale))
    step = np.zeros_like(slope)
    step[free] = -np.linalg.solve(scaled[np.ix_(free, free)], (slope / scale)[free]) / scale[free]
    return step


def projected(target: Array, columns: Array) -> Array:
    """Return what ordinary least squares on the columns leaves of a target."""
    scale = np.sqrt((columns**2).sum(0))
    unit = columns / np.where(scale > 0, scale, 1.0)
    normal = unit.T @ unit + 1e-9 * np.eye(len(scale))
    return np.asarray(target - unit @ np.linalg.solve(normal, unit.T @ target))


def squares_left(columns: Array, targets: Array, positive: Sequence[int]) -> Array:
    """Sum of squares that least squares leaves of each target, (targets,), some coefficients not being below zero.

    What has any sign is taken out first, of those that have not and of the targets: what remains is Lawson and Hanson's
    problem. `columns` are (rows, n), `targets` (rows, targets).
    """
    from scipy.optimize import nnls  # .07 s to load, which the import of this file does not take

    free, held = np.delete(columns, positive, axis=1), columns[:, positive]
    held, targets = (one - free @ np.linalg.lstsq(free, one, rcond=None)[0] for one in (held, targets))
    return np.array([nnls(held, target)[1] ** 2 for target in targets.T])
