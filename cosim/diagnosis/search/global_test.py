"""Is anything missing at all? The catalogue's best against what it would be worth in a null made from this recording.

    K = A'WA + P,   N = T^-2 + G'WG - G'WA K^-1 A'WG,   z = G'W r - G'WA K^-1 A'W r
    score = (z' N^-1 z - ln|N T^2|)/2 - ln(members),     statistic = max over all candidates G

r is what the refitted base leaves, in the decision's bands; A its tangents and the nuisances, with their priors P;
W = independent rows / (rows x noise) of each band. In the null every row has a random sign: as much is left, of the
same spectrum, but nothing in it goes with anything. So the misfit of the friction law, which is no noise, counts as
something that is missing: the test is reported and decides nothing.
"""

from collections.abc import Sequence
from math import log
from typing import Any

import numpy as np

from cosim.diagnosis.effects import candidates
from cosim.diagnosis.effects.candidates import Candidate, columns_of
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.marginal import marginal
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Array
from cosim.support.statistics import column_rms, rms

DRAWS = 199
"""Nulls; the smallest p that can be told is one in 200."""
AT_ONCE = 32
"""Nulls that are made together: all of a long recording take more memory than the recording."""
ALPHA = 0.05
"""Share of the nulls above the threshold that is told."""


def global_test(comparison: Comparison, base: Fit) -> dict[str, float]:
    """Score the whole catalogue beside the refitted base, and in nulls of the same residual with random signs.

    Returns:
        The largest score of the catalogue, what a null exceeds in 5 %, and how often a null exceeds the former.
    """
    prepared, level = comparison.problem.prepared, np.abs(comparison.nuisances.level)
    tried = candidates(base.mount, prepared, base.residual, level)
    columns = columns_of(base.mount, tried, prepared, base.values)
    scores = Scores(comparison, base, tried, columns)
    signs = np.random.default_rng(0).choice(np.array([-1, 1], np.int8), (scores.rows, DRAWS))
    statistic = float(scores.of(scores.residual[:, None])[0])
    parts = (signs[:, first : first + AT_ONCE] for first in range(0, DRAWS, AT_ONCE))
    null = np.concatenate([scores.of(some * scores.residual[:, None]) for some in parts])
    p = (1 + int(np.sum(null >= statistic))) / (1 + DRAWS)
    return {"statistic": statistic, "threshold": float(np.quantile(null, 1 - ALPHA)), "p": p}


class Scores:
    """Largest score of all candidates, of any residuals in the decision's bands."""

    def __init__(self, comparison: Comparison, base: Fit, tried: Sequence[Candidate], columns: Sequence[Array]) -> None:
        bands, own = comparison.bands, np.column_stack([base.slopes, comparison.nuisances.columns])
        transformed = bands.transform(np.column_stack([base.residual, own, *columns]))
        weight, prior = self._noise(comparison, base, transformed[:, : 1 + own.shape[1]])
        inside = bands.band >= 0
        transformed = transformed[inside]  # of long recordings no copy but this one has room
        transformed *= np.sqrt(weight[bands.band[inside]])[:, None]
        target, known, tests = np.split(transformed, [1, 1 + own.shape[1]], axis=1)
        self._normal = np.linalg.inv(known.T @ known + np.diag(1 / prior**2))
        self.residual = target[:, 0] - known @ (self._normal @ (known.T @ target[:, 0]))
        self.rows = len(self.residual)
        self._tests = tests - known @ (self._normal @ (known.T @ tests))
        self._gram = tests.T @ self._tests
        torque = rms(comparison.problem.prepared.stacked("tau"))
        self._groups = list(_groups(tried, columns, torque))

    @staticmethod
    def _noise(comparison: Comparison, base: Fit, transformed: Array) -> tuple[Array, Array]:
        """Weight of each band's rows, and standard deviations of what is known, as the evidence has them."""
        bands, many = comparison.bands, base.slopes.shape[1]
        groups = comparison.nuisances.groups_at(many)
        free = comparison.free(base, transformed.shape[1] - 1)
        now = marginal(bands.grams(transformed), free, groups, bands.count, bands.effective, comparison.floor)
        for group, size in zip(groups, now.sizes, strict=True):
            free[group.columns] = max(float(size), 1e-6 * group.prior)
        return bands.effective / bands.count / now.noise, free

    def of(self, residuals: Array) -> Array:
        """Largest score of each residual (rows, n)."""
        towards = self._tests.T @ residuals
        best = np.full(residuals.shape[1], -np.inf)
        for place, prior, price in self._groups:
            # In units of the prior; no energy is below nothing: of a column that is known, rounding is left.
            energy, axes = np.linalg.eigh(self._gram[np.ix_(place, place)] * np.outer(prior, prior))
            odds = 1 + np.maximum(energy, 0)
            z = axes.T @ (prior[:, None] * towards[place])
            score = 0.5 * (np.sum(z**2 / odds[:, None], axis=0) - np.sum(np.log(odds))) - price
            best = np.maximum(best, score)
        return best


def _groups(tried: Sequence[Candidate], columns: Sequence[Array], torque: float) -> Any:
    """Columns of each candidate by number, their priors as the search has them, and the price of its form."""
    forms = [type(one.instances[0]) for one in tried]
    first = 0
    for one, own, form in zip(tried, columns, forms, strict=True):
        size = column_rms(own)
        prior = np.ones(own.shape[1]) if one.finite else 0.5 * torque / np.maximum(size, 1e-100)
        yield np.arange(first, first + own.shape[1]), prior, log(forms.count(form))
        first += own.shape[1]
