"""What is delivered: effects that are detected, and what each is worth where others were taken out."""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from cosim.diagnosis.decide.calibration import LIKELY
from cosim.diagnosis.decide.decision import Decision
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.effects.tuning import ended_sizes
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.search.admissibility import tells
from cosim.diagnosis.search.candidate_fit import weighed
from cosim.diagnosis.search.proof import Proof
from cosim.diagnosis.search.rivals import AcceptedEffect
from cosim.estimation.fit import Fit, recorded_by, with_values
from cosim.estimation.problem import LESS


def detected(comparison: Comparison, proof: Proof, decision: Decision) -> frozenset[str]:
    """Effects that no rival can be, that are more likely there than not, and whose size is told."""
    told = {one.effect.name: decision.probabilities[one.effect.name][one.effect.name] for one in proof.standing}
    likely = {name for name, p in told.items() if p >= LIKELY and not decision.sets[name]}
    sure = [one for one in proof.standing if one.effect.name in likely - {*decision.doubtful}]
    return frozenset(
        one.effect.name for one in sure if tells(comparison.problem, proof.chosen, one.within(proof.chosen.mount))
    )


def likelier(decision: Decision) -> frozenset[str]:
    """The first of each set of which one is more likely there than not: which it is changes little of what it does."""
    sums = {name: sum(decision.probabilities[name].values()) for name, rivals in decision.sets.items() if rivals}
    return frozenset(name for name, p in sums.items() if p >= LIKELY and name not in decision.doubtful)


def structure_with(comparison: Comparison, proof: Proof, names: Collection[str]) -> Fit:
    """The structure of some of the effects that stand, as a card may hold it."""
    return without_ended(comparison, with_only(comparison, proof, names))


def with_only(comparison: Comparison, proof: Proof, names: Collection[str]) -> Fit:
    """The structure that stands with just some of its effects, refitted where others go."""
    problem, chosen = comparison.problem, proof.chosen
    own = len(problem.mount.effects)
    kept = tuple(one for k, one in enumerate(chosen.mount.effects) if k < own or one.name in names)
    if len(kept) == len(chosen.mount.effects):
        return chosen
    return problem.fit(replace(chosen.mount, effects=kept), LESS)


def without_ended(comparison: Comparison, found: Fit) -> Fit:
    """The same where no size of an effect ends at a bound of the fit.

    Of several sizes (a level and a viscosity) one may be told and the other not: that one is none, and the rest is
    fitted again beside it, so that no card holds a number that only a bound has made.
    """
    problem, mount = comparison.problem, found.mount
    recorded = recorded_by(problem.prepared.pieces)
    ended: dict[str, float] = {}
    names = list(mount.components())[len(mount.components()) - len(mount.effects) :]  # after axis and friction
    for prefix, effect in list(zip(names, mount.effects, strict=True))[len(problem.mount.effects) :]:
        own = hypothesis_of(effect)
        ended |= {f"{prefix}.{name}": own.none(mount) for name in ended_sizes(effect, own.sizes, recorded)}
    if not ended:
        return found
    start = with_values(mount, list(ended), np.array([*ended.values()]))
    return replace(problem, held=(*problem.held, *ended)).fit(start, 45)


def standing(comparison: Comparison, proof: Proof) -> Sequence[AcceptedEffect]:
    """The effects that stand, each weighed beside just those that are delivered with it."""
    return [one if one.own.fit is proof.chosen else _weighed(comparison, proof, one) for one in proof.standing]


def _weighed(comparison: Comparison, proof: Proof, one: AcceptedEffect) -> AcceptedEffect:
    problem, chosen = comparison.problem, proof.chosen
    without = problem.without(chosen, one.effect.name)
    added = chosen.mount.effects[len(problem.mount.effects) :]
    (first, *_) = (effect for effect in added if effect.name == one.effect.name)
    return replace(one, own=weighed(comparison, chosen, without, effect=first), without=without)
