"""The whole way: recordings and a card in, a diagnosis and a better card out."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from cosim.data.own_rate import as_analysed
from cosim.data.recording import Recording
from cosim.diagnosis.answer.doubt_entry import Sanity, not_determined_doubts
from cosim.diagnosis.answer.entries import BroadbandEntry
from cosim.diagnosis.answer.names import with_short_names
from cosim.diagnosis.answer.result import Diagnosis, Finding, Trace
from cosim.diagnosis.answer.scores import Scores
from cosim.diagnosis.decide.decision import Decision, beyond_any_machine, decide, rest_rules, shaking_rules
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.effects.candidates import at_own_level
from cosim.diagnosis.evidence.adequacy import friction_level
from cosim.diagnosis.evidence.band import in_band
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.measure.bounds import not_found, undecided
from cosim.diagnosis.measure.experiment import Experiment, best, in_words
from cosim.diagnosis.measure.findings import accepted, broadband_entry, measured_as, rival_finding, taken_finding
from cosim.diagnosis.measure.law_selection import proposed_law
from cosim.diagnosis.measure.loop_bias import loop_bias
from cosim.diagnosis.measure.protocol import (
    Structures,
    band_of,
    heldout_rms,
    judged_band,
    of_the_best,
)
from cosim.diagnosis.measure.regression import black_box_rms
from cosim.diagnosis.measure.withheld import measured, without_names
from cosim.diagnosis.search.admissibility import standard_errors
from cosim.diagnosis.search.candidate_fit import by_each_name, is_renamed
from cosim.diagnosis.search.delivered import detected, likelier, standing, structure_with
from cosim.diagnosis.search.global_test import global_test
from cosim.diagnosis.search.nameless import Nameless, nameless
from cosim.diagnosis.search.proof import Proof, prove_sets
from cosim.diagnosis.search.rivals import Examined, searched_and_examined
from cosim.diagnosis.search.scores import enter_answer, finished, scores_of, shaken_everywhere
from cosim.diagnosis.search.stages import InTurn
from cosim.diagnosis.terms.closed_form import ClosedForm, searches
from cosim.diagnosis.terms.learn import NOTHING_TRIED, Learned, learn
from cosim.diagnosis.trust.admission import admit
from cosim.diagnosis.trust.changes import changes
from cosim.diagnosis.trust.doubts import beyond_denial, doubts, of_base, of_delivered, single_readings, without_denied
from cosim.diagnosis.trust.limits import end_stop, half_sample
from cosim.estimation.blocks import Blocks
from cosim.estimation.determined import limited, not_determined, with_held
from cosim.estimation.end_stops import pushes, without
from cosim.estimation.fit import Fit
from cosim.estimation.half_sample import are_even, moved, torque_late
from cosim.estimation.prepare import PROTOCOL_HZ, prepare
from cosim.estimation.problem import Problem
from cosim.estimation.residuals import inside
from cosim.estimation.row_weights import weights
from cosim.support.statistics import rms
from pyfmi_models.card import Card
from pyfmi_models.effects import GravityUnbalance
from pyfmi_models.mount import Mount

OnProgress = Callable[[str], None]


@dataclass(frozen=True)
class Outcome:
    """A diagnosis, and cards: the model it ends with, what training alone proposes, the base refitted, names alone."""

    diagnosis: Diagnosis
    card: Card
    proposed: Card
    refitted: Card
    named: Card
    experiment: Experiment | None = None
    formulas: tuple[tuple[ClosedForm, str], ...] = ()
    """Formulas that are as good as what was learned, each with what is said of it: effects for a person to review."""


@dataclass(frozen=True)
class Answer:
    """What a diagnosis ends with: the comparison, what stands and what does not, what is left, what is decided.

    Delivered is the base with what is detected; what is only possible is told.
    """

    comparison: Comparison
    base: Fit
    held: Predictive
    found: Nameless
    changed: tuple[Sanity, ...]
    scores: Scores
    detected: frozenset[str] = frozenset()
    delivered: Fit | None = None

    @property
    def decision(self) -> Decision:
        """What is named, what stays open, whether something unknown is left."""
        return decide(self.scores, self.comparison.policy)

    @property
    def proof(self) -> Proof:
        """What stands on the held-out recordings."""
        return self.found.proof

    @property
    def chosen(self) -> Fit:
        """The structure that is delivered; before that is known, all that stands."""
        return self.delivered or self.proof.chosen

    def models(self, after: Mount | None = None) -> Structures:
        """The three models as cards hold them; the last is `after`, or what is delivered without a learned term."""
        problem = self.comparison.problem
        fitted = (limited(problem, one)[0] for one in (self.base.mount, after or self.chosen.mount))
        return Structures(problem.mount, *fitted)


def diagnose(
    train: Sequence[Recording],
    heldout: Sequence[Recording],
    card: Card,
    on_progress: OnProgress = lambda _: None,
    on_model_ready: Callable[[str, Mount], None] = lambda *_: None,
    refits: InTurn | None = None,
    with_possible: bool = False,
) -> Outcome:
    """Find what physics a card lacks.

    Args:
        train: recordings that may be fitted.
        heldout: recordings that nothing is fitted to. They prove the result, and have a veto: so their error after it
            is a little optimistic; `HeldOut.unvetoed_rms` is the error of what training alone proposed.
        card: the model as delivered.
        on_progress: told, in a few words, what is being done.
        on_model_ready: told the refitted base ("before") and the model it ends with ("after") as soon as they stand.
        refits: what refits structures (default: one after the other); the answer is the same.
        with_possible: whether the card holds effects that stand but are only possible too.

    Raises:
        InputError: the card holds an effect that a diagnosis cannot take into account yet.
        RecordingError: the recordings cannot belong to this card (units), or are too short.
    """
    started = time.perf_counter()
    searches()  # one that cannot be loaded is told now, not at the end
    train, heldout, sanity = _admitted(train, heldout, card)
    on_progress("refitting the base")
    problem, base, late = _refitted(train, heldout, card)
    sanity += half_sample((*train, *heldout), late, problem.sample_time)
    train, heldout = [moved(one, late) for one in train], [moved(one, late) for one in heldout]
    sanity += of_base(card, problem, base.mount, train, heldout)
    refitted = _improved(card, limited(problem, base.mount)[0])
    on_model_ready("before", refitted.plant())
    if any(one.blocks_naming for one in beyond_denial(sanity)):
        return _refused(refitted, without_names(problem, base.mount, train, heldout, sanity, started))
    comparison = Comparison.of(problem, base, POLICY)
    examined = searched_and_examined(comparison, base, refits or InTurn(on_progress))
    sanity = without_denied(sanity, examined.chosen, examined.last)
    if any(one.blocks_naming for one in sanity):
        return _refused(refitted, without_names(problem, base.mount, train, heldout, sanity, started))
    on_progress("proving on the recording that was not fitted")
    answer, tried = _delivered(_answer(comparison, examined, heldout), heldout, with_possible)
    learned = tried if tried and tried.helps else None
    mounts = (learned.mount if learned else answer.chosen.mount, examined.chosen.mount, answer.chosen.mount)
    after, first, named = (_improved(card, limited(problem, one)[0]) for one in mounts)
    unknown = not_determined(problem, limited(problem, mounts[0])[1])
    on_model_ready("after", after.plant())
    experiment = _experiment(answer)
    described = _with_learned(_described(answer, train, heldout, card), answer, tried, train, heldout)
    found = replace(
        _with_search(described, answer, examined, heldout),
        sanity=(*described.sanity, *of_delivered(sanity, card, problem, mounts[0]), *not_determined_doubts(unknown)),
        not_determined=unknown,
        next_experiment=in_words(experiment, card.controller is not None) if experiment else {},
        seconds=time.perf_counter() - started,
    )
    formulas = learned.stated() if learned else ()
    return Outcome(with_short_names(found), after, first, refitted, named, experiment, formulas)


def _admitted(
    train: Sequence[Recording], heldout: Sequence[Recording], card: Card
) -> tuple[list[Recording], list[Recording], tuple[Sanity, ...]]:
    """The recordings as they are analysed, without what pushes against an end stop, and what is doubtful of them."""
    read, free, stops = [[*map(as_analysed, some)] for some in (train, heldout)], [], []
    admit(card.plant(), read[0], read[1])
    sanity = (*doubts(read[0], read[1], card), *single_readings((*train, *heldout), (*read[0], *read[1])))
    for some in read:
        found = pushes(some, card.plant())
        free.append(without(some, found))
        stops += [end_stop(one, some, card.mount.motion) for one in found]
    return free[0], free[1], (*sanity, *stops)


def _refitted(train: Sequence[Recording], heldout: Sequence[Recording], card: Card) -> tuple[Problem, Fit, float]:
    """The refitted base, and by how much its torque acts later than it is stamped: by that it was moved [s].

    A logger stamps all recordings alike: what the held-out ones do not show as well is a delay of the machine.
    """
    problem = _problem(train, card)
    base = problem.fit(problem.mount, 75)
    late = torque_late(problem, base) if are_even((*train, *heldout)) else 0.0
    if late and late * torque_late(there := _problem(heldout, card), there.fit(base.mount, 15)) <= 0:
        late = 0.0
    if late:
        problem = _problem([moved(one, late) for one in train], card)
        base = problem.fit(problem.mount, 75)
    return *with_held(problem, base), late


def _refused(refitted: Card, withheld: Diagnosis) -> Outcome:
    return Outcome(withheld, refitted, refitted, refitted, refitted)  # nothing is named


def _with_search(described: Diagnosis, answer: Answer, examined: Examined, heldout: Sequence[Recording]) -> Diagnosis:
    """Add what the search says of itself: its global test, and the held-out error of what training alone proposed.

    Of the effects that training proposed held-out recordings chose some: the range of what these gain knows that.
    """
    held, many = described.heldout, 2 ** len(examined.effects)
    interval = of_the_best(held.confidence_interval, held.before_rms - held.after_rms, many)
    band, whole = band_of(held), answer.proof.chosen
    unvetoed = heldout_rms(heldout, examined.chosen.mount, band)
    possible = None if whole is answer.chosen else heldout_rms(heldout, whole.mount, band)
    tested = global_test(answer.comparison, examined.base)
    held = replace(held, unvetoed_rms=unvetoed, possible_rms=possible, confidence_interval=interval)
    notes = (*described.data_quality, *examined.ended)
    return replace(described, global_test=tested, heldout=held, data_quality=notes)


def _problem(train: Sequence[Recording], card: Card) -> Problem:
    mount = card.plant()
    prepared = in_band(train, mount)
    slowest = max(recording.sample_time for recording in train)
    return Problem(mount, prepared, weights(mount.friction, prepared), slowest)


def _answer(comparison: Comparison, examined: Examined, heldout: Sequence[Recording]) -> Answer:
    prepared = prepare(heldout, comparison.problem.prepared.band)
    held = Predictive.of(comparison, prepared, examined.base, prepare(heldout, PROTOCOL_HZ))
    examined, proof = prove_sets(comparison, examined, held)
    found = nameless(comparison, examined, proof, held)
    changed = changes((comparison.problem.prepared, prepared), found.proof.chosen.mount)
    return Answer(comparison, examined.base, held, found, changed, scores_of(comparison, found, held, bool(changed)))


def _described(answer: Answer, train: Sequence[Recording], heldout: Sequence[Recording], card: Card) -> Diagnosis:
    problem, decision = answer.comparison.problem, answer.decision
    seen = measured(problem, answer.models(), train, heldout)
    found = _findings(answer, seen.traces)
    policy = answer.comparison.policy
    left = beyond_any_machine(answer.scores.rest, policy)
    rest = (*rest_rules(answer.scores.effects, left, policy), *shaking_rules(left, policy))
    enter_answer(answer.comparison, answer.proof.chosen, found, answer.scores.improves, rest, decision.is_unknown)
    return replace(
        seen,
        verdict=_verdict(found, decision),
        findings=tuple(found),
        heldout=replace(seen.heldout, black_box_rms=black_box_rms(seen.traces)),
        sanity=answer.changed,
        mount=card.mount.name,
        delivered=tuple(
            dict.fromkeys(effect.name for effect in answer.chosen.mount.effects[len(problem.mount.effects) :])
        ),
        ambiguous_with=tuple((name, *members) for name, members in decision.sets.items() if members),
        depends_on=decision.depends_on,
        broadband=_shaken(answer),
        data_quality=(*card.remarks(), *seen.data_quality),
        friction_law=proposed_law(problem, answer.chosen),
        loop_bias=loop_bias(problem.prepared, answer.chosen, problem.weight),
        ledger=finished(answer.comparison, answer.held, answer.proof.chosen),
        scores=answer.scores,
    )


def _shaken(answer: Answer) -> BroadbandEntry:
    """What shakes the machine all the time, if it is above its limit."""
    comparison, chosen = answer.comparison, answer.proof.chosen
    if not answer.scores.rest.shaken > comparison.policy.slight:
        return {}
    found, motion = shaken_everywhere(comparison, chosen, answer.held), comparison.problem.mount.motion
    return broadband_entry(found, answer.held.residual(chosen.mount), friction_level(comparison), motion)


def _with_learned(
    named: Diagnosis, answer: Answer, tried: Learned | None, train: Sequence[Recording], heldout: Sequence[Recording]
) -> Diagnosis:
    """Let what describes the delivered model hold a learned term that helps; names and answers stay as they are."""
    if not (tried and tried.helps):
        refused = tried.refused() if tried else NOTHING_TRIED
        return replace(named, not_learned=refused) if answer.decision.is_unknown else named
    seen = measured(answer.comparison.problem, answer.models(tried.mount), train, heldout)
    return replace(
        named,
        learned=tried.as_json(),
        heldout=replace(seen.heldout, black_box_rms=named.heldout.black_box_rms),
        traces=seen.traces,
        parts=seen.parts,
        regions_after=seen.regions_after,
        base_parameters=seen.base_parameters,
    )


def _delivered(answer: Answer, heldout: Sequence[Recording], with_possible: bool) -> tuple[Answer, Learned | None]:
    """The answer with what it delivers, and what is learned as well; never worse held out than the base."""
    answer, tried = _learned(answer, heldout)
    names = detected(answer.comparison, answer.proof, answer.decision) | likelier(answer.decision)
    fit = structure_with(answer.comparison, answer.proof, names)
    if _is_worse(answer, fit, heldout):
        answer, fit = replace(answer, scores=replace(answer.scores, improves=False)), answer.base
    if with_possible:
        every = structure_with(answer.comparison, answer.proof, {one.effect.name for one in answer.proof.standing})
        fit = fit if _is_worse(answer, every, heldout) else every
    whole = replace(answer, detected=detected(answer.comparison, answer.proof, answer.decision), delivered=fit)
    return (whole, tried) if fit is answer.proof.chosen else (whole, _learned(whole, heldout)[1])


def _is_worse(answer: Answer, fit: Fit, heldout: Sequence[Recording]) -> bool:
    """Whether a structure leaves more of the held-out recordings than the refitted base."""
    base, band = answer.base.mount, answer.comparison.problem.prepared.band
    judged = judged_band(heldout, Structures(base, base, fit.mount), band)
    return rms(inside(judged, fit.mount)) > rms(inside(judged, base))


def _learned(answer: Answer, heldout: Sequence[Recording]) -> tuple[Answer, Learned | None]:
    """What is learned for what has no name, its errors in the band of the headline's; surely learned, it is unknown."""
    tried, problem = learn(answer.comparison, answer.chosen, answer.held.as_delivered()), answer.comparison.problem
    if not tried:
        return answer, None
    models = answer.models(tried.mount if tried.helps else answer.chosen.mount)
    told = tried.judged_in(judged_band(heldout, models, problem.prepared.band), answer.chosen.mount)
    answer = replace(answer, scores=replace(answer.scores, learned=told.scores()))
    return answer, told if answer.decision.is_unknown else None


