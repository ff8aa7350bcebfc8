"""A structure with one effect more: what the effect is worth beside the structure without it, and beside a rival.

What the base gains by other numbers of its own is no merit of the effect beside which it took them. A fit sits where
the plain error is least, which evidence need not prefer: beside an effect a base may leave the card for numbers that
explain what is fast far better, with the effect or without it. Where it comes back to the card, it was the base that
had stood in for the effect.

Effects with the very same equation are one fit under two names, and no recording tells which it is. What was fitted
once is not fitted again: the other name has the same torque, the same evidence and the same number.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace
from math import inf, log

from cosim.diagnosis.decide.policy import Policy
from cosim.diagnosis.effects import HYPOTHESES, hypothesis_of, named
from cosim.diagnosis.evidence.comparison import Aside, Comparison, aside_for
from cosim.estimation.fit import Fit, with_values
from cosim.estimation.residuals import away_from_turns, gets_memory, removed_at_rest
from pyfmi_models.effects import Effect

FAR = 3.0
"""Factor from which a number of the base counts as another one: what owners write is rarely more than a factor of two
off. Beside a saturation that a measured screw seemed to have the inertia was 46 times larger."""


@dataclass(frozen=True)
class CandidateFit:
    """A structure with one effect more, refitted, and what the effect is worth."""

    effect: Effect
    fit: Fit
    evidence: float
    """Nats above the structure without the effect, search priced."""
    price: float
    """Nats that are not its own: what the search among the members of its form costs, and what is owed to other numbers
    of the base; taken off already."""
    plain_gain: float
    """Share of the plain residual energy removed."""
    price_of_forms: float = 0.0
    """The price in a contest of names, which counts few ways of being wrong."""
    above_noise: float = inf
    """Energy that a spring removes, in those of the reading's noise."""
    away: float = 1.0
    """Share of the energy that a timing effect removes which it removes away from turns."""
    at_rest: float = 1.0
    """Share of the energy at rest that a contact that bends removes."""
    many: int = 1
    """How many members of its form were tried."""
    is_rough: bool = False
    """Whether its fit ended where it is clear which of many is best (`Problem.roughly`)."""


def weighed(
    comparison: Comparison, found: Fit, current: Fit, many: int = 1, effect: Effect | None = None
) -> CandidateFit:
    """What an effect of a fitted structure (the last one) is worth beside the structure without it."""
    effect = effect or found.mount.effects[-1]
    aside = aside_for(effect.id)
    owed, owed_by_forms = owed_to_base(comparison, found, current, aside)
    price, price_of_forms = log(max(many, 1)) + owed, log(max(many, 1)) + owed_by_forms
    with_it, without = (comparison.evidence(one, aside, beside=current) for one in (found, current))
    gain = with_it - without - price
    own, problem = hypothesis_of(effect), comparison.problem
    loud = comparison.above_noise(found, current) if own.must_stand_out else inf
    left, before = (problem.weight * one.residual for one in (found, current))
    away = away_from_turns(problem, left, before) if own.is_timing else 1.0
    share = 1 - float(left @ left) / max(float(before @ before), 1e-300)
    remembers = gets_memory(found.mount, current.mount)
    rest = removed_at_rest(problem.weight, found.residual, current.residual) if remembers else 1.0
    return CandidateFit(effect, found, gain, price, share, price_of_forms, loud, away, rest, many)


def owed_to_base(comparison: Comparison, found: Fit, current: Fit, aside: Aside) -> tuple[float, float]:
    """Nats by which a structure gains by the numbers that were found beside an effect, without that effect.

    At least 0; 0 where no number of the base is further from the card than without the effect, by more than `FAR`. The
    second one counts the few ways in which an equation may be wrong, as a contest of names does.
    """
    known, moved = current.parameters(), found.parameters()
    card = {variable.name: variable.start for variable in comparison.problem.mount.parameters()}
    shared = [name for name in known if name in moved and name.startswith(("axis.", "friction."))]
    triples = [(card[name], known[name], moved[name]) for name in shared]
    if not any(min(one) > 0 and abs(log(one[2] / one[0])) - abs(log(one[1] / one[0])) > log(FAR) for one in triples):
        return 0.0, 0.0
    names = [name for name in known if name in moved]
    there = with_values(current.mount, names, found.values[[found.free.index(name) for name in names]])
    alone = comparison.problem.fit(there, 1)
    rows, forms = (
        comparison.evidence(alone, aside, few) - comparison.evidence(current, aside, few) for few in (False, True)
    )
    return max(0.0, rows), max(0.0, forms)


def margin(comparison: Comparison, one: CandidateFit, other: CandidateFit) -> float:
    """Nats by which one structure is better than another; nuisances that either effect is stand aside for both."""
    aside = aside_for(one.effect.id, other.effect.id)
    return comparison.evidence(one.fit, aside) - one.price - comparison.evidence(other.fit, aside) + other.price


def contest(comparison: Comparison, one: CandidateFit, other: CandidateFit) -> float:
    """Nats by which one name beats another, where neither equation is quite the machine's.

        D = L(one) - L(other),    margin = sign(D) min(|D|, max(sign(D) D_K, 0))

    D_K is D with K independent ways of each band in which an equation is wrong (`Policy.form_ways`): what an equation
    misses is the same in every stroke, so rows say again and again what they said in the first one.

    Reference: coarsened posterior, Miller and Dunson, J. Am. Stat. Assoc. 114 (2019) 1113.
    """
    aside = aside_for(one.effect.id, other.effect.id)
    rows, forms = (
        comparison.evidence(one.fit, aside, few) - comparison.evidence(other.fit, aside, few) - price
        for few, price in ((False, one.price - other.price), (True, one.price_of_forms - other.price_of_forms))
    )
    way = 1.0 if rows >= 0 else -1.0
    return way * min(abs(rows), max(way * forms, 0.0))


def is_small(one: CandidateFit, policy: Policy) -> bool:
    """Whether an effect explains little, and not surely."""
    return one.plain_gain < policy.small and one.evidence < policy.sure


def renamed(one: CandidateFit) -> list[CandidateFit]:
    """A candidate by each other name that its effect may have; none for nearly all effects."""
    others = (own.renamed(one.effect, one.fit.mount) for own in HYPOTHESES if own.same_as == one.effect.id)
    return [replace(one, effect=other, fit=_with(one.fit, one.effect, other)) for other in others if other]


def by_each_name(one: CandidateFit, known: Collection[str]) -> list[CandidateFit]:
    """A candidate, and the same by each other name that is not among those that are `known`."""
    return [one, *(other for other in renamed(one) if other.effect.name not in known)]


def is_renamed(effect: Effect) -> bool:
    """Whether an effect is never found for itself, only as another name of one that was."""
    return bool(named(effect.id).same_as)


def _with(fit: Fit, effect: Effect, other: Effect) -> Fit:
    """A fit with an effect under another name; torque and slopes are the same."""
    effects = tuple(other if one is effect else one for one in fit.mount.effects)
    mount = replace(fit.mount, effects=effects)
    names = {old.name: new.name for old, new in zip(fit.mount.parameters(), mount.parameters(), strict=True)}
    return replace(fit, mount=mount, free=tuple(names[name] for name in fit.free))
