"""The further waves of a ripple: slots and rollers are no sines, so whole multiples are asked for at once."""

from dataclasses import replace

from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.effects.candidates import columns_of
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.estimation.fit import Fit
from pyfmi_models.effects import Effect

MULTIPLES = (2, 3, 4, 5)
"""Multiples of the cycles of a ripple that are asked for."""


def with_harmonics(comparison: Comparison, found: Fit, ripple: Effect) -> Fit:
    """A fitted structure with those multiples of its ripple that have evidence, fitted together."""
    own = hypothesis_of(ripple)
    tried = [one for k in MULTIPLES if (one := own.multiple(ripple, k)) is not None]
    if not tried:
        return found
    groups = columns_of(found.mount, tried, comparison.problem.prepared, found.values)
    scored = comparison.score(found, tried, groups)
    least = comparison.policy.least_wave
    more = tuple(one.candidate.start(one.coefficients) for one in scored if one.evidence > least)
    if not more:
        return found
    return comparison.problem.fit(replace(found.mount, effects=(*found.mount.effects, *more)), 30)
