"""What the decision is made from: numbers of what stands, and of what is left."""

from cosim.diagnosis.adequacy import over_time, share_beside, share_left, share_there
from cosim.diagnosis.comparison import Comparison
from cosim.diagnosis.decision import EffectScores, ResidualScores
from cosim.diagnosis.flexible import flexible_terms
from cosim.diagnosis.nameless import Nameless
from cosim.diagnosis.predictive import Predictive
from cosim.diagnosis.proof import Proof
from cosim.diagnosis.rivals import explains, margins


def effect_scores(proof: Proof) -> list[EffectScores]:
    """Scores of the effects that stand."""
    said = {one.effect.id: (proof.predicted[one.effect.id], proof.removes[one.effect.id]) for one in proof.standing}
    return [
        EffectScores(one.effect.id, one.own.evidence, margins(one), explains(one), *said[one.effect.id])
        for one in proof.standing
    ]


def residual_scores(comparison: Comparison, found: Nameless, held: Predictive) -> ResidualScores:
    """What is left beside what stands, and what took names away."""
    chosen = found.proof.chosen
    left, there = share_left(comparison, chosen), held.residual(chosen.mount)
    terms, shown = flexible_terms(comparison, chosen, held), over_time(comparison, chosen)
    beside = share_beside(comparison, chosen, there, held)
    return ResidualScores(left, share_there(comparison, chosen, there, held), terms, shown, beside, found.quantities)
