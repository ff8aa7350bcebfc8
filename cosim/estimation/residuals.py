"""What a structure leaves of recordings, and where something that was added removes it."""

import numpy as np

from cosim.estimation.inverse import Inverse
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.problem import Problem
from cosim.estimation.row_weights import far_from_turns
from pyfmi_models.mount import Mount

LEAST_REMOVED = 0.02
"""Share of the energy below which it says nothing where it is removed: what is slow and small removes as little."""
NO_BETTER = 0.01
"""Share of an error by which a model is no better: a larger one leaves less by chance. Unit: 1."""
LEAST_AT_REST = 10
"""Rows at rest below which nothing is concluded from them."""


def away_from_turns(problem: Problem, left: Array, without: Array) -> float:
    """Share of the energy that something removes which it removes away from turns; 1 where it hardly removes any.

    Args:
        problem: whose rows these are.
        left: weighted residual of training with it (rows,) [N m].
        without: the same without it.
    """
    removed = without**2 - left**2
    whole = float(removed.sum())
    if whole <= LEAST_REMOVED * float(without @ without):
        return 1.0
    return float(far_from_turns(problem.prepared) @ removed) / whole


def removed_at_rest(weight: Array, left: Array, without: Array) -> float:
    """Share of the energy at rest, of which a law without memory says nothing, that a contact that bends removes.

    There it says what is held, and must be right; 1 where the axis hardly rests.

    Args:
        weight: of each row for the law without memory (rows,); 0 where that says nothing.
        left: residual with the contact (rows,) [N m].
        without: the same without it.
    """
    rest = weight == 0
    if rest.sum() < LEAST_AT_REST:
        return 1.0
    return 1 - float(left[rest] @ left[rest]) / max(float(without[rest] @ without[rest]), 1e-300)


def gets_memory(mount: Mount, without: Mount) -> bool:
    """Whether friction remembers with something that was added, and did not without it."""
    return bool(mount.law.states()) and not without.law.states()


def residuals(prepared: Prepared, mount: Mount) -> list[Array]:
    """Measured minus model torque at all rows of each piece."""
    inverse = Inverse(mount, ())
    return [piece.tau - inverse.torque(piece, np.zeros(0))[0] for piece in prepared.pieces]


def kept(prepared: Prepared, mount: Mount) -> Array:
    """The same at the kept rows of all pieces."""
    return np.concatenate([one[p.kept] for one, p in zip(residuals(prepared, mount), prepared.pieces, strict=True)])


def inside(prepared: Prepared, mount: Mount) -> Array:
    """The same at all rows away from the edges of pieces."""
    return np.concatenate([one[p.inside] for one, p in zip(residuals(prepared, mount), prepared.pieces, strict=True)])
