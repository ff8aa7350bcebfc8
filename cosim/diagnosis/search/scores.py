"""What the decision is made from, and what the ledger says of the answer: numbers of what stands, and of what is left.

What is left may follow smooth shapes of recorded quantities that are no effect of the catalogue.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import inf

import numpy as np

from cosim.diagnosis.answer.ledger import Gain, Rule, Trial, at_least, error_of_sum
from cosim.diagnosis.answer.result import Finding
from cosim.diagnosis.answer.scores import EffectScores, ResidualScores, Scores, TermScores
from cosim.diagnosis.decide.calibration import LIKELY
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.evidence.adequacy import friction_level, over_time, share_beside, share_left, share_there
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.evidence.shaking import Shaken, burst_share, shaken
from cosim.diagnosis.evidence.structure import structure_of
from cosim.diagnosis.search.nameless import Nameless
from cosim.diagnosis.search.rivals import explains, margins, waves
from cosim.diagnosis.terms.candidate_terms import LEVEL
from cosim.diagnosis.terms.dictionary import OF_LAW, dictionary
from cosim.estimation.fit import Fit
from cosim.estimation.least_squares import projected
from cosim.support.statistics import rms

UNKNOWN = "unknown"
LEARNED = "a term learned from data predicts held-out recordings"


def scores_of(comparison: Comparison, found: Nameless, held: Predictive, changes: bool) -> Scores:
    """Scores of what stands, and of what is left beside it by a machine that `changes` within a recording or not.

    What follows an effect's own table (`Hypothesis.tables`) and is less than the effect is the same in another form.
    """
    proof, chosen, effects = found.proof, found.proof.chosen, []
    shapes: dict[str, float] = {}
    for one in proof.standing:
        name, worth = one.effect.name, one.own.evidence
        nats, share, ahead = proof.predicted[name], proof.removes[name], found.ahead.get(name, 0.0)
        effects.append(EffectScores(name, worth, margins(one), explains(one), nats, share, ahead, waves(one)))
        for table in hypothesis_of(one.effect).tables:
            shapes[table] = max(worth, shapes.get(table, -inf))
    terms = [one for one in flexible_terms(comparison, chosen, held) if one.evidence > shapes.get(one.name, -inf)]
    there = held.residual(chosen.mount)
    rest = ResidualScores(
        share_left(comparison, chosen),
        share_there(comparison, chosen, there, held),
        terms,
        over_time(comparison, chosen),
        share_beside(comparison, chosen, there, held),
        found.quantities,
        burst_share(comparison, chosen),
        shaken_everywhere(comparison, chosen, held).least / friction_level(comparison),
        changes,
    )
    return Scores(effects, rest)


def shaken_everywhere(comparison: Comparison, chosen: Fit, held: Predictive) -> Shaken:
    """A random disturbance that training and held-out recordings show, as the one shows it that has less of it."""
    both = ((comparison.problem.prepared, chosen.residual), (held.prepared, held.residual(chosen.mount)))
    found = [shaken(*one, comparison.inertia, comparison.policy.bands_hz) for one in both]
    return min(found, key=lambda one: one.least)


def flexible_terms(comparison: Comparison, found: Fit, held: Predictive) -> list[TermScores]:
    """Score all terms of the dictionary that the held-out recordings have too beside a structure, best first."""
    there = set.intersection(*(set(piece.extras) for piece in held.prepared.pieces))
    here = set.intersection(*(set(piece.extras) for piece in comparison.problem.prepared.pieces)) - {"q_d", "v"}
    missing = {name for column in here - there for name in (column, f"position and {column}")}
    residual, weighted = held.residual(found.mount), held.slopes(found) * held.weight[:, None]
    counted, scored = comparison.problem.weight > 0, []
    level = max(rms(comparison.nuisances.level[counted]), 1e-300)
    for name, term in dictionary(comparison.problem.prepared).items():
        if name in missing or name in OF_LAW:
            continue
        columns = term.columns(comparison.problem.prepared)
        evidence, beta = comparison.group(found, columns)
        uneven = rms((columns @ beta)[counted]) / level if name == LEVEL else None
        after = residual - term.columns(held.prepared) @ beta
        # The base was bent to what is missing in training, so its own parameters are free beside what is predicted.
        left = projected(np.column_stack([residual, after]) * held.weight[:, None], weighted)
        before, now = (left**2).sum(0)
        scored.append(TermScores(name, evidence, 1 - float(now) / max(float(before), 1e-300), uneven))
    return sorted(scored, key=lambda one: -one.evidence)


def finished(comparison: Comparison, held: Predictive, chosen: Fit) -> tuple[Trial, ...]:
    """All trials: what those that gain in training gain held out, and how far each is behind `chosen`."""
    assert comparison.refitted is not None
    base, best = held.weighed(structure_of(comparison.problem, comparison.refitted)), comparison.trial_of(chosen)
    known: dict[object, Gain] = {}
    trials = []
    for key, trial in comparison.ledger.items():
        structure, behind = key[1:], None
        if trial.train.nats > 0 and structure not in known:
            now = held.weighed(comparison.fitted[key])
            error = error_of_sum(base.by_block - now.by_block)
            known[structure] = Gain(now.log_likelihood - base.log_likelihood, error)
        if best.blocks is not None and trial.blocks is not None:
            behind = Gain(best.train.nats - trial.train.nats, error_of_sum(trial.blocks - best.blocks))
        trials.append(replace(trial, heldout=known.get(structure), behind=behind))
    return tuple(trials)


def enter_answer(
    comparison: Comparison, chosen: Fit, found: Sequence[Finding], improves: bool, rest: Sequence[Rule], unknown: bool
) -> None:
    """Enter how each effect of the delivered structure is answered, and whether something unknown is left.

    Of the rules of the rest one is enough; where none says so, a term was learned that predicts held-out recordings.
    """
    for one in found:
        if one.where is not None:
            comparison.enter(one.name, chosen, one.gain)
            better = Rule("the model with the names is no worse on held-out recordings", improves)
            alone = Rule("no rival left in its set, its size differs from none", one.answer == "found")
            rules = [better, at_least("probability", one.probability, LIKELY), alone]
            comparison.judge(one.name, chosen, rules)
    learned = [Rule(LEARNED, True)] if unknown and not any(rule.outcome for rule in rest) else []
    comparison.enter(UNKNOWN, chosen, 0.0)
    comparison.judge(UNKNOWN, chosen, [*rest, *learned])
