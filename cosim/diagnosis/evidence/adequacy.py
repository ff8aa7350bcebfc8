"""How large is what a structure leaves? Its slow part in clear motion, relative to the friction torque.

Friction that is not quite the law's, a level that wanders, coloured noise: all that stays small. Nothing is compared
between recordings, so a push that comes once is seen as well as one that always comes; what grew only on the held-out
recording, as a warm-up can, is missing as well.
"""

import numpy as np
import numpy.typing as npt

from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.discrepancy import forms
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.estimation.fit import Fit
from cosim.estimation.least_squares import projected
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.row_weights import far_from_turns

LEAST_WRONG = 0.01
"""Error of a cell, at least, relative to the friction: no law is better. Unit: 1."""
CELL = 0.25
"""Seconds over which the rest is averaged: noise and presliding go, what lasts stays."""
LEAST_FRICTION = 0.1
"""Where friction is less than this share of the torque, that share of the torque stands for it."""
KNOT = 1.0
"""Seconds between the knots of a torque, or a friction level, that is free over time."""


def share_left(comparison: Comparison, found: Fit) -> float:
    """Slow part of what a structure leaves of the training recordings."""
    return _slow(found.residual, _clear(comparison), comparison.problem.prepared) / friction_level(comparison)


def share_there(comparison: Comparison, found: Fit, residual: Array, held: Predictive) -> float:
    """Slow part of what a structure leaves of recordings that it was not fitted to, by the friction of those it was.

    Beside what its numbers may be otherwise there: a base that training hardly tells foretells other speeds badly, and
    nothing is missing for that. They move as far as cells say that are as uncertain as those of training are wrong.
    """
    friction, clear_there = friction_level(comparison), _clear_there(comparison, held)
    wrong = max(_slow(found.residual, _clear(comparison), comparison.problem.prepared), LEAST_WRONG * friction)
    left = residual - _moved(residual, held.moved(found), clear_there, held.prepared, wrong)
    return _slow(left, clear_there, held.prepared) / friction


def _moved(residual: Array, columns: Array, weight: Array, prepared: Prepared, wrong: float) -> Array:
    """What unit-normal amounts of some columns explain of a residual, told by means over cells of an error `wrong`."""
    cell, _ = _cells(prepared)
    count = np.bincount(cell, weight)
    sums = np.column_stack([np.bincount(cell, weight * one) for one in (residual, *columns.T)])
    means = np.divide(sums, count[:, None], out=np.zeros_like(sums), where=count[:, None] > 0)
    root = np.sqrt(count / max(count.max(initial=0.0), 1e-300))[:, None] / wrong
    whole = np.vstack([root * means[:, 1:], np.eye(columns.shape[1])])
    target = np.concatenate([root[:, 0] * means[:, 0], np.zeros(columns.shape[1])])
    return np.asarray(columns @ np.linalg.lstsq(whole, target, rcond=None)[0])


def share_beside(comparison: Comparison, found: Fit, residual_there: Array, held: Predictive) -> float:
    """Slow part beside what friction laws cannot agree on and a level that wanders; in training or held out, the more.

    What is left of either cannot be friction of another law, so that little of it is no misfit. Nor is what the
    equations of the named effects may miss of their machine's.
    """
    prepared, here, there = comparison.problem.prepared, comparison.nuisances.columns, held.nuisances.columns
    friction, sizes = friction_level(comparison), []
    for residual, weight, rows, nuisances in (
        (found.residual, _clear(comparison), prepared, here),
        (residual_there, _clear_there(comparison, held), held.prepared, there),
    ):
        missed = forms(found, len(comparison.problem.mount.effects), rows)
        if missed:
            wrong = max(_slow(residual, weight, rows), LEAST_WRONG * friction)
            residual = residual - _moved(residual, comparison.policy.misfit * missed.columns, weight, rows, wrong)
        sizes.append(_lasting(_unexplained(residual, weight, nuisances), weight, rows))
    return max(sizes) / friction


