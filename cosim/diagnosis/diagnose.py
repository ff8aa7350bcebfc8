"""The whole way: recordings and a card in, a diagnosis and a better card out."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.diagnosis.adequacy import Rest, rest_of, rest_there
from cosim.diagnosis.challenge import Place, Verdict, challenge, merged
from cosim.diagnosis.claim import weights
from cosim.diagnosis.evidence import Blocks
from cosim.diagnosis.experiment import Experiment, best, told
from cosim.diagnosis.findings import accepted, not_found, rival_finding, standard_errors
from cosim.diagnosis.fit import Fit
from cosim.diagnosis.laws import proposed_law
from cosim.diagnosis.locate import regions
from cosim.diagnosis.loop_bias import loop_bias
from cosim.diagnosis.prepare import Array, Prepared, choose_cutoff, prepare, quality
from cosim.diagnosis.problem import Problem
from cosim.diagnosis.protocol import Structures, heldout_rms, is_misleading, is_proven, judge, traces, veto_band
from cosim.diagnosis.regression import black_box_rms
from cosim.diagnosis.result import Diagnosis, Finding, HeldOut, Trace, is_special
from cosim.diagnosis.sanity import check_effects, check_recordings
from cosim.diagnosis.select import select
from cosim.recording import Recording
from pyfmi_models.card import Card
from pyfmi_models.effects import Effect, GravityUnbalance
from pyfmi_models.mount import Mount

LARGER = 0.5
"""Share of what is missing: if more is left, and follows a quantity from recording to recording, the effects beside it
may be imitations of that, and are not believed."""
Say = Callable[[str], None]


@dataclass(frozen=True)
class Outcome:
    """A diagnosis, and three cards: the model it ends with, what training alone proposes, the base refitted."""

    diagnosis: Diagnosis
    card: Card
    proposed: Card
    refitted: Card
    experiment: Experiment | None = None


@dataclass(frozen=True)
class Stands:
    """What stands after the proof, what was proposed and does not, and what is left."""

    verdict: Verdict
    unproven: tuple[Place, ...]
    rest: Rest


def diagnose(
    train: Sequence[Recording],
    heldout: Sequence[Recording],
    card: Card,
    say: Say = lambda _: None,
    stood: Callable[[str, Mount], None] = lambda *_: None,
) -> Outcome:
    """Find what physics a card lacks.

    Args:
        train: recordings that may be fitted.
        heldout: recordings that nothing is fitted to. They prove the result, and they have a veto: an effect that
            does not lower their error is taken out as not proven. So their error after it is a little optimistic;
            `HeldOut.unvetoed_rms` is the error of what training alone proposed.
        card: the model as delivered.
        say: told, in a few words, what is being done.
        stood: told the refitted base ("before") and the model it ends with ("after") as soon as they stand, so that
            something can be done with them beside the rest.

    Raises:
        InputError: the card holds an effect that a diagnosis cannot take into account yet.
        RecordingError: the recordings cannot belong to this card (units), or are too short.
    """
    started = time.perf_counter()
    check_effects(card.plant())
    check_recordings(train, heldout, card.plant())
    problem = _problem(train, card)
    say("refitting the base")
    selection = select(problem, say)
    base = _improved(card, selection.base.mount)
    stood("before", base.plant())
    verdict = challenge(problem, selection, say)
    say("proving on the recording that was not fitted")
    proposed = verdict.chosen.mount
    stands = _surprised(problem, _believed(problem, *_proven(problem, verdict, heldout)), heldout)
    certain, first = (_improved(card, one) for one in (_certain(problem, stands.verdict), proposed))
    stood("after", certain.plant())
    experiment = _experiment(stands.verdict, problem.prepared)
    described = _described(problem, stands, train, heldout, card.mount.name)
    diagnosis = replace(
        described,
        heldout=replace(described.heldout, unvetoed_rms=heldout_rms(heldout, proposed)),
        next_experiment=told(experiment, card.controller is not None) if experiment else {},
        seconds=time.perf_counter() - started,
    )
    return Outcome(diagnosis, certain, first, base, experiment)


def _problem(train: Sequence[Recording], card: Card) -> Problem:
    mount, prepared = card.plant(), prepare(train, choose_cutoff(train, card.mount.inertia))
    return Problem(mount, prepared, _weight(mount, prepared), max(recording.sample_time for recording in train))


def _described(
    problem: Problem, stands: Stands, train: Sequence[Recording], heldout: Sequence[Recording], name: str
) -> Diagnosis:
    """What stands, measured on all recordings and put into words."""
    verdict, prepared, linear = stands.verdict, problem.prepared, problem.mount.motion == "linear"
    models = Structures(problem.mount, verdict.base.mount, verdict.chosen.mount)
    signals = traces(train, heldout, models)
    found = _findings(stands, prepared, problem.weight, signals)
    bias = loop_bias(prepared, verdict.chosen, problem.weight)
    return Diagnosis(
        verdict=_verdict(found, stands.rest),
        findings=tuple(found),
        heldout=replace(judge(heldout, models, prepared.cutoff), black_box_rms=black_box_rms(signals)),
        traces=signals,
        regions=regions(signals, False, linear),
        regions_after=regions(signals, True, linear),
        mount=name,
        motion=problem.mount.motion,
        ambiguous_with=tuple((p.effect.id, *p.ambiguous_with) for p in verdict.places if p.ambiguous_with),
        depends_on=stands.rest.depends_on,
        data_quality=tuple(note for recording in (*train, *heldout) for note in quality(recording, prepared.cutoff)),
        friction_law=proposed_law(problem, verdict.chosen),
        loop_bias=bias.as_json() if bias else {},
        base_parameters=_base_parameters(models),
    )


def _certain(problem: Problem, verdict: Verdict) -> Mount:
    """The structure without effects that have a rival which would predict otherwise: neither goes into a model."""
    open_keys = {_key(p.effect) for p in verdict.places if not is_special(p.effect.id, p.ambiguous_with)}
    mount = verdict.chosen.mount
    rest = tuple(effect for effect in mount.effects if _key(effect) not in open_keys)
    return mount if len(rest) == len(mount.effects) else problem.fit(replace(mount, effects=rest), 15).mount


def _experiment(verdict: Verdict, prepared: Prepared) -> Experiment | None:
    """What would settle the first open question."""
    for place in verdict.places:
        for rival in place.rivals:
            if rival.effect.id in place.ambiguous_with:
                return best(place.trial.fit.mount, rival.fit.mount, (place.effect.id, rival.effect.id), prepared)
    return None


def _weight(mount: Mount, prepared: Prepared) -> Array:
    """The rows that count, and how much; all where there is no friction that could hold at rest."""
    return np.ones(len(prepared.recording_of)) if mount.friction.key == "none" else weights(mount.friction, prepared)


def _proven(problem: Problem, verdict: Verdict, heldout: Sequence[Recording]) -> tuple[Verdict, tuple[Place, ...]]:
    """Take out effects that do not help on the held-out recording; return what stands, and those taken out.

    What is then still worse than the base there is taken out as a whole.
    """
    if not verdict.places:
        return verdict, ()
    chosen = verdict.chosen
    out: list[Place] = []
    band = veto_band(heldout, verdict.base.mount, problem.prepared.cutoff)
    for places in merged(verdict.places).values():
        gone = {_key(place.effect) for place in places}
        rest = tuple(effect for effect in chosen.mount.effects if _key(effect) not in gone)
        without = problem.fit(replace(chosen.mount, effects=rest), 10)
        if not is_proven(heldout, without.mount, chosen.mount, band):
            chosen, out = without, [*out, *places]
    if is_misleading(heldout, verdict.base.mount, chosen.mount, band):
        return replace(verdict, chosen=verdict.base, places=()), verdict.places
    if not out:
        return verdict, ()
    kept = [place for place in verdict.places if place not in out]
    renewed = tuple(replace(p, effect=_same(p, chosen)) for p in kept)
    return replace(verdict, chosen=chosen, places=renewed), tuple(out)


def _believed(problem: Problem, verdict: Verdict, unproven: tuple[Place, ...]) -> Stands:
    """Doubt the names beside a larger rest that follows a quantity."""
    rest = rest_of(verdict.chosen, problem.prepared, verdict.bench)
    if not rest.follows_something:
        return Stands(verdict, unproven, rest)
    whole = rest_of(verdict.base, problem.prepared, verdict.bench)
    if rest.share <= LARGER * whole.share:
        return Stands(verdict, unproven, rest)
    return Stands(replace(verdict, chosen=verdict.base, places=()), (*unproven, *verdict.places), whole)


def _surprised(problem: Problem, stands: Stands, heldout: Sequence[Recording]) -> Stands:
    """Where training leaves nothing large, ask the held-out recording."""
    prepared = problem.prepared
    if stands.rest.unexplained:
        return stands
    there = rest_there(stands.verdict.chosen, prepared, stands.verdict.bench, prepare(heldout, prepared.cutoff))
    return replace(stands, rest=there) if there.unexplained else stands


def _key(effect: Effect) -> tuple[str, float]:
    """What stays of an effect when it is fitted again: its kind, and its place in a spectrum."""
    return type(effect).__name__, getattr(effect, "cycles_per_rev", 0.0)


def _same(place: Place, chosen: Fit) -> Effect:
    alike = [effect for effect in chosen.mount.effects if _key(effect) == _key(place.effect)]
    hertz = getattr(place.effect, "frequency_hz", 0.0)
    return min(alike, key=lambda effect: abs(getattr(effect, "frequency_hz", 0.0) - hertz))


def _findings(stands: Stands, prepared: Prepared, weight: Array, signals: Sequence[Trace]) -> list[Finding]:
    verdict = stands.verdict
    errors = standard_errors(verdict.chosen, Blocks.of(prepared), weight)
    mount, found, rivals = verdict.chosen.mount, [], []
    for places in merged(verdict.places).values():
        main = max(places, key=lambda place: getattr(place.effect, "amplitude", 0.0))
        others = [place for place in places if place is not main]
        found.append(accepted(main, others, mount, errors, signals, proven=True))
        rivals += [rival_finding(r, main, mount) for r in main.rivals if r.effect.id in main.ambiguous_with]
    found.sort(key=lambda finding: -finding.gain)
    named = {finding.effect for finding in found}
    rivals = [finding for finding in rivals if finding.effect not in named]
    lost = [
        replace(rival_finding(p.trial, p, mount), answer="not_proven", probability=1 - p.probability)
        for p in stands.unproven
    ]
    lost = [finding for finding in lost if finding.effect not in named]
    named |= {finding.effect for finding in (*rivals, *lost)}
    return [*found, *rivals, *lost, *not_found(verdict.chosen, prepared, weight, verdict.looked_at, sorted(named))]


def _verdict(found: Sequence[Finding], rest: Rest) -> tuple[str, ...]:
    named = tuple(f.effect for f in found if f.answer in ("found", "ambiguous") and f.where is not None)
    return (*named, *(("unknown",) if rest.unexplained else ()))


def _base_parameters(models: Structures) -> dict[str, tuple[float, float, float]]:
    tables = [{v.name: v.start for v in m.parameters()} for m in (models.nominal, models.before, models.after)]
    names = [name for name in tables[0] if name.startswith(("axis.", "friction.")) and name in tables[2]]
    kept = [name for name in names if not name.endswith(("torque_limit", "smoothing"))]
    return {name: (tables[0][name], tables[1][name], tables[2][name]) for name in kept}


def _improved(card: Card, mount: Mount) -> Card:
    """Write the fitted numbers and the added effects into a card; a known load stays in its own section."""
    load = mount.effects[0] if card.unbalance and isinstance(mount.effects[0], GravityUnbalance) else None
    effects = mount.effects[1:] if load else mount.effects
    section = card.mount.model_copy(update={"inertia": float(mount.axis.inertia)})
    return replace(card, mount=section, friction=mount.friction, unbalance=load, effects=tuple(effects))


__all__ = ["HeldOut", "Outcome", "diagnose"]
