"""Would another friction law serve better as the base? A proposal beside the verdict, never an effect of it.

One bristle yields over one distance; a row of elements that slip one after the other yields over many. What that row
would explain is measured with elements of free shares, the stop operators of the discrepancy basis. Everywhere else
they are nuisances: there they keep a law's misfit from being taken for an effect, so here nothing else may stand beside
them.
Laws that differ in a number or two are fitted. A law without memory gets its memory from the effect `presliding`. A
friction that bends over speed in a way of its own has no law: what a free curve would explain is given with the
proposal.
"""

from dataclasses import fields, replace

import numpy as np

from cosim.diagnosis.answer.entries import LawProposal
from cosim.estimation.blocks import Blocks
from cosim.estimation.discrepancy_basis import discrepancy_basis, friction_curve
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Array
from cosim.estimation.problem import Problem
from pyfmi_models.friction import LAWS

FOLDS = 4
"""Every so many blocks are predicted from the others."""
LEAST = 0.1
"""Share of the residual energy that another law, or a curve, must remove; elements beside a true bristle removed up to
0.03 in 14 simulated axes, and more than 0.2 in 7 of 11 that rub with slip blocks too."""


def proposed_law(problem: Problem, chosen: Fit) -> LawProposal:
    """The law that would explain most in place of the base's own, and the share of the energy; the own if none does."""
    law = chosen.mount.friction
    base, gains = law.key, {law.key: 0.0}
    for form in (LAWS[key] for key in law.rivals):
        if form.in_rows:  # a row of elements of free shares
            gains[form.key] = _gain_of(problem, chosen, discrepancy_basis(problem.prepared)[0])
            continue
        common = {own.name for own in fields(law)} & {own.name for own in fields(form)}
        other = form(**{name: getattr(law, name) for name in common})
        fitted = problem.fit(replace(chosen.mount, friction=other), 36)
        left, all_of_it = (float(np.sum((problem.weight * one.residual) ** 2)) for one in (fitted, chosen))
        gains[form.key] = 1 - left / all_of_it
    best = max(gains, key=lambda key: gains[key])
    best = best if gains[best] > LEAST else base
    curve = 0.0 if base == "none" else _gain_of(problem, chosen, friction_curve(problem.prepared))
    gain, curve = (gains[best] if best != base else 0.0), (curve if curve > LEAST else 0.0)
    return {"base": base, "proposed": best, "gain": gain, "curve": curve}


def _gain_of(problem: Problem, chosen: Fit, shapes: Array) -> float:
    """Share that shapes remove, beside the structure's own tangents, from blocks they were not fitted to."""
    weight = problem.weight[:, None]
    own, target, blocks = chosen.slopes * weight, chosen.residual * problem.weight, Blocks.of(problem.prepared)
    return 1 - _crossed(target, np.column_stack([own, shapes * weight]), blocks) / _crossed(target, own, blocks)


def _crossed(target: Array, columns: Array, blocks: Blocks) -> float:
    """Energy that least squares leaves, every `FOLDS`-th block predicted from the others.

    Not whole recordings: each visits other distances, and which element slips at which is what is asked.
    """
    scaled, left = columns / (np.sqrt((columns**2).sum(0)) + 1e-300), 0.0
    for fold in range(FOLDS):
        rows = np.concatenate(blocks.rows[fold::FOLDS] or [np.zeros(0, int)])
        others = np.setdiff1d(np.arange(len(target)), rows)
        beta = np.linalg.lstsq(scaled[others], target[others], rcond=1e-8)[0]
        left += float(np.sum((target[rows] - scaled[rows] @ beta) ** 2))
    return left