def _experiment(answer: Answer) -> Experiment | None:
    for one in answer.proof.standing:
        for rival in one.rivals:
            if rival.effect.name in answer.decision.sets[one.effect.name] and not is_renamed(rival.effect):
                pair = one.effect.name, rival.effect.name
                return best(one.own.fit.mount, rival.fit.mount, pair, answer.comparison.problem.prepared)
    return None


def _findings(answer: Answer, signals: Sequence[Trace]) -> list[Finding]:
    comparison, decision, mount = answer.comparison, answer.decision, answer.proof.chosen.mount
    blocks, weight = Blocks.of(comparison.problem.prepared), comparison.problem.weight
    fits = [answer.chosen, answer.proof.chosen]
    errors = [standard_errors(fit, blocks, weight) for fit in fits]
    found, rivals = [], []
    for one in standing(comparison, answer.proof):
        name = one.effect.name
        shares, members, predicted = decision.probabilities[name], decision.sets[name], answer.proof.predicted[name]
        which = 0 if any(effect.name == name for effect in fits[0].mount.effects) else 1
        own = fits[which].mount, errors[which], signals
        row = accepted(one, *own, members, shares[name], predicted, name in answer.detected)
        remark = hypothesis_of(one.effect).remark(one.effect, comparison.problem.prepared)
        found.append(replace(row, statement=f"{row.statement} {remark}".rstrip()))
        open_ = [rival_finding(r, shares[r.effect.name], mount) for r in one.rivals if r.effect.name in members]
        rivals += [measured_as(row, found[-1], mount) for row in open_]
    named = {finding.name for finding in found}
    likeliest = {finding.name: finding for finding in sorted(rivals, key=lambda one: one.probability)}
    rivals = [one for one in rivals if one.name not in named and one is likeliest[one.name]]
    known = named | {finding.name for finding in rivals}
    unproven = [fit for one in answer.proof.unproven for fit in by_each_name(one.own, known)]
    lost = [replace(rival_finding(fit, 0.0, mount), answer="not_proven") for fit in unproven]
    taken = [(fit, term) for one, term in answer.found.taken for fit in by_each_name(one.own, known)]
    lost += [taken_finding(fit, term.name, mount) for fit, term in taken]
    named = {finding.effect for finding in (*found, *rivals, *lost)}
    largest = max((one.own.evidence for one in answer.proof.standing), default=0.0)
    absent = not_found(comparison, answer.proof.chosen, sorted(named), largest)
    absent = [undecided(one, answer.proof.standing, comparison.policy) for one in absent]
    return [*found, *rivals, *lost, *absent]


def _verdict(found: Sequence[Finding], decision: Decision) -> tuple[str, ...]:
    named = [f for f in found if f.answer in ("found", "ambiguous") and f.where is not None]
    sure = [f.effect for f in named if f.name not in decision.doubtful]
    doubtful = [f.effect for f in named if f.name in decision.doubtful]
    return tuple(dict.fromkeys((*sure, *(("unknown",) if decision.is_unknown else ()), *doubtful)))


def _improved(card: Card, mount: Mount) -> Card:
    """Write the fitted numbers and the added effects into a card; a known load stays in its own section."""
    load = mount.effects[0] if card.unbalance and type(mount.effects[0]) is GravityUnbalance else None
    effects = [at_own_level(effect, mount) for effect in (mount.effects[1:] if load else mount.effects)]
    section = card.mount.model_copy(update={"inertia": float(mount.axis.inertia)})
    return replace(card, mount=section, friction=mount.friction, unbalance=load, effects=tuple(effects))
