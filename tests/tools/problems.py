"""Small problems of a diagnosis: mounts that are fitted to recordings, what is compared, and whole answers."""

from collections.abc import Sequence

import numpy as np

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import Outcome, diagnose
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from pyfmi_models.card import parse_card
from pyfmi_models.effects import Effect
from pyfmi_models.mount import Mount


def problem_of(
    mount: Mount, *recordings: Recording, cutoff: float = 20.0, slow: float = 0.02, sample: float = 0.005
) -> Problem:
    """Recordings of a mount; rows that are not faster than `slow` have no weight."""
    prepared = prepare(recordings, cutoff)
    weight = (np.abs(prepared.stacked("v")) > slow).astype(float)
    return Problem(mount, prepared, weight, sample)


def compared(problem: Problem, evaluations: int = 25) -> tuple[Comparison, Fit]:
    """The refitted base, and what structures are compared with it."""
    base = problem.fit(problem.mount, evaluations)
    return Comparison.of(problem, base, POLICY), base


def diagnosed(runs: Sequence[Recording], card: str) -> Outcome:
    """The diagnosis of a card's text; the last recording is held out."""
    return diagnose(runs[:-1], runs[-1:], parse_card(card, "card.toml"))


def likeliest(comparison: Comparison, base: Fit, effect: str) -> Effect:
    """Where a fit of an effect starts: the candidate that has most evidence."""
    looked = (one for one in comparison.screen(base) if one.candidate.effect == effect)
    best = max(looked, key=lambda one: one.evidence)
    return best.candidate.start(best.coefficients)
