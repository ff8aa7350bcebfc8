"""Each effect that was found, taken out and challenged: is it needed, and who else could stand in its place?"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from cosim.diagnosis.answer.ledger import Rule, all_pass, at_least, until_refused
from cosim.diagnosis.decide.policy import Policy
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.effects.base import Cyclic
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.search.candidate_fit import CandidateFit, contest, is_small, margin, renamed, weighed
from cosim.diagnosis.search.instrumental_variable import Misfits, excludes, misfits_of, settled
from cosim.diagnosis.search.stages import (
    IN_TURN,
    InTurn,
    Search,
    Stage,
    admission,
    at_its_end,
    best_of,
    is_full,
    search,
    stage,
)
from cosim.estimation.fit import Fit
from pyfmi_models.effects import Effect
from pyfmi_models.mount import Mount

ROUNDS = 4
NOT_ASKED = "whether another effect takes a place in what stands was not asked."
CHANGED_PLACES = f"Effects changed places {ROUNDS} times, and the search ended: {NOT_ASKED}"

Stages = dict[tuple[str, ...], Stage]
"""What was tried beside each structure, by the names of its effects."""


@dataclass(frozen=True)
class AcceptedEffect:
    """One effect (with the harmonics of a ripple), what it is worth beside the others, and its rivals."""

    effects: tuple[Effect, ...]
    own: CandidateFit
    without: Fit
    rivals: tuple[CandidateFit, ...]
    """One of each kind, the closest first."""
    margins: Mapping[str, float]
    """Nats by which this effect is better than each rival as a fit."""
    contests: Mapping[str, float]
    """Nats by which its name beats that of each rival, see `stages.contest`."""
    misfits: Misfits = field(default_factory=dict)
    simpler: tuple[CandidateFit, ...] = ()
    """The same coupling in forms of fewer numbers: those it has may have stood in for a coupling that came later."""

    @property
    def effect(self) -> Effect:
        """The effect; of a ripple its strongest wave."""
        return _strongest(self.effects)

    def within(self, mount: Mount) -> Effect:
        """The same effect as a mount has it, whose effects were fitted anew."""
        return _strongest([one for one in mount.effects if one.name == self.effect.name][-len(self.effects) :])

    def margin(self, rival: CandidateFit) -> float:
        """Nats by which this effect is better than a rival."""
        return self.margins[rival.effect.name]


def _strongest(waves: Sequence[Effect]) -> Effect:
    return max(waves, key=lambda one: float(getattr(one, "amplitude", 0.0)))


@dataclass(frozen=True)
class Examined:
    """The structure that stands, and its effects."""

    base: Fit
    chosen: Fit
    effects: tuple[AcceptedEffect, ...]
    last: Stage
    """What was tried beside the structure that stands."""
    ended: tuple[str, ...] = ()
    """What was not asked, in a sentence, where a bound ended the search."""


def searched_and_examined(comparison: Comparison, base: Fit, refits: InTurn) -> Examined:
    """What a search finds, each effect of it challenged."""
    with refits:
        return examine(comparison, search(comparison, base, refits), refits)


def examine(comparison: Comparison, found: Search, refits: InTurn = IN_TURN) -> Examined:
    """Take out, challenge and swap, and add what has evidence beside what was swapped in, until nothing changes.

    Where swaps go in a circle, or everything was asked beside `most_structures`, what stands is examined as it is.
    """
    chosen, ended = found.chosen, CHANGED_PLACES
    asked = _Examination(comparison, {_names(one.current): one for one in found.stages}, refits)
    for _ in range(ROUNDS):
        effects, better = asked.round(chosen)
        if better is None:
            better = asked.grown(effects, asked.stage_after(chosen))
        if better is None:
            return Examined(found.base, chosen, tuple(effects), asked.stage_after(chosen))
        chosen = better
        if len(asked.known) >= comparison.policy.most_structures:
            ended = (
                f"The search ended after all effects had been tried beside {len(asked.known)} structures: {NOT_ASKED}"
            )
            break
    effects = [asked.challenged(chosen, group) for group in grouped(comparison, chosen)]
    return Examined(found.base, chosen, tuple(effects), asked.stage_after(chosen), (ended,))


@dataclass(frozen=True)
class _Examination:
    """What all challenges share: the comparison, what was tried beside each structure, and what refits them."""

    comparison: Comparison
    known: Stages
    refits: InTurn

    def stage_after(self, fit: Fit, stands: CandidateFit | None = None) -> Stage:
        """What was tried beside a structure, found once; `stands`: an effect that is fitted beside it already."""
        names = _names(fit)
        if names not in self.known:
            self.known[names] = stage(self.comparison, fit, self.refits, stands)
        return self.known[names]

    def without(self, chosen: Fit, group: tuple[Effect, ...]) -> tuple[Stage, CandidateFit]:
        """What was tried beside a structure without one of its effects, and that effect there.

        It is not fitted once more, but for what other forms of it may tell: multiples of a ripple, a coupling's.
        """
        without = self.comparison.problem.without(chosen, group[0].name)
        own = weighed(self.comparison, chosen, without, effect=group[0])
        stage = self.stage_after(without, own if len(group) == 1 and not group[0].source else None)
        if stage.current is without:
            return stage, own
        return stage, weighed(self.comparison, chosen, stage.current, effect=group[0])

    def grown(self, effects: Sequence[AcceptedEffect], stage: Stage) -> Fit | None:
        """The structure with one more effect, of which the search, which went another way, may not have known."""
        if any(is_small(one.own, self.comparison.policy) for one in effects):
            return None
        best = best_of(self.comparison, stage, max((one.own.evidence for one in effects), default=0.0))
        if best is None or is_full(best, self.comparison):
            return None
        return at_its_end(self.comparison, best, stage.current).fit

    def round(self, chosen: Fit) -> tuple[list[AcceptedEffect], Fit | None]:
        """The effects of a structure, each challenged; none and another structure where one of them gives way."""
        effects, groups, policy = [], grouped(self.comparison, chosen), self.comparison.policy
        for group in groups:
            one = self.challenged(chosen, group)
            if one.own.evidence < policy.clear and len(groups) > 1:
                return [], one.without
            best = settled(one.misfits, one.own, one.rivals)
            least = one.own.evidence - policy.fair
            best = next((form for form in one.simpler if form.evidence > least), best)
            if best is one.own:
                free = [r for r in one.rivals if excludes(one.misfits, one.effect, r.effect) is None]
                best = next((rival for rival in free if _takes(rival, one, policy)), best)
            if best is not one.own:
                return [], at_its_end(self.comparison, best, one.without).fit
            effects.append(one)
        return effects, None

    def challenged(self, chosen: Fit, group: tuple[Effect, ...]) -> AcceptedEffect:
        """An effect of a structure, and each other effect that may stand in its place."""
        comparison, problem, name = self.comparison, self.comparison.problem, group[0].name
        self.refits.on_progress(group[0].title)
        rest = tuple(effect for effect in chosen.mount.effects if not any(effect is one for one in group))
        stage, own = self.without(chosen, group)
        others = [one for one in stage.tried if one.effect.name != name]
        if len(rest) > len(problem.mount.effects):
            standing = replace(chosen.mount, effects=rest)
            # Another start gained 71 nats once and 2 at most else (65 fits of 30 cases): none comes back from so far.
            others = [
                refitted_from_here(comparison, standing, stage.current, one)
                if own.evidence - one.evidence < comparison.policy.sure
                else one
                for one in others
            ]
        best: dict[str, CandidateFit] = {}
        for rival in (one for one in others if _is_admissible(comparison, one)):
            if rival.effect.name not in best or rival.evidence > best[rival.effect.name].evidence:
                best[rival.effect.name] = rival
        near = [key for key, rival in best.items() if contest(comparison, own, rival) < comparison.policy.clear]
        best |= {key: at_its_end(comparison, best[key], stage.current) for key in near}
        misfits = misfits_of(problem.prepared, chosen.mount, group[0])
        margins = {key: margin(comparison, own, rival) for key, rival in best.items()}
        ranked = sorted(best.values(), key=lambda rival: margins[rival.effect.name])
        contests = {rival.effect.name: contest(comparison, own, rival) for rival in ranked}
        fewer = [one for one in stage.tried if one.effect.name == name and one.fit.count < own.fit.count]
        simpler = tuple(fewer) if group[0].source else ()
        one = AcceptedEffect(group, own, stage.current, tuple(ranked), margins, contests, misfits, simpler)
        found = with_names(one)
        _enter(comparison, found)
        return found


def _takes(rival: CandidateFit, one: AcceptedEffect, policy: Policy) -> bool:
    """Whether a rival takes the place: it is better, or as good and simpler; one as good and less simple does not.

    As good is what is within `fair`, and what no contest of names decides (`contest` is 0: of 400 rows one of them is
    ahead, of a few ways of being wrong the other): more numbers fit what the equation misses, too. A wave over position
    with any number of cycles stands in for whatever goes with position, so in a set with one it gives way to a name of
    one shape.
    """
    waves = _is_wave(one.effect) - _is_wave(rival.effect)
    if waves:
        return one.contests[rival.effect.name] < waves * policy.fair
    fewer = one.own.fit.count - rival.fit.count
    if fewer and one.contests[rival.effect.name] == 0.0:
        return fewer > 0
    margin = one.margin(rival)
    return margin < (policy.fair if fewer > 0 else -policy.fair if fewer < 0 else 0.0)


def _is_wave(effect: Effect) -> bool:
    return isinstance(hypothesis_of(effect), Cyclic)


def grouped(comparison: Comparison, chosen: Fit) -> list[tuple[Effect, ...]]:
    """Effects that were added, the waves of one ripple together."""
    groups: dict[str, list[Effect]] = {}
    for effect in chosen.mount.effects[len(comparison.problem.mount.effects) :]:
        groups.setdefault(effect.name, []).append(effect)
    return [tuple(group) for group in groups.values()]


def refitted_from_here(comparison: Comparison, rest: Mount, without: Fit, one: CandidateFit) -> CandidateFit:
    """A rival, or its fit from the numbers that the others have in the structure that stands, where that is better.

    Alone the others go where they do for what was taken out, and with a rival a fit may not come back.
    """
    found = comparison.problem.roughly.fit(replace(rest, effects=(*rest.effects, one.effect)), 36)
    again = replace(weighed(comparison, found, without, one.many), is_rough=True)
    return again if again.evidence > one.evidence else one


def with_names(one: AcceptedEffect) -> AcceptedEffect:
    """The same with other names of the effect, and of each rival, as rivals: behind by nothing, or by as much."""
    own, rivals = renamed(one.own), [(rival, other) for rival in one.rivals for other in renamed(rival)]
    if not own and not rivals:
        return one
    margins, contests = {other.effect.name: 0.0 for other in own}, {other.effect.name: 0.0 for other in own}
    margins |= {other.effect.name: one.margins[rival.effect.name] for rival, other in rivals}
    contests |= {other.effect.name: one.contests[rival.effect.name] for rival, other in rivals}
    everyone = [*own, *one.rivals, *(other for _, other in rivals)]
    margins, contests = margins | dict(one.margins), contests | dict(one.contests)
    ranked = tuple(sorted(everyone, key=lambda rival: margins[rival.effect.name]))
    return replace(one, rivals=ranked, margins=margins, contests=contests)


def _is_admissible(comparison: Comparison, one: CandidateFit) -> bool:
    rules = until_refused(admission(comparison, one))
    comparison.judge(one.effect.name, one.fit, rules)
    return all_pass(rules)


def _enter(comparison: Comparison, found: AcceptedEffect) -> None:
    """Enter an effect that was challenged into the ledger: what it is worth beside the others, and each rival."""
    name, own, policy = found.effect.name, found.own, comparison.policy
    comparison.enter(name, own.fit, own.plain_gain)
    kept = at_least("evidence beside the other effects", own.evidence, policy.clear, "nats")
    ahead = (
        at_least(f"ahead of {r.effect.name}", found.contests[r.effect.name], policy.fair, "nats") for r in found.rivals
    )
    comparison.judge(name, own.fit, [kept, *ahead])
    for rival in found.rivals:
        comparison.enter(rival.effect.name, rival.fit, rival.plain_gain)
        behind, said = found.contests[rival.effect.name], f"less than the margin of a set behind {name}"
        rule = Rule(said, behind < policy.fair, behind, policy.fair, "nats")
        comparison.judge(rival.effect.name, rival.fit, [rule])


def _names(found: Fit) -> tuple[str, ...]:
    return tuple(sorted(effect.name for effect in found.mount.effects))


def margins(one: AcceptedEffect) -> dict[str, float]:
    """Nats by which a name beats that of each rival; where the set point speaks of both, by that."""
    told = {rival.effect.name: excludes(one.misfits, one.effect, rival.effect) for rival in one.rivals}
    return {name: one.contests[name] if by is None else by / 2 for name, by in told.items()}


def waves(one: AcceptedEffect) -> tuple[str, ...]:
    """Rivals that are waves over position, where the effect is none."""
    return () if _is_wave(one.effect) else tuple(r.effect.name for r in one.rivals if _is_wave(r.effect))


def explains(one: AcceptedEffect) -> dict[str, float]:
    """Share of the plain residual energy that an effect, or a rival in its place, removes."""
    return {candidate.effect.name: max(candidate.plain_gain, 0.0) for candidate in (one.own, *one.rivals)}
