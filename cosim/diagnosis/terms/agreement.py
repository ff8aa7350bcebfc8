"""Whether a formula is as good as the table it would stand for, on recordings that neither has seen."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.terms.formula import Formula, Rows, complete, fading, shortest
from cosim.diagnosis.terms.partial import Partial, faded, partial, without
from cosim.estimation.blocks import Blocks
from cosim.estimation.fit import Fit
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Array
from cosim.support.statistics import rms
from pyfmi_models.effects.learned_base import LearnedEffect
from pyfmi_models.mount import Mount

KEPT = 0.8
"""Share of the table's held-out gain that a formula must keep."""
LARGEST = 3.0
"""RMS of what a formula says, at most, relative to what is left without it. A larger one lives by what it takes out of
the base: a loss of all of the drive's torque, and a machine that needs none, leave no error either."""


@dataclass(frozen=True, eq=False)
class Unseen:
    """Held-out rows of a term, and the weighted errors there: with the table, and without any term."""

    rows: Rows
    blocks: Blocks
    table: Array
    nothing: Array

    def losses(self, error: Array) -> Array:
        """Mean square of each block."""
        return np.array([float(np.mean(error[own] ** 2)) for own in self.blocks.rows])

    def residual(self, formula: Formula, moved: Array) -> Array:
        """Weighted error with a formula, the base moved as it was in training."""
        value = formula.value(self.rows.quantities)
        return np.asarray(self.rows.left - self.rows.unit * value - self.rows.slopes @ moved)

    def is_of_its_size(self, formula: Formula) -> bool:
        """Whether a formula says no more than what there is to be said."""
        said = self.rows.unit * formula.value(self.rows.quantities)
        return rms(said) <= LARGEST * rms(self.rows.left)

    def is_as_good(self, formula: Formula, moved: Array) -> bool:
        """Whether the loss is within a standard error of the table's, and most of what that gained is kept."""
        own, table, nothing = (self.losses(one) for one in (self.residual(formula, moved), self.table, self.nothing))
        error = float(np.std(table, ddof=1) / np.sqrt(len(table))) if len(table) > 1 else 0.0
        gained = nothing.mean() - own.mean() >= KEPT * (nothing.mean() - table.mean())
        return bool(own.mean() <= table.mean() + error and gained)


def proposed(part: Partial, train: Rows, unseen: Unseen) -> Formula | None:
    """The shortest formula that is as good as the table; None where none is."""
    return first_as_good(fading(train) if part.effect.since() else shortest(train), part, train, unseen)


def first_as_good(formulas: Sequence[Formula], part: Partial, train: Rows, unseen: Unseen) -> Formula | None:
    """The first of some formulas, fitted to all rows of training, that is as good as the table."""
    for formula in formulas:
        found = complete(formula, train, part)
        if found and unseen.is_of_its_size(found[0]) and unseen.is_as_good(*found):
            return found[0]
    return None


def formula_of(
    learned: Mount, effect: LearnedEffect, found: Fit, comparison: Comparison, held: Predictive
) -> Formula | None:
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
    return proposed(part, Rows.of(part, slopes), Unseen(Rows.of(there, own), there.blocks, *errors))
