"""Choose effects forward, one at a time, each with a full refit of everything (see `challenge` for the way back)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from cosim.diagnosis.adequacy import LARGE, share_left
from cosim.diagnosis.evidence import Blocks
from cosim.diagnosis.fit import Fit
from cosim.diagnosis.instruments import is_told, misfits_of, settled
from cosim.diagnosis.problem import Problem
from cosim.diagnosis.structure import Bench, Screening, nuisances, screen
from cosim.diagnosis.trial import LEAST_GAIN, Trial, is_real, tried, twins, winner
from pyfmi_models.effects import Effect

SCREEN_GAIN, SCREEN_SHARE = 0.004, 0.3
"""Least linear gain, alone and relative to the best effect's, that makes an effect worth a nonlinear fit."""
REFINED = 4
"""How many effects are refined by a nonlinear fit in each stage."""
MOST_KINDS, MOST_EFFECTS = 4, 7
"""Different effects, and effects counting each harmonic, that one diagnosis may add."""


@dataclass(frozen=True)
class Selection:
    """The refitted base, the chosen structure, the bench of the last stage, and the last trial of each other effect."""

    base: Fit
    chosen: Fit
    bench: Bench
    looked_at: dict[str, Trial]


def select(problem: Problem, say: Callable[[str], None] = lambda _: None) -> Selection:
    """Find which effects the recordings demand beside the base; `say` is told what is being tried."""
    base = problem.fit(problem.mount, 25)
    blocks, current = Blocks.of(problem.prepared), base
    looked_at: dict[str, Trial] = {}
    while True:
        nuisance = nuisances(current, problem.prepared)
        screening = screen(current, problem.prepared, blocks, nuisance, problem.weight)
        trials = _trials(problem, current, starts(screening), screening, say)
        best = _best(problem, trials)
        if best is None and share_left(current, problem.prepared, screening.bench) > LARGE:
            trials += _trials(problem, current, others(screening, current, trials), screening, say)
            best = _best(problem, trials)
        looked_at |= {trial.effect.id: trial for trial in trials}
        if best is None or _full(best, problem):
            return Selection(base, current, screening.bench, looked_at)
        current = best.fit


def _trials(
    problem: Problem, current: Fit, effects: Sequence[Effect], screening: Screening, say: Callable[[str], None]
) -> list[Trial]:
    trials = []
    for effect in effects:
        say(effect.title)
        trials.append(tried(problem, current, effect, screening.bench))
    return trials


def _best(problem: Problem, trials: Sequence[Trial]) -> Trial | None:
    """The trial to go on with, if any is real; between delay and lag the set point decides."""
    real = [trial for trial in trials if is_real(problem, trial)]
    misfits = {trial.effect.id: misfits_of(problem.prepared, trial.fit.mount, trial.effect) for trial in real}
    best = winner([trial for trial in real if is_told(misfits[trial.effect.id], trial)])
    return settled(misfits[best.effect.id], best, trials) if best else None


def starts(screening: Screening) -> list[Effect]:
    """Effects worth a nonlinear fit, strongest first, and their twins."""
    least = max(SCREEN_GAIN, SCREEN_SHARE * screening.best[0][1].gain) if screening.best else 0.0
    refined = list(dict.fromkeys(candidate.effect for candidate, _, _ in screening.best))[:REFINED]
    strong = [(c, k) for c, score, k in screening.best if c.effect in refined and score.gain >= least]
    worth = [candidate.start(k) for candidate, k in strong]
    known = {type(effect) for effect in worth}
    return worth + [twin for effect in worth for twin in twins(effect) if type(twin) not in known]


def others(screening: Screening, current: Fit, trials: Sequence[Trial]) -> list[Effect]:
    """Effects worth a second look before something is called unknown: those that explain most of what they are told.

    Beside another effect that is still missing, a tangent may foretell nothing of an effect that a full fit proves.
    """
    known = {type(trial.effect) for trial in trials}
    strong = [
        candidate.start(k)
        for candidate, score, k in screening.explaining(current)
        if score.gain > LEAST_GAIN and type(candidate.instances[0]) not in known
    ]
    return strong[:REFINED]


def _full(best: Trial, problem: Problem) -> bool:
    added = best.fit.mount.effects[len(problem.mount.effects) :]
    return len({effect.id for effect in added}) > MOST_KINDS or len(added) > MOST_EFFECTS
