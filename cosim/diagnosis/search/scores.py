"""What the decision is made from: numbers of what stands, and of what is left."""

from dataclasses import replace
from math import inf

from cosim.diagnosis.answer.scores import EffectScores, ResidualScores, Scores
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.evidence.adequacy import friction_level, over_time, share_beside, share_left, share_there
from cosim.diagnosis.evidence.broadband import Shaken, shaken
from cosim.diagnosis.evidence.bursts import burst_share
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.search.nameless import Nameless
from cosim.diagnosis.search.proof import Proof
from cosim.diagnosis.search.rivals import explains, margins, waves
from cosim.diagnosis.terms.flexible import flexible_terms
from cosim.estimation.fit import Fit


def effect_scores(found: Nameless) -> list[EffectScores]:
    """Scores of the effects that stand."""
    proof = found.proof
    return [
        EffectScores(
            one.effect.name,
            one.own.evidence,
            margins(one),
            explains(one),
            proof.predicted[one.effect.name],
            proof.removes[one.effect.name],
            found.ahead.get(one.effect.name, 0.0),
            waves(one),
        )
        for one in proof.standing
    ]


def scores_of(comparison: Comparison, found: Nameless, held: Predictive, changes: bool) -> Scores:
    """Scores of what stands, and of what is left beside it by a machine that `changes` within a recording or not."""
    return Scores(effect_scores(found), replace(residual_scores(comparison, found, held), changes=changes))


def residual_scores(comparison: Comparison, found: Nameless, held: Predictive) -> ResidualScores:
    """What is left beside what stands, and what took names away.

    What follows an effect's own table (`Hypothesis.tables`) and is less than the effect is the same in another form.
    """
    chosen, shapes = found.proof.chosen, _own_shapes(found.proof)
    left, there = share_left(comparison, chosen), held.residual(chosen.mount)
    terms, shown = flexible_terms(comparison, chosen, held), over_time(comparison, chosen)
    terms = [one for one in terms if one.evidence > shapes.get(one.name, -inf)]
    beside = share_beside(comparison, chosen, there, held)
    there_left, bursts = share_there(comparison, chosen, there, held), burst_share(comparison, chosen)
    level = shaken_everywhere(comparison, chosen, held).least / friction_level(comparison)
    return ResidualScores(left, there_left, terms, shown, beside, found.quantities, bursts, level)


def shaken_everywhere(comparison: Comparison, chosen: Fit, held: Predictive) -> Shaken:
    """A random disturbance that training and held-out recordings show, as the one shows it that has less of it."""
    both = ((comparison.problem.prepared, chosen.residual), (held.prepared, held.residual(chosen.mount)))
    found = [shaken(*one, comparison.inertia, comparison.policy.bands_hz) for one in both]
    return min(found, key=lambda one: one.least)


def _own_shapes(proof: Proof) -> dict[str, float]:
    """Terms that are effects that stand in another form, and the evidence of those effects [nats]."""
    shapes: dict[str, float] = {}
    for one in proof.standing:
        for name in hypothesis_of(one.effect).tables:
            shapes[name] = max(one.own.evidence, shapes.get(name, -inf))
    return shapes
