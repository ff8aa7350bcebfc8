"""Names that something without a name takes away: in an effect's place a term of another kind explains far more.

A torque constant that waves with the position looks like friction that does, drag that grows with acceleration like a
drive that saturates: to a list, what is not on it is the nearest thing that is. So each effect that stands is compared
with every term that may be learned, in its place and in the same nats,

    lead = worth(others + term) - ln(terms tried) - max(worth(others + effect), worth(others + its own table))

beside what a law of friction over speed may lack, and leaves where the lead is one by which a rival is excluded where
something has no name, and the held-out recordings do not contradict it. The machine may be off the effect's equation
by some per cent (`evidence/forms.py`): what that explains is no lead of a term. A term that is the effect in another
form (`Hypothesis.tables`) takes nothing away: where the effect's own table is as good, it is its shape that is wrong,
not its name.

Names come in twos where each imitates a part: grease whose viscosity changes over a turn is friction that does, beside
a law that falls over speed. So a term that nearly leads one name is asked in the place of two as well; there the nats
by which held-out recordings prefer one term to two names are added. (For one name they are not: what else is missing
goes with a term of many shapes, and took a load's friction from two measured joints that bend as well.) What then
remains is asked again beside that term.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from math import inf, log

from cosim.diagnosis.answer.ledger import Rule
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.search.admissibility import goes_its_way
from cosim.diagnosis.search.proof import Proof, Validation, gained
from cosim.diagnosis.search.rivals import AcceptedEffect, Examined
from cosim.diagnosis.terms.candidate_terms import CandidateTerm, candidate_terms
from cosim.diagnosis.terms.dictionary import OF_LAW
from cosim.diagnosis.terms.grams import Grams, columns_of, grams_of
from cosim.diagnosis.terms.learn import allowed, is_recorded
from cosim.estimation.fit import Fit


@dataclass(frozen=True)
class Nameless:
    """What stands when names that something else explains better are gone: the proof, and who took which name."""

    proof: Proof
    taken: tuple[tuple[AcceptedEffect, CandidateTerm], ...] = ()
    ahead: Mapping[str, float] = field(default_factory=dict)
    """Nats by which each name that stands is better than the best term in its place, where a term can be its rival."""

    @property
    def quantities(self) -> tuple[str, ...]:
        """What the terms go over, each once."""
        return tuple(dict.fromkeys(term.name for _, term in self.taken))

    @property
    def terms(self) -> tuple[CandidateTerm, ...]:
        """The terms, each once."""
        return tuple({term.name: term for _, term in self.taken}.values())


@dataclass(frozen=True)
class _Challenge:
    """One effect or two, the term that leads them by most, the lead in training [nats], the structure without them."""

    effects: tuple[AcceptedEffect, ...]
    term: CandidateTerm
    lead: float
    beside: Fit


@dataclass(frozen=True)
class _Offered:
    """Terms that may take a name, and those a friction law may lack, which stand beside name and term alike."""

    free: list[CandidateTerm]
    law: list[CandidateTerm]

    @classmethod
    def by(cls, comparison: Comparison, held: Predictive) -> "_Offered":
        """What training and held-out recordings offer."""
        every = candidate_terms(comparison.problem.mount, comparison.problem.prepared)
        free = [one for one in every if one.name not in OF_LAW and is_recorded(one, held)]
        return cls(free, [one for one in every if one.name in OF_LAW])


def nameless(comparison: Comparison, examined: Examined, proof: Proof, held: Predictive) -> Nameless:
    """Take away the names that something without a name explains far better, the worst first."""
    offered, least = _Offered.by(comparison, held), comparison.policy.clear
    validation = Validation(comparison, examined, held)
    found = _without_misnamed(validation, Nameless(proof), offered)
    while found.proof.standing:
        known = [*offered.law, *found.terms]
        own = _worth(_grams(comparison, found.proof.chosen, known), range(len(known)))
        alone = [_challenge(comparison, found, (one,), own, offered) for one in found.proof.standing]
        asked = list(alone)
        for first, second in combinations(alone, 2):  # terms that nearly lead one of two names, in the place of both
            near = {each.term.name: each.term for each in (first, second) if each.lead >= -comparison.policy.strong}
            both = (*first.effects, *second.effects)
            asked += [_challenge(comparison, found, both, own, offered, term) for term in near.values()]
        tried = [(*_held(comparison, found, one, held), one) for one in asked]
        holds, lead, worst = max(tried, key=lambda one: one[:2])
        leads = holds and lead >= least
        for one in worst.effects:
            others = "".join(f" with {other.effect.name}" for other in worst.effects if other is not one)
            rule = Rule(f"not explained better{others} by {worst.term.name}", not leads, lead, least, "nats")
            comparison.judge(one.effect.name, found.proof.chosen, [rule])
        if not leads:
            met = [(one.effects[0].effect, one.lead) for one in alone if one.lead > -inf]
            return replace(found, ahead={one.name: -lead for one, lead in met if not hypothesis_of(one).is_fine})
        left, gone = found.proof, {one.effect.name for one in worst.effects}
        while out := [one for one in left.standing if one.effect.name in gone]:
            left = validation.without(left, out[0])
        found = Nameless(left, (*found.taken, *((one, worst.term) for one in worst.effects)))
    return found


def _without_misnamed(validation: Validation, found: Nameless, offered: _Offered) -> Nameless:
    """Take away names whose numbers do not surely go the way that the name says: something is there, and is not it."""
    comparison, chosen = validation.comparison, found.proof.chosen
    for one in found.proof.standing:
        goes = goes_its_way(comparison.problem, chosen, one.within(chosen.mount))
        comparison.judge(one.effect.name, chosen, [Rule("its numbers surely have the sign of such an effect", goes)])
        if not goes and offered.free:
            grams = _grams(comparison, comparison.problem.without(chosen, one.effect.name), offered.free)
            term = offered.free[max(range(len(offered.free)), key=lambda k: _worth(grams, [k]))]
            left = Nameless(validation.without(found.proof, one), (*found.taken, (one, term)))
            return _without_misnamed(validation, left, offered)
    return found


def _challenge(
    comparison: Comparison,
    found: Nameless,
    some: tuple[AcceptedEffect, ...],
    own: float,
    offered: _Offered,
    only: CandidateTerm | None = None,
) -> _Challenge:
    """What leads some effects by most, beside the terms that took a name already; `own`: the worth of all that stands.

    `only`: the one term that is asked, of all that were.
    """
    beside, chosen = found.proof.chosen, found.proof.chosen
    for one in some:
        beside = comparison.problem.without(beside, one.effect.name)
    tables = {table for one in some for table in hypothesis_of(one.effect).tables}
    law, free = offered.law, [term for term in offered.free if term.name not in found.quantities]
    alike = [term for term in free if term.name in tables]
    further = [term for term in free if term.name not in tables]
    terms = [*found.terms, *(term for term in further if only is None or term is only)]
    if not terms:
        return _Challenge(some, offered.free[0], -inf, beside)
    grams, known = _grams(comparison, beside, [*law, *terms, *alike]), range(len(law) + len(found.terms))
    worth = [_worth(grams, {*known, k + len(law)}) for k in range(len(terms) + len(alike))]
    own += max(comparison.form_gain(chosen, one.effect.name) for one in some)
    kind = max([own, *(value - log(len(alike)) for value in worth[len(terms) :])])
    best = max(range(len(terms)), key=lambda k: worth[k])
    return _Challenge(some, terms[best], worth[best] - log(len(found.terms) + len(further)) - kind, beside)


def _grams(comparison: Comparison, found: Fit, terms: Sequence[CandidateTerm]) -> Grams:
    columns = [columns_of(found.mount, one, comparison.problem.prepared) for one in terms]
    return grams_of(comparison, found, columns, terms)


def _worth(grams: Grams, chosen: Iterable[int]) -> float:
    return grams.marginal(sorted(chosen), list(range(grams.recordings))).log_likelihood


def _held(comparison: Comparison, found: Nameless, one: _Challenge, held: Predictive) -> tuple[bool, float]:
    """Whether held-out recordings gain by the term and do not prefer the names, and its lead, over two there as well.

    They prefer them by as many nats as exclude a rival, or where the term in their place raises the plain error: what
    is slow has few independent rows, so that a ripple of the friction may lead in nats what leaves a fifth of the
    error. Training may prefer each of two names by as much.
    """
    policy, named, are_two = comparison.policy, found.proof.chosen, len(one.effects) > 1
    if one.lead < (-2 * policy.clear if are_two else policy.clear):
        return False, one.lead
    with_name = allowed(comparison, named, found.terms)[0] if found.terms else named.mount
    terms = {term.name: term for term in (*found.terms, one.term)}
    whole, effects = allowed(comparison, one.beside, tuple(terms.values()))
    if not effects:
        return False, one.lead
    likelihood = held.likelihood_of(whole)
    lead = likelihood - held.likelihood_of(with_name)
    gains = likelihood - held.likelihood_of(one.beside.mount) >= policy.fair
    holds = gains and lead >= -policy.clear and not gained(held, lead, with_name, whole).raises(policy)
    return holds, one.lead + (max(lead, 0.0) * are_two if holds else min(lead, 0.0))
