"""What each effect is worth in the model that is delivered, where others were taken out of the one it was found in."""

from collections.abc import Sequence
from dataclasses import replace

from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.search.proof import Proof
from cosim.diagnosis.search.rivals import AcceptedEffect
from cosim.diagnosis.search.stages import weighed


def standing(comparison: Comparison, proof: Proof) -> Sequence[AcceptedEffect]:
    """The effects that stand, each weighed beside just those that are delivered with it."""
    return [one if one.own.fit is proof.chosen else _weighed(comparison, proof, one) for one in proof.standing]


def _weighed(comparison: Comparison, proof: Proof, one: AcceptedEffect) -> AcceptedEffect:
    problem, chosen = comparison.problem, proof.chosen
    many = len(problem.mount.effects)
    own, added = chosen.mount.effects[:many], chosen.mount.effects[many:]
    rest = tuple(effect for effect in added if effect.id != one.effect.id)
    without = problem.fit(replace(chosen.mount, effects=(*own, *rest)), 45)
    (first, *_) = (effect for effect in added if effect.id == one.effect.id)
    return replace(one, own=weighed(comparison, chosen, without, effect=first), without=without)
