"""The entry point: the formula of a learned effect, from rows of training and of the held-out recordings."""

from dataclasses import replace
from math import log

import numpy as np

from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.terms.partial import Partial, needed, partial, without
from cosim.estimation.blocks import Blocks
from cosim.estimation.discrepancy_basis import since_reversal
from cosim.estimation.fit import Fit
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Array, Piece, Prepared
from cosim_formulas.effect_file import EffectFile
from cosim_formulas.formula import Rows, Unseen, proposed
from cosim_formulas.spelled import Spelled
from pyfmi_models.effects.learned import LearnedFriction
from pyfmi_models.effects.learned_base import LearnedEffect
from pyfmi_models.mount import Mount

DOUBLED = LearnedFriction(over="speed", seen=(-1.0, 1.0), level_change=(log(2.0),))
"""Twice the friction level, whatever the speed."""


def find(
    learned: Mount, effect: LearnedEffect, found: Fit, comparison: Comparison, held: Predictive
) -> EffectFile | None:
    """The formula of a learned effect of a mount; None where none is as good, or it goes round a loop."""
    problem = comparison.problem
    rows = faded if effect.since() else partial
    if effect.of_one() is None and not effect.since():
        return None
    part, there = (
        rows(learned, effect, prepared, weight)
        for prepared, weight in ((problem.prepared, problem.weight), (held.prepared, held.weight))
    )
    moving = found.free if effect.at_once else ()  # a line of the command is a scale of all numbers of the base at once
    inverse = Inverse(without(learned, effect), moving)  # with the table in it a level's slope would be the table
    slopes, own = (
        stacked(inverse, prepared.pieces, inverse.present)[1] for prepared in (problem.prepared, held.prepared)
    )
    errors = (held.weight * held.residual(mount) for mount in (learned, found.mount))
    formula = proposed(part, Rows.of(part, slopes), Unseen(Rows.of(there, own), there.blocks, *errors))
    return EffectFile(Spelled(effect, formula, learned.motion == "linear")) if formula else None


def faded(mount: Mount, effect: LearnedEffect, prepared: Prepared, weight: Array) -> Partial:
    """Rows of a term that fades after a reversal, over the time or the way since then: f changes the friction level."""
    bare = without(mount, effect)
    base, doubled = needed(bare, prepared), replace(bare, effects=(*bare.effects, DOUBLED))
    over = np.concatenate([since(effect.since(), piece)[piece.kept] for piece in prepared.pieces])
    left, unit = prepared.stacked("tau") - base, needed(doubled, prepared) - base
    return Partial(effect, over, None, left, unit, weight, Blocks.of(prepared))


def since(name: str, piece: Piece) -> Array:
    """The time or the way since the last reversal, or since the start, at all rows of a piece."""
    return np.abs(since_reversal(piece.t if name == "time since reversal" else piece.q, piece.v))
