"""Did the loop bias the fit? In closed loop the controller answers noise, so the motion knows the torque's noise.

Test of Durbin, Wu and Hausman by the augmented regression: instruments are the model's derivatives along the *set
point*, which knows no noise. What they leave of the derivatives along the measured motion (V) joins the regression

    residual = S b + V c + noise

Without bias c = 0. Standard errors count blocks of seconds as one observation each. b is then the estimate by
instruments, so b tells how far a parameter would move. A friction law that is not the contact's own fails the test as
well: on simulated cases sigma0 moved in none of 5 with a bristle, by 10 to 36 % in those with slip blocks.
Reference: Wooldridge, Introductory Econometrics, section 15.5.
"""

import numpy as np
from scipy.special import fdtrc

from cosim.diagnosis.answer.entries import BiasEntry
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.search.instrumental_variable import BLOCK_SECONDS, on_set_point
from cosim.estimation.blocks import Blocks, sandwich
from cosim.estimation.fit import Fit
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Array, Prepared
from cosim.support.statistics import SURELY

SIGNIFICANT = 0.01
RCOND = 1e-8
"""Directions weaker than this share of the strongest are not estimated."""


def loop_bias(prepared: Prepared, found: Fit, weight: Array) -> BiasEntry:
    """Test a fit for bias by the loop; nothing where no set point was recorded or it tells of no parameter."""
    if not prepared.has_position or any("q_d" not in piece.extras for piece in prepared.pieces):
        return {}
    asked = [on_set_point(piece) for piece in prepared.pieces]
    _, along = stacked(Inverse(found.mount, found.free), asked, found.values)
    slopes, residual = found.slopes * weight[:, None], found.residual * weight
    instruments = along * weight[:, None]
    scale = np.sqrt((instruments**2).sum(0))
    unit = instruments[:, scale > 0] / scale[scale > 0]
    explained = unit @ np.linalg.lstsq(unit, slopes, rcond=RCOND)[0]
    energy = (slopes**2).sum(0)
    told = (explained**2).sum(0) > POLICY.half * np.maximum(energy, 1e-300)
    names = [name for name, ok in zip(found.free, told, strict=True) if ok]
    blocks = Blocks.of(prepared, BLOCK_SECONDS)
    if not names or len(blocks.rows) < 2 * len(names):
        return {}
    return _tested(slopes[:, told], (slopes - explained)[:, told], residual, blocks, names, found.values[told])


def _tested(slopes: Array, rest: Array, residual: Array, blocks: Blocks, names: list[str], values: Array) -> BiasEntry:
    columns = np.column_stack([slopes, rest])
    scale = np.sqrt((columns**2).sum(0)) + 1e-300
    scaled = columns / scale
    beta = np.linalg.pinv(scaled.T @ scaled, rcond=RCOND) @ (scaled.T @ residual)
    covariance = sandwich(scaled, residual - scaled @ beta, blocks, RCOND)
    count, many = len(blocks.rows), len(names)
    extra, own = beta[many:], covariance[many:, many:]
    wald = float(extra @ np.linalg.pinv(own, rcond=RCOND) @ extra) / many
    errors = np.sqrt(np.maximum(np.diag(covariance)[:many], 1e-300))
    moves = beta[:many] / scale[:many] / np.where(values == 0, 1.0, np.abs(values))
    far = (np.abs(moves) > POLICY.slight) & (np.abs(beta[:many]) > SURELY * errors)
    moved = {name: float(move) for name, move, is_far in zip(names, moves, far, strict=True) if is_far}
    p = float(fdtrc(many, count - 1, wald))
    return {"biased": p < SIGNIFICANT and bool(moved), "p_value": p, "moved": moved}
