"""Names that something without a name takes away: in an effect's place a term of another kind explains far more.

A torque constant that waves with the position looks like friction that does, drag that grows with acceleration like a
drive that saturates: to a list, what is not on it is the nearest thing that is. So each effect that stands is compared
with every term that may be learned, in its place and in the same nats,

    lead = worth(others + term) - ln(terms tried) - max(worth(others + effect), worth(others + its own table))

beside what a law of friction over speed may lack, and leaves where the lead is one by which a rival is excluded where
something has no name, and the held-out recordings do not contradict it. The machine may be off the effect's equation
by some per cent (`evidence/forms.py`): what that explains is no lead of a term. A term that is the effect in another
form (`Hypothesis.tables`) takes nothing away: where the effect's own table is as good, it is its shape that is wrong,
not its name. What then remains is asked again beside that term: names come in twos and threes where each imitates
a part.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf, log

from cosim.diagnosis.answer.ledger import Rule
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.search.proof import Proof, gained, without
from cosim.diagnosis.search.rivals import AcceptedEffect, Examined
from cosim.diagnosis.search.sizes import goes_its_way
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
    """An effect, the term that leads it by most, the lead [nats], and the structure without the effect."""

    effect: AcceptedEffect
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
    found = _without_misnamed(comparison, examined, Nameless(proof), held, offered)
    while found.proof.standing:
        known = [*offered.law, *found.terms]
        own = _worth(_grams(comparison, found.proof.chosen, known), range(len(known)))
        challenges = [_challenge(comparison, found, one, own, offered) for one in found.proof.standing]
        worst = max(challenges, key=lambda one: one.lead)
        leads = worst.lead >= least and _holds(comparison, found, worst, held)
        name, chosen = worst.effect.effect.name, found.proof.chosen
        rule = Rule(f"not explained better by {worst.term.name}", not leads, worst.lead, least, "nats")
        comparison.judge(name, chosen, [rule])
        if not leads:
            met = [one for one in challenges if one.lead > -inf and not hypothesis_of(one.effect.effect).is_fine]
            return replace(found, ahead={one.effect.effect.name: -one.lead for one in met})
        left = without(comparison, examined, found.proof, worst.effect, held)
        found = Nameless(left, (*found.taken, (worst.effect, worst.term)))
    return found


def _without_misnamed(
    comparison: Comparison, examined: Examined, found: Nameless, held: Predictive, offered: _Offered
) -> Nameless:
    """Take away names whose numbers do not surely go the way that the name says: something is there, and is not it."""
    for one in found.proof.standing:
        chosen = found.proof.chosen
        goes = goes_its_way(comparison.problem, chosen, one.within(chosen.mount))
        comparison.judge(one.effect.name, chosen, [Rule("its numbers surely have the sign of such an effect", goes)])
        if not goes and offered.free:
            grams = _grams(comparison, comparison.problem.without(found.proof.chosen, one.effect.name), offered.free)
            term = offered.free[max(range(len(offered.free)), key=lambda k: _worth(grams, [k]))]
            left = without(comparison, examined, found.proof, one, held)
            return _without_misnamed(comparison, examined, Nameless(left, (*found.taken, (one, term))), held, offered)
    return found


def _challenge(
    comparison: Comparison, found: Nameless, one: AcceptedEffect, own: float, offered: _Offered
) -> _Challenge:
    """What leads an effect by most, beside the terms that took a name already; `own`: the worth of all that stands."""
    beside = comparison.problem.without(found.proof.chosen, one.effect.name)
    tables = hypothesis_of(one.effect).tables
    law, free = offered.law, [term for term in offered.free if term.name not in found.quantities]
    alike = [term for term in free if term.name in tables]
    terms = [*found.terms, *(term for term in free if term.name not in tables)]
    if not terms:
        return _Challenge(one, offered.free[0], -inf, beside)
    grams, known = _grams(comparison, beside, [*law, *terms, *alike]), range(len(law) + len(found.terms))
    worth = [_worth(grams, {*known, k + len(law)}) for k in range(len(terms) + len(alike))]
    own += comparison.form_gain(found.proof.chosen, one.effect.name)
    kind = max([own, *(value - log(len(alike)) for value in worth[len(terms) :])])
    best = max(range(len(terms)), key=lambda k: worth[k])
    return _Challenge(one, terms[best], worth[best] - log(len(terms)) - kind, beside)


def _grams(comparison: Comparison, found: Fit, terms: Sequence[CandidateTerm]) -> Grams:
    columns = [columns_of(found.mount, one, comparison.problem.prepared) for one in terms]
    return grams_of(comparison, found, columns, terms)


def _worth(grams: Grams, chosen: Iterable[int]) -> float:
    """Log-likelihood of a structure with some terms."""
    return grams.marginal(sorted(chosen), list(range(grams.recordings))).log_likelihood


def _holds(comparison: Comparison, found: Nameless, one: _Challenge, held: Predictive) -> bool:
    """Whether the held-out recordings gain by the term, and do not prefer the name.

    They prefer it by as many nats as exclude a rival, or where the term in its place raises the plain error: what is
    slow has few independent rows, so that a ripple of the friction may lead in nats what leaves a fifth of the error.
    """
    policy, named = comparison.policy, found.proof.chosen
    with_name = allowed(comparison, named, found.terms)[0] if found.terms else named.mount
    terms = {term.name: term for term in (*found.terms, one.term)}
    whole, effects = allowed(comparison, one.beside, tuple(terms.values()))
    if not effects:
        return False
    gain = held.likelihood_of(whole) - held.likelihood_of(one.beside.mount)
    lead = gain - found.proof.predicted[one.effect.effect.name]
    raises = gained(lead, with_name, whole, held).raises(policy)
    return gain >= policy.fair and lead >= -policy.clear and not raises
