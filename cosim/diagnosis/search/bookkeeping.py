"""The ledger's last columns: what each structure gains on held-out recordings, and the rules of the answer itself."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from cosim.diagnosis.answer.ledger import Gain, Rule, Trial, at_least, error_of_sum
from cosim.diagnosis.answer.result import Finding
from cosim.diagnosis.decide.calibration import LIKELY
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive, Weighed
from cosim.diagnosis.evidence.structure import structure_of
from cosim.estimation.fit import Fit

UNKNOWN = "unknown"
LEARNED = "a term learned from data predicts held-out recordings"


def finished(comparison: Comparison, held: Predictive, chosen: Fit) -> tuple[Trial, ...]:
    """All trials: what those that gain in training gain held out, and how far each is behind `chosen`."""
    assert comparison.refitted is not None
    base, best = held.weighed(structure_of(comparison.problem, comparison.refitted)), comparison.trial_of(chosen)
    known: dict[object, Gain] = {}
    trials = []
    for key, trial in comparison.ledger.items():
        structure = key[1:]
        if trial.train.nats > 0 and structure not in known:
            known[structure] = _gain(base, held.weighed(comparison.fitted[key]))
        trials.append(replace(trial, heldout=known.get(structure), behind=_behind(best, trial)))
    return tuple(trials)


def _behind(best: Trial, trial: Trial) -> Gain | None:
    if best.blocks is None or trial.blocks is None:
        return None
    return Gain(best.train.nats - trial.train.nats, error_of_sum(trial.blocks - best.blocks))


def _gain(base: Weighed, now: Weighed) -> Gain:
    return Gain(now.log_likelihood - base.log_likelihood, error_of_sum(base.by_block - now.by_block))


def enter_answer(
    comparison: Comparison,
    chosen: Fit,
    findings: Sequence[Finding],
    improves: bool,
    rest: Sequence[Rule],
    is_unknown: bool,
) -> None:
    """Enter how each effect of the delivered structure is answered, and whether something unknown is left.

    Of the rules of the rest one is enough; where none says so, a term was learned that predicts held-out recordings.
    """
    for one in findings:
        if one.where is not None:
            comparison.enter(one.name, chosen, one.gain)
            comparison.judge(one.name, chosen, list(_answer_rules(one, improves)))
    learned = Rule(LEARNED, True) if is_unknown and not any(rule.outcome for rule in rest) else None
    comparison.enter(UNKNOWN, chosen, 0.0)
    comparison.judge(UNKNOWN, chosen, [*rest, *([learned] if learned else [])])


def _answer_rules(one: Finding, improves: bool) -> Iterator[Rule]:
    yield Rule("the model with the names is no worse on held-out recordings", improves)
    yield at_least("probability", one.probability, LIKELY)
    yield Rule("no rival left in its set, its size differs from none", one.answer == "found")
