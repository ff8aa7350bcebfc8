"""Proof: what each effect is worth on recordings that nothing was fitted to, in the same nats as the evidence.

A name that held-out recordings refuse gives way to a near one that training found in its place. A constant torque,
friction of two directions and a load are one thing on a short stroke: training has them within a nat of each other and
names the simplest; play is three nats ahead of a contact that bends. Where the first does not predict, another may. It
has evidence of its own in training, so nothing is named that only held-out recordings know.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from cosim.diagnosis.answer.ledger import Rule, all_pass, until_refused
from cosim.diagnosis.decide.decision import Gain, held_out_rules
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.search.admissibility import is_degenerate, tells
from cosim.diagnosis.search.candidate_fit import CandidateFit, contest, is_renamed, is_small
from cosim.diagnosis.search.instrumental_variable import misfits_of
from cosim.diagnosis.search.rivals import AcceptedEffect, Examined, margins
from cosim.estimation.fit import Fit
from cosim.estimation.problem import LESS
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
    proof = Validation(comparison, examined, held).proof()
    ways = [way for refused in proof.unproven for way in _ways(comparison, examined, proof, refused, held)]
    return max(ways, key=lambda way: held.predicted(way[1].chosen), default=(examined, proof))


def _ways(
    comparison: Comparison, examined: Examined, proof: Proof, refused: AcceptedEffect, held: Predictive
) -> Iterator[tuple[Examined, Proof]]:
    """Proofs in which a rival stands in the place of what was refused, and all that stood still does.

    Rivals with evidence of their own that are not clearly behind, as names are weighed beside something unknown.
    """
    stood, clear = {one.effect.name for one in proof.standing}, comparison.policy.clear
    listed, behind = {one.effect.name for one in examined.effects}, margins(refused)
    for rival in refused.rivals:
        name = rival.effect.name
        if name in listed or is_renamed(rival.effect) or not behind[name] < clear <= rival.evidence:
            continue
        swapped = _in_place(comparison, examined, refused, rival)
        again = Validation(comparison, swapped, held).proof()
        if stood | {name} <= {one.effect.name for one in again.standing}:
            yield swapped, replace(again, unproven=(refused, *again.unproven))


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


Way = tuple[Fit, list[AcceptedEffect], dict[str, Gain]]
"""A structure, those of its effects that stand, and what each gains, or gained before it was taken out."""


@dataclass(frozen=True)
class Validation:
    """The effects that training found, and the held-out recordings by which they are tried."""

    comparison: Comparison
    examined: Examined
    held: Predictive

    def proof(self) -> Proof:
        """Keep the effects that predict.

        First the length of the list: effects in order of their evidence, up to where the held-out recordings are
        predicted best; stopping at the first that does not help would lose a later one that does. Then effects are
        taken out until all that are left stand, and those whose size is not determined, unless they surely predict.
        """
        order = sorted(self.examined.effects, key=lambda one: -one.own.evidence)
        chosen, standing, gains = self._with_size(*self._longest(order))
        predicted = {one.effect.name: 0.0 for one in order} | {name: gain.nats for name, gain in gains.items()}
        removes = {name: gain.narrow for name, gain in gains.items()}
        return Proof(chosen, tuple(standing), predicted, tuple(one for one in order if one not in standing), removes)

    def without(self, proof: Proof, out: AcceptedEffect) -> Proof:
        """The proof of what is left where one of the effects that stand is taken out."""
        rest = [one for one in proof.standing if one is not out]
        chosen, standing, gains = self._with_size(self._with(rest), rest)
        fallen = tuple(one for one in rest if one not in standing)
        predicted = proof.predicted | {name: gain.nats for name, gain in gains.items()}
        removes = {name: gain.narrow for name, gain in gains.items()}
        return Proof(chosen, tuple(standing), predicted, (*proof.unproven, *fallen), removes)

    def rules(self, chosen: Fit, one: AcceptedEffect, gain: Gain) -> Iterator[Rule]:
        """Rules by which held-out recordings confirm an effect, which is still what its name says there."""
        policy = self.comparison.policy
        within = not is_degenerate(self.comparison.problem, one.within(chosen.mount))
        yield Rule("no number at its bound, and no other effect in disguise", within)
        if len(self.examined.effects) == 1 and is_small(one.own, policy):
            share = min(gain.narrow, gain.wide)
            yield Rule("a small effect halves the held-out error", gain.matters_alone(policy), share, policy.half)
        yield from held_out_rules(gain, policy)

    def _with_size(self, chosen: Fit, some: Sequence[AcceptedEffect]) -> Way:
        """The effects that stand, but for those of which recordings tell no size, unless they surely predict."""
        chosen, standing, gains = self._standing(chosen, some)
        sized = [one for one in standing if self._is_sure(chosen, one, gains[one.effect.name])]
        if len(sized) == len(standing):
            return chosen, standing, gains
        fit, kept, known = self._standing(self._with(sized), sized)
        return fit, kept, gains | known

    def _standing(self, chosen: Fit, some: Sequence[AcceptedEffect]) -> Way:
        """Of some effects those that stand.

        One that does not stand may be spoilt by another: the one that falls lowest is taken out, or the one that helps
        least, whichever leaves the better prediction in the end; but a way with one that halves the held-out error goes
        before one that leaves it, and of two such ways one that halves what the other leaves. The likelihood counts
        fast rows by the hundred: one that explains a few of them may be ahead there, and leave the error as it was (11
        of 910 nats, and eleven times the error energy, of an arm's weight).
        """
        gains = {one.effect.name: self._gain(chosen, one, some) for one in some}
        falling = [one for one in some if not self._is_validated(chosen, one, gains[one.effect.name])]
        if not falling:
            return chosen, list(some), gains
        out = {min(group, key=lambda one: gains[one.effect.name].nats).effect.name for group in (falling, some)}
        rests = [[one for one in some if one.effect.name != name] for name in sorted(out)]
        ways = [self._standing(self._with(rest), rest) for rest in rests]

        def matters(way: Way) -> bool:
            return any(way[2][one.effect.name].matters_alone(self.comparison.policy) for one in way[1])

        best = max(ways, key=lambda way: (matters(way), self.held.predicted(way[0])))
        others = [way for way in ways if way is not best and matters(way) == matters(best)]
        fit, kept, known = next((way for way in others if self._halves(best[0], way[0])), best)
        return fit, kept, gains | known

    def _halves(self, without: Fit, fit: Fit) -> bool:
        """Whether a structure leaves half of another's held-out error, and no likelihood clearly contradicts."""
        return self._gained(without, fit).halves(self.comparison.policy)

    def _gained(self, without: Fit, fit: Fit) -> Gain:
        nats = self.held.predicted(fit) - self.held.predicted(without)
        return gained(self.held, nats, without.mount, fit.mount)

    def _is_validated(self, chosen: Fit, one: AcceptedEffect, gain: Gain) -> bool:
        rules = until_refused(self.rules(chosen, one, gain))
        self.comparison.enter(one.effect.name, chosen, one.own.plain_gain)
        self.comparison.judge(one.effect.name, chosen, rules)
        return all_pass(rules)

    def _is_sure(self, chosen: Fit, one: AcceptedEffect, gain: Gain) -> bool:
        """Whether an effect surely predicts, or the recordings tell a size of it in the structure that stands."""
        if gain.nats >= self.comparison.policy.strong:
            return True
        is_told = tells(self.comparison.problem, chosen, one.within(chosen.mount))
        self.comparison.judge(one.effect.name, chosen, [Rule("its size differs from none", is_told)])
        return is_told

    def _longest(self, order: Sequence[AcceptedEffect]) -> tuple[Fit, list[AcceptedEffect]]:
        fits = [self._with(order[:count]) for count in range(len(order) + 1)]
        best = max(range(len(fits)), key=lambda count: self.held.predicted(fits[count]))
        while best < len(order) and self._halves(fits[best], fits[best + 1]):
            best += 1
        return fits[best], list(order[:best])

    def _with(self, some: Sequence[AcceptedEffect]) -> Fit:
        """The structure with some of the effects, refitted from the one with all."""
        problem, examined = self.comparison.problem, self.examined
        if len(some) == len(examined.effects):
            return examined.chosen
        if not some:
            return examined.base
        own = examined.chosen.mount.effects[: len(problem.mount.effects)]
        kept = tuple(effect for one in some for effect in one.effects)
        return problem.fit(replace(examined.chosen.mount, effects=(*own, *kept)), LESS)

    def _gain(self, chosen: Fit, one: AcceptedEffect, standing: Sequence[AcceptedEffect]) -> Gain:
        problem, without = self.comparison.problem, one.without
        if len(standing) != 1 or len(without.mount.effects) != len(problem.mount.effects):
            without = problem.without(chosen, one.effect.name)
        return self._gained(without, chosen)


def gained(held: Predictive, nats: float, without: Mount, mount: Mount) -> Gain:
    """What the held-out recordings gain by a model in place of another, which is so many nats better there."""
    return Gain(nats, *held.plain_gains(without, mount), held.at_rest(without, mount), held.in_motion(without, mount))