def over_time(comparison: Comparison, found: Fit) -> str:
    """Which explains more: a torque that is free over time, or a friction level that is."""
    prepared, level = comparison.problem.prepared, comparison.nuisances.level
    clear = _clear(comparison)
    rest, left, first = found.residual * clear, {"time": 0.0, "friction level over time": 0.0}, 0
    for piece in prepared.pieces:
        rows = slice(first, first + len(piece.kept))
        hats, first = _hats(piece.t[piece.kept]), rows.stop
        for name, factor in zip(left, (np.abs(level), level), strict=True):
            left[name] += float(np.sum(projected(rest[rows], hats * (clear * factor)[rows, None]) ** 2))
    return min(left, key=lambda name: left[name])


def _clear(comparison: Comparison) -> Array:
    """Rows of clear motion away from turns in training."""
    return np.asarray(comparison.problem.weight * far_from_turns(comparison.problem.prepared))


def _clear_there(comparison: Comparison, held: Predictive) -> Array:
    """Rows of clear motion of held-out recordings where training has been: of the rest no model was ever fitted."""
    weight = far_from_turns(held.prepared)
    for axis in ("q", "v", "tau"):
        trained, there = comparison.problem.prepared.stacked(axis), held.prepared.stacked(axis)
        weight = weight * ((there >= trained.min()) & (there <= trained.max()))
    return np.asarray(weight)


def friction_level(comparison: Comparison) -> float:
    """RMS of the friction torque in clear motion away from turns."""
    clear, tau = _clear(comparison), comparison.problem.prepared.stacked("tau")
    level, torque = (_rms(one, clear) for one in (comparison.nuisances.level, tau))
    return max(level, LEAST_FRICTION * torque, 1e-300)


def _unexplained(residual: Array, weight: Array, columns: Array) -> Array:
    """What no combination of columns explains of a residual, at the rows that count."""
    root = np.sqrt(weight)
    left = projected(root * residual, root[:, None] * columns)
    return np.asarray(np.divide(left, root, out=np.zeros_like(left), where=root > 0))


def _rms(values: Array, weight: Array) -> float:
    return float(np.sqrt((weight @ values**2) / max(weight.sum(), 1e-300)))


def _slow(values: Array, weight: Array, prepared: Prepared) -> float:
    """RMS of the means over cells of `CELL` seconds."""
    cell, _ = _cells(prepared)
    count, total = (np.bincount(cell, one) for one in (weight, weight * values))
    return _rms(total / np.maximum(count, 1e-300), np.asarray(count, float))


def _lasting(values: Array, weight: Array, prepared: Prepared) -> float:
    """RMS of what the halves of cells have in common: noise, which they have not, adds nothing."""
    cell, half = _cells(prepared)
    many = int(cell.max()) + 1
    counts, totals = (
        [np.bincount(cell[half == k], one[half == k], many) for k in (0, 1)] for one in (weight, weight * values)
    )
    both = (counts[0] > 0) & (counts[1] > 0)
    means = [total[both] / count[both] for total, count in zip(totals, counts, strict=True)]
    share = (counts[0] + counts[1])[both]
    common = float(share @ (means[0] * means[1])) / max(float(share.sum()), 1e-300)
    return float(np.sqrt(max(0.0, common)))


def _cells(prepared: Prepared) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """The cell of `CELL` seconds that each kept row lies in, and in which half of it."""
    number = np.concatenate([np.full(len(piece.kept), k) for k, piece in enumerate(prepared.pieces)])
    halves = np.floor(2 * prepared.stacked("t") / CELL).astype(np.int64)
    _, cell = np.unique(np.column_stack([number, halves // 2]), axis=0, return_inverse=True)
    return cell.ravel(), halves % 2


def _hats(t: Array) -> Array:
    """Straight lines between knots every `KNOT` seconds: (rows, knots)."""
    count = max(2, round(float(t[-1] - t[0]) / KNOT)) if len(t) > 1 else 2
    place = (t - t[0]) / max(float(t[-1] - t[0]), 1e-9) * count
    return np.asarray(np.maximum(0.0, 1 - np.abs(place[:, None] - np.arange(count + 1))))
