"""Proof: what each effect is worth on recordings that nothing was fitted to, in the same nats as the evidence.

A name that held-out recordings refuse gives way to a near one that training found in its place. A constant torque,
friction of two directions and a load are one thing on a short stroke: training has them within a nat of each other and
names the simplest; play is three nats ahead of a contact that bends. Where the first does not predict, another may. It
has evidence of its own in training, so nothing is named that only held-out recordings know.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from cosim.diagnosis.answer.ledger import Rule, all_pass, at_least, until_refused
from cosim.diagnosis.decide.decision import Gain, held_out_rules
from cosim.diagnosis.decide.policy import Policy
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.search.admissibility import is_degenerate
from cosim.diagnosis.search.instrumental_variable import misfits_of
from cosim.diagnosis.search.renaming import is_renamed
from cosim.diagnosis.search.rivals import AcceptedEffect, Examined, margins
from cosim.diagnosis.search.sizes import tells
from cosim.diagnosis.search.stages import CandidateFit, contest, is_small
from cosim.estimation.fit import Fit
from cosim.estimation.problem import LESS, Problem
from pyfmi_models.mount import Mount


@dataclass(frozen=True)
class Proof:
    """The effects that stand, the structure with just them, what each predicts and removes, and those that do not."""

    chosen: Fit
    standing: tuple[AcceptedEffect, ...]
    predicted: dict[str, float]
    """Nats that the held-out recordings lose without an effect, by its id."""
    unproven: tuple[AcceptedEffect, ...]
    removes: dict[str, float]
    """Share of the held-out residual energy that each removes, by its id."""


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


def prove(comparison: Comparison, examined: Examined, held: Predictive) -> Proof:
    """Keep the effects that predict.

    First the length of the list: effects in order of their evidence, up to where the held-out recordings are predicted
    best; stopping at the first that does not help would lose a later one that does. Then effects are taken out until
    all that are left stand, and those of which no size is told, unless they surely predict.
    """
    order = sorted(examined.effects, key=lambda one: -one.own.evidence)
    chosen, some = _longest(comparison, examined, order, held)
    chosen, standing, gains = _with_size(comparison, examined, chosen, some, held)
    predicted = {one.effect.name: 0.0 for one in order} | {name: gain.nats for name, gain in gains.items()}
    removes = {name: gain.narrow for name, gain in gains.items()}
    return Proof(chosen, tuple(standing), predicted, tuple(one for one in order if one not in standing), removes)


def without(comparison: Comparison, examined: Examined, proof: Proof, out: AcceptedEffect, held: Predictive) -> Proof:
    """The proof of what is left where one of the effects that stand is taken out."""
    rest = [one for one in proof.standing if one is not out]
    chosen, standing, gains = _with_size(comparison, examined, _with(comparison.problem, examined, rest), rest, held)
    fallen = tuple(one for one in rest if one not in standing)
    predicted = proof.predicted | {name: gain.nats for name, gain in gains.items()}
    removes = {name: gain.narrow for name, gain in gains.items()}
    return Proof(chosen, tuple(standing), predicted, (*proof.unproven, *fallen), removes)


def _with_size(
    comparison: Comparison, examined: Examined, chosen: Fit, some: Sequence[AcceptedEffect], held: Predictive
) -> tuple[Fit, list[AcceptedEffect], dict[str, Gain]]:
    """The effects that stand, but for those of which recordings tell no size, unless they surely predict."""
    chosen, standing, gains = _standing(comparison, examined, chosen, some, held)
    told = [one for one in standing if _is_sure(comparison, chosen, one, gains[one.effect.name])]
    if len(told) == len(standing):
        return chosen, standing, gains
    fit, kept, known = _standing(comparison, examined, _with(comparison.problem, examined, told), told, held)
    return fit, kept, gains | known


def _standing(
    comparison: Comparison, examined: Examined, chosen: Fit, some: Sequence[AcceptedEffect], held: Predictive
) -> tuple[Fit, list[AcceptedEffect], dict[str, Gain]]:
    """Of some effects those that stand, their structure, and what each gains, or gained before it was taken out.

    One that does not stand may be spoilt by another: the one that falls lowest is taken out, or the one that helps
    least, whichever leaves the better prediction in the end; but a way with one that halves the held-out error goes
    before one that leaves it, and of two such ways one that halves what the other leaves. The likelihood counts fast
    rows by the hundred: one that explains a few of them may be ahead there, and leave the error as it was (11 of 910
    nats, and eleven times the error energy, of an arm's weight).
    """
    problem, policy = comparison.problem, comparison.policy
    gains = {one.effect.name: _gain(problem, chosen, one, some, held) for one in some}
    nats = {one.effect.name: gains[one.effect.name].nats for one in some}
    falling = [one for one in some if not _is_validated(comparison, examined, chosen, one, gains[one.effect.name])]
    if not falling:
        return chosen, list(some), gains
    out = {min(group, key=lambda one: nats[one.effect.name]).effect.name for group in (falling, some)}
    ways = []
    for name in sorted(out):
        rest = [one for one in some if one.effect.name != name]
        ways.append(_standing(comparison, examined, _with(problem, examined, rest), rest, held))

    def matters(way: tuple[Fit, list[AcceptedEffect], dict[str, Gain]]) -> bool:
        return any(way[2][one.effect.name].matters_alone(policy) for one in way[1])

    best = max(ways, key=lambda way: (matters(way), held.predicted(way[0])))
    others = [way for way in ways if way is not best and matters(way) == matters(best)]
    fit, kept, known = next((way for way in others if _halves(way[0], best[0], held, policy)), best)
    return fit, kept, gains | known


def _halves(one: Fit, other: Fit, held: Predictive, policy: Policy) -> bool:
    """Whether a structure leaves half of another's held-out error, and the likelihood does not clearly contradict."""
    return gained(held.predicted(one) - held.predicted(other), other.mount, one.mount, held).halves(policy)


def _is_validated(comparison: Comparison, examined: Examined, chosen: Fit, one: AcceptedEffect, gain: Gain) -> bool:
    """Whether an effect stands on the held-out recordings, and is still what its name says in the structure there."""
    rules = until_refused(_validation(comparison, examined, chosen, one, gain))
    comparison.enter(one.effect.name, chosen, one.own.plain_gain)
    comparison.judge(one.effect.name, chosen, rules)
    return all_pass(rules)


def _validation(
    comparison: Comparison, examined: Examined, chosen: Fit, one: AcceptedEffect, gain: Gain
) -> Iterator[Rule]:
    """Rules by which held-out recordings confirm an effect."""
    policy = comparison.policy
    within = not is_degenerate(comparison.problem, one.within(chosen.mount))
    yield Rule("no number at its bound, and no other effect in disguise", within)
    if len(examined.effects) == 1 and is_small(one.own, policy):
        share = min(gain.narrow, gain.wide)
        yield Rule("a small effect halves the held-out error", gain.matters_alone(policy), share, policy.half)
    yield from held_out_rules(gain, policy)


def _is_sure(comparison: Comparison, chosen: Fit, one: AcceptedEffect, gain: Gain) -> bool:
    """Whether an effect surely predicts, or the recordings tell a size of it in the structure that stands."""
    sure = at_least("evidence on held-out recordings", gain.nats, comparison.policy.strong, "nats")
    if sure.outcome:
        return True
    told = Rule("its size differs from none", tells(comparison.problem, chosen, one.within(chosen.mount)))
    comparison.judge(one.effect.name, chosen, [told])
    return told.outcome


def _longest(
    comparison: Comparison, examined: Examined, order: Sequence[AcceptedEffect], held: Predictive
) -> tuple[Fit, list[AcceptedEffect]]:
    fits = [_with(comparison.problem, examined, order[:count]) for count in range(len(order) + 1)]
    likelihoods = [held.predicted(one) for one in fits]
    best = max(range(len(fits)), key=lambda count: likelihoods[count])
    while best < len(order) and _between(fits, likelihoods, best, held).halves(comparison.policy):
        best += 1
    return fits[best], list(order[:best])


def _between(fits: Sequence[Fit], likelihoods: Sequence[float], count: int, held: Predictive) -> Gain:
    """What one effect more gains."""
    without, grown = fits[count], fits[count + 1]
    return gained(likelihoods[count + 1] - likelihoods[count], without.mount, grown.mount, held)


def _with(problem: Problem, examined: Examined, some: Sequence[AcceptedEffect]) -> Fit:
    """The structure with some of the effects, refitted from the one with all."""
    if len(some) == len(examined.effects):
        return examined.chosen
    if not some:
        return examined.base
    own = examined.chosen.mount.effects[: len(problem.mount.effects)]
    kept = tuple(effect for one in some for effect in one.effects)
    return problem.fit(replace(examined.chosen.mount, effects=(*own, *kept)), LESS)


def _gain(
    problem: Problem, chosen: Fit, one: AcceptedEffect, standing: Sequence[AcceptedEffect], held: Predictive
) -> Gain:
    """What the held-out recordings lose without an effect."""
    without = one.without
    if len(standing) != 1 or len(without.mount.effects) != len(problem.mount.effects):
        without = problem.without(chosen, one.effect.name)
    after, before = (held.predicted(fit) for fit in (chosen, without))
    return gained(after - before, without.mount, chosen.mount, held)


def gained(nats: float, without: Mount, mount: Mount, held: Predictive) -> Gain:
    """What the held-out recordings gain by a model in place of another, which is so many nats better there."""
    shares = held.plain_gains(without, mount)
    return Gain(nats, *shares, held.at_rest(without, mount), held.in_motion(without, mount))
