"""A name that held-out recordings refuse gives way to a near one that training found in its place.

A constant torque, friction of two directions and a load are one thing on a short stroke: training has them within a nat
of each other and names the simplest; play is three nats ahead of a contact that bends. Where the first does not
predict, another may. It has evidence of its own in training, so nothing is named that only held-out recordings know.
"""

from collections.abc import Iterator
from dataclasses import replace

from cosim.diagnosis.decide.policy import Policy
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.search.instrumental_variable import misfits_of
from cosim.diagnosis.search.proof import Proof, prove
from cosim.diagnosis.search.renaming import is_renamed
from cosim.diagnosis.search.rivals import AcceptedEffect, Examined, margins
from cosim.diagnosis.search.stages import CandidateFit, contest


def prove_sets(comparison: Comparison, examined: Examined, held: Predictive) -> tuple[Examined, Proof]:
    """Keep the effects that predict; in the place of one that does not, the rival that predicts best.

    One effect gives way: what was fitted in another's place was fitted beside the names that training gave.
    """
    proof = prove(comparison, examined, held)
    ways = [way for refused in proof.unproven for way in _ways(comparison, examined, proof, refused, held)]
    return max(ways, key=lambda way: held.predicted(way[1].chosen), default=(examined, proof))


def _ways(
    comparison: Comparison, examined: Examined, proof: Proof, refused: AcceptedEffect, held: Predictive
) -> Iterator[tuple[Examined, Proof]]:
    """Proofs in which a rival stands in the place of what was refused, and all that stood still does."""
    stood = {one.effect.name for one in proof.standing}
    for rival in _near(examined, refused, comparison.policy):
        swapped = _in_place(comparison, examined, refused, rival)
        again = prove(comparison, swapped, held)
        if stood | {rival.effect.name} <= {one.effect.name for one in again.standing}:
            yield swapped, replace(again, unproven=(refused, *again.unproven))


def _near(examined: Examined, refused: AcceptedEffect, policy: Policy) -> list[CandidateFit]:
    """Rivals with evidence of their own that are not clearly behind, as names are weighed beside something unknown."""
    listed, behind = {one.effect.name for one in examined.effects}, margins(refused)
    others = [one for one in refused.rivals if one.effect.name not in listed and not is_renamed(one.effect)]
    return [one for one in others if behind[one.effect.name] < policy.clear <= one.evidence]


def _in_place(comparison: Comparison, examined: Examined, out: AcceptedEffect, rival: CandidateFit) -> Examined:
    """The same list with a rival in an effect's place; what was refused is no rival of it any more."""
    own, mount = len(comparison.problem.mount.effects), rival.fit.mount
    others = tuple(one for one in out.rivals if one is not rival)
    accepted = AcceptedEffect(
        tuple(effect for effect in mount.effects[own:] if effect.name == rival.effect.name),
        rival,
        out.without,
        others,
        {one.effect.name: out.margin(one) - out.margin(rival) for one in others},
        {one.effect.name: contest(comparison, rival, one) for one in others},
        misfits_of(comparison.problem.prepared, mount, rival.effect),
    )
    effects = tuple(accepted if one is out else one for one in examined.effects)
    return replace(examined, chosen=rival.fit, effects=effects)
