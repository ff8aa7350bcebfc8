"""Is an effect really asked for by the set point, or is it how the loop answers noise?

Where a motion asks nothing of the upper band, torque and acceleration there are noise and the controller's answer to
it. Least squares takes that answer for mechanics: an inertia that is less where the loop is slow is a spring. Noise
knows nothing of the set point. With x what the effect adds along the measured motion, z the same along the set point,
and r what the structure leaves, all free of the base's tangents and of what friction laws lack,

    share = 1 + z'r / z'x

is how much of the effect the set point asks for: 1 of a real one, 0 of the loop's answer.
Reference: Soderstrom and Stoica, Instrumental Variable Methods for System Identification, 1983, chapter 5.
"""

from dataclasses import replace

import numpy as np

from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.search.instrumental_variable import on_set_point
from cosim.estimation.blocks import Blocks
from cosim.estimation.fit import Fit
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.least_squares import projected
from cosim.estimation.prepare import Array, Piece
from cosim.support.statistics import SURELY
from pyfmi_models.effects import Effect

BLOCK_SECONDS = 2.0
"""Longer than the residual remembers, short enough for many."""


def is_asked_for(comparison: Comparison, found: Fit, effect: Effect) -> bool:
    """Whether the set point asks for a fitted effect; true where no set point was recorded."""
    prepared, problem = comparison.problem.prepared, comparison.problem
    if not prepared.has_position or any("q_d" not in piece.extras for piece in prepared.pieces):
        return True
    weight = problem.weight
    along = weight * _added(found, effect, prepared.pieces)
    asked = weight * _added(found, effect, tuple(map(on_set_point, prepared.pieces)))
    own = [k for k, name in enumerate(found.free) if not name.startswith(f"{effect.id}.")]
    known = np.column_stack([found.slopes[:, own], comparison.nuisances.columns]) * weight[:, None]
    x, z, r = projected(np.column_stack([along, asked, weight * found.residual]), known).T
    share, error = _share(x, z, r, Blocks.of(prepared, BLOCK_SECONDS))
    return share >= POLICY.half and share > SURELY * error


def _share(x: Array, z: Array, r: Array, blocks: Blocks) -> tuple[float, float]:
    """How much of x the instrument z asks for where r is left of it, and its standard error over blocks."""
    common = float(z @ x)
    if common == 0.0:
        return 0.0, 0.0
    share = 1 + float(z @ r) / common
    left = r + (1 - share) * x
    return share, float(np.sqrt(sum(float(z[rows] @ left[rows]) ** 2 for rows in blocks.rows))) / abs(common)


def _added(found: Fit, effect: Effect, pieces: tuple[Piece, ...]) -> Array:
    """Torque [N m] that an effect adds to what a motion needs, at the kept rows."""
    rest = tuple(one for one in found.mount.effects if one is not effect)
    mounts = found.mount, replace(found.mount, effects=rest)
    whole, without = (stacked(Inverse(one, ()), pieces, np.zeros(0))[0] for one in mounts)
    return np.asarray(whole - without)
