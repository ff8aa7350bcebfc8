"""A fitted structure without its rows: what held-out recordings must know of it, and how the ledger calls it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.diagnosis.answer.ledger import Key
from cosim.estimation.blocks import Blocks, covariance
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Array
from cosim.estimation.problem import Problem
from pyfmi_models.mount import Mount


@dataclass(frozen=True)
class Structure:
    """A mount, its fitted numbers, and how far training leaves them open."""

    mount: Mount
    free: tuple[str, ...]
    values: Array
    spread: Array
    """Covariance of the fitted numbers that holds whatever the noise is within a block (free, free)."""

    def directions(self, which: Sequence[int]) -> Array:
        """Independent changes of some fitted numbers, each of one standard error: (len(which), len(which)).

        A number of which training says nothing, as of a spot that a fit has sent far away, has no finite error: it
        counts as one of 1e150, which beside derivatives of nothing is nothing, and whose square can be divided by.
        """
        spread = np.nan_to_num(self.spread[np.ix_(which, which)]).clip(-1e300, 1e300)
        scale = np.sqrt(np.maximum(np.diag(spread), 1e-300))
        size, axes = np.linalg.eigh(spread / np.outer(scale, scale))
        return np.asarray(scale[:, None] * axes * np.sqrt(np.maximum(size, 0)))


def structure_of(problem: Problem, found: Fit) -> Structure:
    """What is kept of a fit."""
    weight, blocks = problem.weight, Blocks.of(problem.prepared)
    spread = covariance(found.slopes * weight[:, None], found.residual * weight, blocks)
    return Structure(found.mount, found.free, found.values, spread)


def key_of(effect: str, found: Fit) -> Key:
    """How the ledger calls a structure that is looked at for one of its effects."""
    return effect, found.free, found.values.tobytes()
