"""Search: which effects are worth a refit, what each is worth after it, and what comes next.

In every stage each form of an effect is screened by two statistics - the evidence of a linear step, the share of the
plain energy - and the best forms by either are refitted. Nothing is dropped because something else was rejected.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from cosim.diagnosis.answer.ledger import Rule, all_pass, at_least, until_refused
from cosim.diagnosis.decide.policy import Policy
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.effects.candidates import columns_of
from cosim.diagnosis.effects.tuning import in_whole_cycles
from cosim.diagnosis.evidence.comparison import Comparison, Screened, aside_for
from cosim.diagnosis.search.admissibility import in_time, name_rules
from cosim.diagnosis.search.candidate_fit import CandidateFit, is_small, margin, weighed
from cosim.diagnosis.search.instrumental_variable import is_asked_for, is_told, misfits_of, settled
from cosim.estimation.fit import Fit
from pyfmi_models.effects import Effect

OnProgress = Callable[[str], None]
MULTIPLES = (2, 3, 4, 5)
"""Multiples of the cycles of a ripple that are asked for at once: slots and rollers are no sines."""
MOST_WAVES = 8
"""Effects that one diagnosis may add, each harmonic of a ripple counted."""


@dataclass(frozen=True)
class Stage:
    """A structure, and all effects that were refitted beside it, best first."""

    current: Fit
    tried: tuple[CandidateFit, ...]


Start = tuple[Effect, int]
"""An effect that is worth a refit, and how many members of its form were tried."""


class InTurn:
    """The refits of a stage, one after the other, of which `on_progress` is told; a context, after which none comes."""

    def __init__(self, on_progress: OnProgress = lambda _: None) -> None:
        self.on_progress = on_progress

    def __enter__(self) -> "InTurn":
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def __call__(self, comparison: Comparison, current: Fit, worth: Sequence[Start]) -> list[CandidateFit]:
        """Refit a structure with each of some effects."""
        found = []
        for number, (effect, many) in enumerate(worth, 1):
            self.say(effect, number, len(worth))
            found.append(refitted(comparison, current, effect, many))
        return found

    def say(self, effect: Effect, number: int, of: int) -> None:
        """Say what is being refitted, and how far a stage is."""
        self.on_progress(f"{effect.title} ({number} of {of})")


IN_TURN = InTurn()


def stage(comparison: Comparison, current: Fit, refits: InTurn = IN_TURN, stands: CandidateFit | None = None) -> Stage:
    """Screen all candidates beside a structure and refit the best forms; `stands`: one that is fitted already."""
    worth = starts(comparison.screen(current), comparison.policy)
    if stands is not None:
        worth = [one for one in worth if one[0].name != stands.effect.name]
    fits = [*refits(comparison, current, worth), *([] if stands is None else [stands])]
    top = max((one.evidence for one in fits), default=0.0)
    near = max(comparison.policy.fair, top - comparison.policy.clear)
    fits = [at_its_end(comparison, one, current) if one.evidence > near else one for one in fits]
    for one in fits:
        comparison.enter(one.effect.name, one.fit, one.plain_gain)
    return Stage(current, tuple(sorted(fits, key=lambda one: -one.evidence)))


def starts(screened: Sequence[Screened], policy: Policy) -> list[Start]:
    """Effects worth a refit."""
    forms: dict[type[Effect], list[Screened]] = {}
    for one in screened:
        forms.setdefault(one.form, []).append(one)
    hopeful = {form: some for form, some in forms.items() if any(is_hopeful(one, policy) for one in some)}
    ranked = []
    for statistic in ("evidence", "plain"):
        best = {form: max(members, key=lambda one: getattr(one, statistic)) for form, members in hopeful.items()}
        order = sorted(best, key=lambda form: -getattr(best[form], statistic))
        ranked.append([best[form] for form in order[: policy.refitted]])
    near = [one for best in ranked[0] for one in _of_others(best, hopeful[best.form], policy)]
    chosen = list({_key(one): one for group in (*ranked, near) for one in group}.values())
    found = [(one.candidate.start(one.coefficients), len(forms[one.form])) for one in chosen]
    kinds = {type(effect) for effect, _ in found}
    # Twins are alike at first order: where one is tried, the other must be, whatever a linear score says.
    twins = [(twin, many) for effect, many in found for twin in hypothesis_of(effect).twins(effect)]
    return found + [(twin, many) for twin, many in twins if type(twin) not in kinds]


def _of_others(best: Screened, members: Sequence[Screened], policy: Policy) -> list[Screened]:
    """Of a form the best of another source, where a linear step hardly tells them apart."""
    (own,) = {each.source for each in best.candidate.instances}
    others = [one for one in members if one.candidate.instances[0].source != own]
    return [
        one for one in sorted(others, key=lambda one: -one.evidence)[:1] if one.evidence > best.evidence - policy.clear
    ]


def is_hopeful(one: Screened, policy: Policy) -> bool:
    """Whether a linear step towards a candidate promises anything, by either statistic."""
    return one.evidence > 0 or one.plain >= policy.negligible


def _key(one: Screened) -> object:
    """What tells candidates apart that are worth a refit each: the form, where its refit looks for the rest itself."""
    return one.form if hypothesis_of(one.candidate.instances[0]).finds_its_way else id(one)


def refitted(comparison: Comparison, current: Fit, effect: Effect, many: int) -> CandidateFit:
    """Add an effect to a fitted structure, refit everything, as one of many, weigh it."""
    problem = comparison.problem.roughly
    grown = replace(current.mount, effects=(*current.mount.effects, effect))
    found, aside = problem.fit(grown, 36), aside_for(effect.id)
    before = comparison.evidence(current, aside, beside=current)

    def gain(fit: Fit, few: bool = False) -> float:
        return comparison.evidence(fit, aside, few, beside=current) - before

    found = hypothesis_of(effect).tuned(problem, found, effect, gain)
    return replace(weighed(comparison, found, current, many), is_rough=True)


def at_its_end(comparison: Comparison, one: CandidateFit, current: Fit) -> CandidateFit:
    """A candidate beside a structure whose fit has come to its end."""
    if not one.is_rough:
        return one
    return weighed(comparison, comparison.problem.fit(one.fit.mount, 36), current, one.many)


@dataclass(frozen=True)
class Search:
    """Structures in the order in which effects were added, and the stage beside each."""

    base: Fit
    stages: tuple[Stage, ...]

    @property
    def chosen(self) -> Fit:
        """The last structure."""
        return self.stages[-1].current


def search(comparison: Comparison, base: Fit, refits: InTurn = IN_TURN) -> Search:
    """Add the admissible effect of the largest evidence until none has enough; beside a small one nothing is added."""
    stages, largest = [stage(comparison, base, refits)], 0.0
    while True:
        now = stages[-1]
        best = best_of(comparison, now, largest)
        if best is None or is_full(best, comparison):
            return Search(base, tuple(stages))
        best = at_its_end(comparison, best, now.current)
        largest = max(largest, best.evidence)
        stages.append(stage(comparison, with_harmonics(comparison, best.fit, best.effect), refits))
        if is_small(best, comparison.policy):
            return Search(base, tuple(stages))


def least(policy: Policy, largest: float, share: float) -> float:
    """Evidence that one more effect must have beside others of which the largest has so much: half of it, within steps.

    An equation is never quite the machine's, and what it lacks looks like another effect. False ones beside true ones
    had .33 to .37 of it, true ones .53 and more. What removes half of the error energy that the others leave needs no
    more than alone: what is slow has few independent rows, and so little evidence beside what is fast.
    """
    if share >= policy.half:
        return policy.clear
    return min(policy.sure, max(policy.clear, policy.half * largest))


def best_of(comparison: Comparison, now: Stage, largest: float = 0.0) -> CandidateFit | None:
    """The admissible candidate of the largest evidence among those with enough, beside effects with at most `largest`.

    A small one is taken if it is the only thing there is: then the held-out recordings must show that it matters.
    """
    policy = comparison.policy
    asked = {id(one): until_refused(_search_rules(comparison, one, largest)) for one in now.tried}
    for one in now.tried:
        comparison.judge(one.effect.name, one.fit, asked[id(one)])
    fit = [one for one in now.tried if all_pass(asked[id(one)])]
    best = _demanded(comparison, [one for one in fit if not is_small(one, policy)])
    if best is None and not largest:
        best = _demanded(comparison, fit)
    for one in fit:
        comparison.judge(one.effect.name, one.fit, list(_choice(one, best, policy)))
    return best


def _choice(one: CandidateFit, best: CandidateFit | None, policy: Policy) -> Iterator[Rule]:
    """Rules by which one of several that pass is taken first."""
    if one is not best and is_small(one, policy):
        yield Rule("not a small effect", False, one.evidence, policy.sure, "nats")
    elif best:
        yield Rule("most evidence at its step of the search", one is best, one.evidence, best.evidence, "nats")


def _search_rules(comparison: Comparison, one: CandidateFit, largest: float) -> Iterator[Rule]:
    """Rules by which the search takes an effect, beside others of which the largest has so much evidence.

    The cause of a coupling beside one with another neighbour was recorded, and moves by itself: what the equation of
    the other lacks does not follow that. With three weak couplings beside a strong one the held-out error is half as
    large so as by `least`.
    """
    policy, own = comparison.policy, one.effect
    has_own_cause = any(other.id == own.id and other.source != own.source for other in one.fit.mount.effects)
    limit = policy.clear if has_own_cause else least(policy, largest, one.plain_gain)
    yield at_least("evidence", one.evidence, limit, "nats")
    yield from admission(comparison, one)


def _demanded(comparison: Comparison, fit: Sequence[CandidateFit]) -> CandidateFit | None:
    """The best of some candidates that the set point does not exclude; between delay and lag it decides."""
    misfits = {id(one): misfits_of(comparison.problem.prepared, one.fit.mount, one.effect) for one in fit}
    timed = [one for one in fit if misfits[id(one)]]
    rules = {id(one): Rule("the set point demands it", is_told(misfits[id(one)], one)) for one in timed}
    for one in timed:
        comparison.judge(one.effect.name, one.fit, [rules[id(one)]])
    demanded = [one for one in fit if id(one) not in rules or rules[id(one)].outcome]
    if not demanded:
        return None
    best = first_of(comparison, demanded)
    return settled(misfits[id(best)], best, demanded)


def first_of(comparison: Comparison, several: Sequence[CandidateFit]) -> CandidateFit:
    """The best of some candidates beside one structure."""
    ranked = sorted(several, key=lambda one: -one.evidence)
    best = ranked[0]
    for rival in ranked[1:]:
        if aside_for(best.effect.id) != aside_for(rival.effect.id) and margin(comparison, best, rival) < 0:
            best = rival
    return best


def admission(comparison: Comparison, one: CandidateFit) -> Iterator[Rule]:
    """Rules of whether an effect is large enough to matter, means what its name says, and shows in this motion."""
    policy, problem, own = comparison.policy, comparison.problem, hypothesis_of(one.effect)
    yield at_least("share of the error energy", one.plain_gain, policy.negligible)
    if own.must_stand_out:
        yield at_least("energy relative to the reading's noise", one.above_noise, policy.least_above_noise)
    if own.is_timing:
        yield at_least("share that it removes away from reversals", one.away, policy.small)
    if one.at_rest < 1.0:
        yield at_least("share of the error at rest", one.at_rest, policy.half)
    yield from name_rules(problem, one, holds_at_rest(one, policy))
    yield Rule("the model explains the changes of the torque", in_time(problem, one))
    if own.must_stand_out:
        yield Rule("the set point demands it", is_asked_for(comparison, one.fit, one.effect))


def holds_at_rest(one: CandidateFit, policy: Policy) -> bool:
    """Whether an effect surely is what is held at rest: all but a tenth of the energy there, and not a small effect."""
    return policy.nearly_all <= one.at_rest < 1.0 and one.evidence >= policy.sure


def is_full(best: CandidateFit, comparison: Comparison) -> bool:
    """Whether a structure with this effect has more than may be named."""
    added = best.fit.mount.effects[len(comparison.problem.mount.effects) :]
    return len({effect.id for effect in added}) > comparison.policy.most_effects or len(added) > MOST_WAVES


def with_harmonics(comparison: Comparison, found: Fit, ripple: Effect) -> Fit:
    """A fitted structure with those multiples of its ripple that have evidence, fitted together.

    What the ripple alone had of its multiples may have drawn its cycles aside, so a whole number is asked again.
    """
    own = hypothesis_of(ripple)
    tried = [one for k in MULTIPLES if (one := own.multiple(ripple, k)) is not None]
    if not tried:
        return found
    groups = columns_of(found.mount, tried, comparison.problem.prepared, found.values)
    scored = comparison.score(found, tried, groups)
    least = comparison.policy.clear
    more = tuple(one.candidate.start(one.coefficients) for one in scored if one.evidence > least)
    if not more:
        return found
    together = comparison.problem.fit(replace(found.mount, effects=(*found.mount.effects, *more)), 30)
    return in_whole_cycles(comparison.problem, together, 1 + len(more))
