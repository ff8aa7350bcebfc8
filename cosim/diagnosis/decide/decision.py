"""The decision, from scores alone: what is named, what stays open, whether something unknown is left. No data here."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, sqrt

from cosim.diagnosis.answer.ledger import Rule
from cosim.diagnosis.answer.scores import EffectScores, ResidualScores, Scores, TermScores
from cosim.diagnosis.decide.calibration import calibrated
from cosim.diagnosis.decide.policy import Policy

IN_BURSTS = "time, in bursts"
SHAKING = {
    "share of the error that comes in bursts": IN_BURSTS,
    "random disturbance at any motion relative to friction": "nothing that was recorded",
}
"""Rules by which something shakes a machine, now and then or all the time; what the rest is then said to go with."""


ALL: Mapping[str, float] = {}
"""Every name keeps its probability."""


@dataclass(frozen=True)
class Decision:
    """The answer."""

    sets: Mapping[str, tuple[str, ...]]
    """For each named effect the rivals that these recordings cannot exclude."""
    probabilities: Mapping[str, Mapping[str, float]]
    """For each named effect the probabilities of the members of its set."""
    is_unknown: bool
    depends_on: tuple[str, ...]
    doubtful: tuple[str, ...] = ()
    """Names that help, and may yet imitate what is unknown."""

    def with_share(self, share: float) -> "Decision":
        """The same with so much of each probability."""
        kept = {name: {one: share * p for one, p in members.items()} for name, members in self.probabilities.items()}
        return replace(self, probabilities=kept)

    def with_rest(
        self, follows: tuple[str, ...], kept: Mapping[str, float] = ALL, doubtful: tuple[str, ...] = ()
    ) -> "Decision":
        """The same where something has no name, and follows quantities.

        `kept` is the share of its probability that a name keeps then; `doubtful` are names that may imitate the rest.
        """
        if self.is_unknown:
            return self
        probabilities = {
            name: {one: kept.get(name, 1.0) * value for one, value in members.items()}
            for name, members in self.probabilities.items()
        }
        return Decision(self.sets, probabilities, True, follows, doubtful)


def decide(scores: Scores, policy: Policy) -> Decision:
    """Decide what is named, what stays open and whether something without a name is left.

    Pure: scores that were stored are decided again in less than a millisecond, by this policy or another. Names with
    which the model is worse on the held-out recordings are possible, no more: half of their probability is left.
    """
    rest, learned = beyond_any_machine(scores.rest, policy), scores.learned
    found, least = _of_rest(scores.effects, rest, policy), least_left(scores.effects, policy)
    if not found.is_unknown and learned and learned.is_sure and not learned.is_of_law:  # a law is no missing effect
        slight = {term.name for term in scores.rest.terms} - {term.name for term in rest.terms}
        enough = learned.removed >= policy.considerable and learned.evidence >= least
        if enough and not set(learned.quantities) <= slight:
            found = beside_rest(scores.effects, learned.quantities, policy, rest.changes)
    return found if scores.improves else found.with_share(policy.half)


def _of_rest(effects: Sequence[EffectScores], residual: ResidualScores, policy: Policy) -> Decision:
    if is_left(effects, residual, policy):
        return beside_rest(effects, followed(residual, policy), policy, residual.changes)
    named = _named(effects, policy)
    # What shakes a machine is no part of what a name says, and no name imitates it.
    shaking = [rule.name for rule in shaking_rules(residual, policy) if rule.outcome]
    return named.with_rest((SHAKING[shaking[0]],)) if shaking else named


def shaking_rules(residual: ResidualScores, policy: Policy) -> Iterator[Rule]:
    """Rules of which one is enough to say that something shakes the machine."""
    values = ((residual.in_bursts, policy.small), (residual.shaken, policy.slight))
    for name, (value, limit) in zip(SHAKING, values, strict=True):
        yield Rule(name, value > limit, value, limit)


def beside_rest(
    effects: Sequence[EffectScores], follows: tuple[str, ...], policy: Policy, changes: bool = False
) -> Decision:
    """The answer where something without a name is left, that follows quantities: margins count for less there.

    A name may imitate it where a term over what was recorded explains nearly as much, and where a machine `changes` at
    a time: no term but the name has the load that came.
    """
    weighed = [one.with_margins_of(policy.fair / policy.clear) for one in effects]
    # Those leave too much to be sure: a part of one cause may look like them. What is only an imitation a term without
    # a name does nearly as well.
    weak = [one for one in effects if max(one.explains[one.effect], one.removes) < policy.nearly_all]
    doubtful = tuple(one.effect for one in weak if changes or one.ahead < policy.clear)
    shares = {one.effect: policy.true_beside_unknown if one.effect in doubtful else policy.true_ahead for one in weak}
    return _named(weighed, policy).with_rest(follows, shares, doubtful)


def _named(effects: Sequence[EffectScores], policy: Policy) -> Decision:
    sets = {one.effect: open_rivals(one, policy) for one in effects}
    return Decision(sets, {one.effect: _probabilities(one, sets[one.effect], policy) for one in effects}, False, ())


def doubted(effects: Sequence[EffectScores], residual: ResidualScores, policy: Policy) -> tuple[str, ...]:
    """Names that may be no more than imitations: what is left beside them is not much less than what they explain."""
    left = max((one.evidence for one in residual.terms), default=0.0)
    if left < policy.strong:
        return ()
    weak = [one for one in effects if one.explains[one.effect] < policy.nearly_all]
    return tuple(one.effect for one in weak if left > policy.considerable * one.evidence)


@dataclass(frozen=True)
class Gain:
    """What held-out recordings gain by an effect: nats, and shares of the plain residual energy in two bands.

    The bands are those of the analysis and of the protocol, the wider one last: fast effects show in the wider one, and
    in either a few rows of noise may hide what the other shows.
    """

    nats: float
    narrow: float
    wide: float
    at_rest: float = 0.0
    """Share at rest, where it says something and the model without it nothing; else 0."""
    moving: float = 0.0
    """Share in clear motion, in the band of the analysis."""

    def halves(self, policy: Policy) -> bool:
        """Whether the plain error energy is halved in both bands, and the likelihood does not clearly speak against it.

        What is slow is free to wander in the likelihood, so that an effect of it may gain nothing there; where hardly
        anything is left, it judges the few parts in a hundred that the equation misses, and is not asked. Of rows at
        rest, which hardly count in it, the error may be halved instead, where nothing is raised.
        """
        removed = min(self.narrow, self.wide)
        halved = max(removed, self.at_rest if removed >= 0 else 0.0) >= policy.half
        return halved and (self.nats > -policy.strong or removed >= policy.nearly_all)

    def predicts(self, policy: Policy) -> bool:
        """Whether the likelihood clearly says so, or says so of what is large, or the plain error is halved."""
        large = min(self.narrow, self.wide) >= policy.considerable or self.at_rest >= policy.half
        said = self.nats >= policy.clear or (large and self.nats >= policy.fair)
        return said or self.halves(policy)

    def matters_alone(self, policy: Policy) -> bool:
        """Whether an effect that is small in training matters held out: it halves the error there, and predicts."""
        return self.halves(policy) and self.nats >= policy.fair

    def raises(self, policy: Policy) -> bool:
        """Whether the plain error is raised, in both bands or by much in one.

        What predicts and removes a considerable share in clear motion may raise it at rest: a bristle there creeps with
        each vibration that a filter leaves, and holds a torque of which the recording does not show the beginning.
        """
        if self.moving >= policy.considerable and self.nats >= policy.clear:
            return False
        return max(self.narrow, self.wide) < 0 or min(self.narrow, self.wide) < -policy.slight


def held_out_rules(gain: Gain, policy: Policy) -> Iterator[Rule]:
    """Rules by which an effect stands on the held-out recordings.

    It predicts (or halves the plain error), and does not raise the plain error there.
    """
    nats, limit = gain.nats, policy.clear
    narrow, wide, moving = (100 * share for share in (gain.narrow, gain.wide, gain.moving))
    removed = f"removes {narrow:.0f} and {wide:.0f} % of the error energy in two bands, {moving:.0f} % in motion"
    yield Rule("predicts held-out recordings", gain.predicts(policy), nats, limit, "nats", removed)
    lowest = min(gain.narrow, gain.wide)
    yield Rule("does not raise the held-out error", not gain.raises(policy), lowest, -policy.slight)


def open_rivals(one: EffectScores, policy: Policy) -> tuple[str, ...]:
    """Rivals that are not beaten by the margin of a set, closest first."""
    near = [name for name, margin in one.margins.items() if margin < policy.fair]
    return tuple(sorted(near, key=lambda name: one.margins[name]))


def is_left(effects: Sequence[EffectScores], residual: ResidualScores, policy: Policy) -> bool:
    """Whether something is left that is no misfit of a friction law, nor of the equations of what is named."""
    return any(rule.outcome for rule in rest_rules(effects, residual, policy))


def rest_rules(effects: Sequence[EffectScores], residual: ResidualScores, policy: Policy) -> Iterator[Rule]:
    """Rules of which one is enough to say that something without a name is left."""
    shares = (
        ("slow error in training relative to friction", residual.share, policy.small),
        ("slow error held out relative to friction", residual.share_there, policy.considerable),
        ("the same beside friction-law error", residual.share_beside, policy.slight),
    )
    for name, value, limit in shares:
        yield Rule(name, value > limit, value, limit)
    yield Rule("another cause explains more than a name", bool(residual.in_place), note=", ".join(residual.in_place))
    doubtful = doubted(effects, residual, policy)
    least = least_left([one for one in effects if one.effect not in doubtful], policy)
    for term in residual.terms:
        limit = max(least, _floor_of(term, policy))
        yield Rule(f"error follows {term.name}", term.evidence >= limit, term.evidence, limit, "nats")


def least_left(named: Sequence[EffectScores], policy: Policy) -> float:
    """Evidence [nats] below which what is left may be no more than what the equations of the names lack."""
    return policy.considerable * max((one.evidence for one in named), default=0.0)


def beyond_any_machine(residual: ResidualScores, policy: Policy) -> ResidualScores:
    """The rest without what any machine has: a friction level that is a little uneven over position.

    `least_uneven` is an amplitude; the RMS of a wave is that by sqrt 2.
    """
    least = policy.least_uneven / sqrt(2)
    slight = {term.name for term in residual.terms if term.uneven is not None and term.uneven < least}
    terms = [term for term in residual.terms if term.name not in slight]
    return replace(residual, terms=terms, in_place=tuple(name for name in residual.in_place if name not in slight))


def _floor_of(term: TermScores, policy: Policy) -> float:
    """Evidence that a term must have: the less, the more it predicts of the held-out recordings."""
    if term.share >= policy.considerable:
        return policy.clear
    return policy.strong if term.share >= 0 else policy.sure


def followed(residual: ResidualScores, policy: Policy) -> tuple[str, ...]:
    """Quantities that the residual follows elsewhere, the best first; where there is none, how it goes over time."""
    if residual.in_place:
        return residual.in_place
    best = max((one.share for one in residual.terms), default=0.0)
    least = max(policy.considerable, policy.half * best)
    ranked = sorted(residual.terms, key=lambda one: -one.share)
    return tuple(one.name for one in ranked if one.share > least) or (residual.over_time,)


def _probabilities(one: EffectScores, members: Sequence[str], policy: Policy) -> dict[str, float]:
    """Posterior shares of an effect, its rivals and "none", times what each explains, calibrated.

    Priors are equal, but for a wave behind a name of one shape: it would have to be ahead by `fair` to take its place.
    """
    lower = dict.fromkeys(one.waves, policy.fair)
    odds = {one.effect: 0.0, **{name: -margin - lower.get(name, 0.0) for name, margin in one.margins.items()}}
    top = max(odds.values())
    weights = {name: exp(value - top) for name, value in odds.items()}
    total = sum(weights.values()) + exp(-min(one.evidence, 700.0) - top)
    shown = {name: calibrated(weights[name] / total * one.explains[name]) for name in (one.effect, *members)}
    return {name: value / max(1.0, sum(shown.values())) for name, value in shown.items()}
