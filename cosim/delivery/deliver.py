"""Write what a diagnosis found: JSON, missing torque, the better card, the better FMU, the report.

Files are written one by one, each complete or absent; the report comes last and names the others.
"""

import itertools
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from cosim.data.recording import Recording
from cosim.diagnosis.answer.entries import CardSource, Improved, Provenance, Source
from cosim.diagnosis.answer.names import id_of
from cosim.diagnosis.answer.result import Array, Diagnosis, Finding, HeldOut, Trace
from cosim.diagnosis.diagnose import Outcome
from cosim.diagnosis.effects import named
from cosim.diagnosis.measure.experiment import SCENARIO, scenario
from cosim.diagnosis.measure.findings import broadband_finding
from cosim.estimation.neighbours import as_inputs
from cosim.estimation.prepare import PROTOCOL_HZ
from cosim.fmi.domain import KEY, Domain, entries_of
from cosim.support.files import check_free, directory, replacing, sha256
from cosim.support.plain import JsonObject
from cosim.support.version import __version__
from pyfmi_models.card import Card
from pyfmi_models.card_writer import card_text

if TYPE_CHECKING:
    import pyarrow as pa

    from cosim.delivery.closed_loop import Loops

DOCUMENT, CARD = "diagnosis.json", "card.toml"
MISSING, REPORT = "missing_torque.parquet", "report.html"
QUICK = (DOCUMENT, CARD)
"""Files of a diagnosis without FMU, closed loop and report."""
FILES = (*QUICK, MISSING, REPORT, SCENARIO)


def check_out(out: Path, force: bool, names: Sequence[str] = FILES) -> None:
    """Refuse, before any work is done, an output folder that holds a diagnosis already (raises OutputError)."""
    for name in names:
        check_free(out / name, force)


def deliver_quickly(
    outcome: Outcome,
    train: Sequence[Recording],
    heldout: Sequence[Recording],
    card: Card,
    out: Path,
    command: str,
    base: str = "",
) -> Diagnosis:
    """Write the answer and the better card alone, and return the answer as it was written; see `deliver`."""
    directory(out)
    found, better = _signed(outcome, train, heldout, card, command, base)
    _write_card(better, found, out)
    improved = Improved(card=CARD) | _proven_range(found) if found.adds_physics else Improved()
    found = replace(without_files(found), improved=improved, files=(DOCUMENT,))
    _write_json(found, out)
    return found


def without_files(found: Diagnosis) -> Diagnosis:
    """The same answer, naming no file: neither a report nor the scenario of the next experiment."""
    plan = found.next_experiment.copy()
    plan.pop("scenario", None)
    return replace(found, next_experiment=plan, files=())


def deliver(
    outcome: Outcome,
    train: Sequence[Recording],
    heldout: Sequence[Recording],
    card: Card,
    out: Path,
    command: str,
    loops: "Loops",
    on_progress: Callable[[str], None] = lambda _: None,
    more: Callable[[Card, Path], Improved] = lambda *_: Improved(),
    base: str = "",
) -> Diagnosis:
    """Write all files of a diagnosis into `out` and return it with provenance and file names filled in.

    Where effects were found, `more` writes what else shall lie beside the better card, and tells it. `base` names the
    FMU in whose place the card stands, if it does. `loops` are the card's on the held-out recordings; some may have
    begun already.
    """
    directory(out)
    loops.close("nominal", card.plant())
    loops.close("before", outcome.refitted.plant())
    found, better = _signed(outcome, train, heldout, card, command, base)
    _write_card(better, found, out)
    if found.adds_physics:
        on_progress("building the improved FMU")
        improved = Improved(card=CARD) | _fmus(better, found, heldout[0], out) | _proven_range(found)
        found = replace(found, improved=improved | more(better, out))
    loops.close("after", outcome.card.plant(), out / found.improved["fmu"] if "fmu" in found.improved else None)
    if outcome.experiment and better.controller:
        with replacing(out / SCENARIO, True) as partial:
            partial.write_text(scenario(outcome.experiment, better), "utf-8")
    write_missing_torque(found.traces, [*train, *heldout], out / MISSING)
    from cosim.report import write_report  # takes a second, in which the loops go on

    on_progress("closing the loop")
    positions = {key: error.position for key, error in loops.errors().items()}
    found = replace(found, heldout=replace(found.heldout, position=positions))
    _write_json(found, out)
    on_progress("writing the report")
    write_report(found, out / REPORT)
    return found


def _signed(
    outcome: Outcome, train: Sequence[Recording], heldout: Sequence[Recording], card: Card, command: str, base: str
) -> tuple[Diagnosis, Card]:
    """The diagnosis with its provenance, and the better card with its origin."""
    provenance = _provenance(train, heldout, card, command) | (Provenance(base_fmu=base) if base else Provenance())
    found = replace(outcome.diagnosis, provenance=provenance)
    return found, replace(outcome.card, origin=_origin(found, provenance))


def _write_card(better: Card, found: Diagnosis, out: Path) -> None:
    with replacing(out / CARD, True) as partial:
        partial.write_text(card_text(better, _comment(found)), "utf-8")


def _write_json(found: Diagnosis, out: Path) -> None:
    with replacing(out / DOCUMENT, True) as partial:
        partial.write_text(json.dumps(as_json(found), indent=2, allow_nan=False) + "\n", "utf-8")


def as_json(found: Diagnosis) -> JsonObject:
    """Return the diagnosis as the JSON object that `schema.json` beside this file describes."""
    held = found.heldout
    whole = {
        "verdict": list(found.verdict),
        "effects": _effects(found),
        "friction_law": found.friction_law,
        "delivered": list(dict.fromkeys(map(id_of, found.delivered))),
        "ambiguous_with": [list(map(id_of, group)) for group in found.ambiguous_with],
        "next_experiment": found.next_experiment,
        "heldout": _heldout(held),
        "intervals": {trace.name: [list(span) for span in trace.intervals] for trace in found.traces},
        "depends_on": list(found.depends_on),
        "broadband_disturbance": found.broadband,
        "learned": found.learned,
        "not_learned": found.not_learned,
        "data_quality": list(found.data_quality),
        "sanity": [one.as_json() for one in found.sanity],
        "global_test": found.global_test,
        "policy": found.policy,
        "loop_bias": found.loop_bias,
        "base_parameters": {name: list(values) for name, values in found.base_parameters.items()},
        "not_determined": {one.variable.name: one.as_json() for one in found.not_determined},
        "ledger": [trial.as_json() for trial in found.ledger],
        "scores": found.scores.as_json() if found.scores else {},
        "improved": found.improved,
        "provenance": found.provenance,
        "seconds": found.seconds,
        "version": __version__,
    }
    return cast(JsonObject, whole)


def _effects(found: Diagnosis) -> list[JsonObject]:
    """One entry for each id, in their order; further couplings, with other neighbours, are in that of the first."""
    shaken = (broadband_finding(found.broadband, found.motion),) if found.broadband else ()
    groups: dict[str, list[Finding]] = {}
    for one in (*found.findings, *shaken):
        groups.setdefault(one.effect, []).append(one)
    return [
        _effect(first) | ({"further": [_effect(one) for one in others]} if others else {})
        for first, *others in groups.values()
    ]


def _effect(finding: Finding) -> JsonObject:
    place = finding.where
    return {
        "effect": finding.effect,
        **({"neighbour": finding.source} if ":" in finding.name else {}),
        "answer": finding.answer,
        "probability": finding.probability,
        "gain": finding.gain,
        "visible_from": finding.visible_from,
        "bound": _bound(finding),
        "ruled_out": list(finding.ruled_out),
        "rival": finding.rival,
        "less_likely": list(finding.less_likely),
        "action": finding.action,
        "parameters": {**finding.parameters, **({"harmonics": [*finding.harmonics]} if finding.harmonics else {})},
        "standard_errors": finding.standard_errors,
        "ranges": {name: list(ends) for name, ends in finding.ranges.items()},
        "units": finding.units,
        "statement": finding.statement,
        "told_apart_by": finding.told_apart_by,
        "evidence": finding.evidence,
        "where": {
            "axis": place.axis,
            "description": place.description,
            "regions": [list(region) for region in place.regions],
        }
        if place
        else None,
    }


def _bound(finding: Finding) -> JsonObject:
    """How large an effect may be that was not seen, or why that is not said."""
    one = finding.bound
    if one is None:
        return {"value": None, "reason": "the answer is its size" if finding.parameters else finding.evidence}
    return {
        "value": one.value,
        "unit": one.unit,
        "band_hz": list(one.band_hz),
        "range": {name: list(ends) for name, ends in one.range.items()},
        "power": one.power,
        **({"reason": one.reason} if one.reason else {}),
    }


def _heldout(held: HeldOut) -> JsonObject:
    names = ("name", "nominal_rms", "before_rms", "after_rms", "floor_rms", "cutoff_hz", "motion_hz", "unvetoed_rms")
    return {name: getattr(held, name) for name in (*names, "possible_rms")} | {
        "confidence_interval": list(held.confidence_interval),
        "clear_motion": held.sliding,
        "black_box_rms": held.black_box_rms,
        "position": held.position,
    }


def _provenance(train: Sequence[Recording], heldout: Sequence[Recording], card: Card, command: str) -> Provenance:
    recordings = [
        Source(name=one.name, sha256=one.sha256, role=role, seconds=one.duration, rate_hz=1 / one.sample_time)
        for role, group in (("train", train), ("heldout", heldout))
        for one in group
    ]
    date = datetime.now(UTC).strftime("%Y-%m-%d %H:%M")
    return Provenance(version=__version__, command=command, date=date, recordings=recordings, card=_source_of(card))


def _source_of(card: Card) -> CardSource:
    path = Path(card.path)
    named = CardSource(name=path.name, path=card.path)
    if card.mount.machine:
        named["machine"] = card.mount.machine
    return named | CardSource(sha256=sha256(path)) if path.is_file() else named


def _origin(found: Diagnosis, provenance: Provenance) -> JsonObject:
    held = found.heldout
    proven: JsonObject = {KEY: entries_of(_domains(found))} if found.adds_physics else {}
    return {
        "version": provenance["version"],
        "date": provenance["date"],
        "card": provenance["card"]["name"],
        "recordings": [{"name": r["name"], "sha256": r["sha256"], "role": r["role"]} for r in provenance["recordings"]],
        "evidence": f"held-out RMS {held.before_rms:.4g} refitted, {held.after_rms:.4g} with the effects named here",
        **proven,
    }


def _comment(found: Diagnosis) -> str:
    if any(one.blocks_naming for one in found.sanity):
        return "The base with its parameters refitted to recordings that are in doubt; settle that first."
    if not found.adds_physics:
        return "The base with its parameters refitted; no physics was added."
    learned = [f"something learned {span}" for span in found.learned.get("range", ())]
    titles = ", ".join([*(finding.title.lower() for finding in found.in_model), *learned])
    said = f"Improved by a diagnosis: {titles}.\nThe base is refitted; [origin] names the recordings that justify it."
    notes = [hypothesis.card_note(found.traces[0].name) for hypothesis in (named(one.effect) for one in found.in_model)]
    return "\n".join([said, *chosen_of_sets(found), *filter(None, notes)])


def chosen_of_sets(found: Diagnosis) -> Iterator[str]:
    """Say of each open question which of the possible causes the model holds."""
    titles = {finding.name: finding.title.lower() for finding in found.findings}
    for finding in found.in_model:
        group = next((group for group in found.ambiguous_with if finding.name in group), ())
        others = " or ".join(titles.get(name, name) for name in group if name != finding.name)
        if finding.answer == "ambiguous" and others:
            yield f"These recordings cannot tell {titles[finding.name]} from {others}; the likelier is in the model."
        elif finding.answer == "ambiguous":
            yield f"That it is {titles[finding.name]} is not certain."


def _proven_range(found: Diagnosis) -> Improved:
    held = [trace for trace in found.traces if trace.heldout]
    q, v = (np.concatenate([getattr(trace, name) for trace in held]) for name in ("q", "v"))
    return Improved(speed=[float(v.min()), float(v.max())], position=[float(q.min()), float(q.max())])


def _fmus(card: Card, found: Diagnosis, heldout: Recording, out: Path) -> Improved:
    from cosim.delivery.experiment import of_recording, with_experiment  # the master: `--quick` runs nothing
    from cosim.models.carried import related_of
    from pyfmi_models.export import export_fmu

    span, unit = _proven_range(found)["speed"], "m/s" if found.motion == "linear" else "rad/s"
    model = card.plant().model()
    proven = f"{model.description}; proven on a held-out recording for speeds {span[0]:.3g} to {span[1]:.3g} {unit}"
    model = replace(model, description=proven, name=f"{card.plant().name}_improved")
    fed = as_inputs(heldout, card.plant(), PROTOCOL_HZ)
    stimulus, origin = of_recording(fed, model), related_of(card, model.name)
    three, two = out / f"{model.name}.fmu", out / f"{model.name}_fmi2.fmu"
    with_experiment(lambda related: export_fmu(model, three, fmi=3, force=True, related=(*origin, *related)), stimulus)
    with_experiment(lambda related: export_fmu(model, two, fmi=2, force=True, related=(*origin, *related)), stimulus)
    return Improved(fmu=f"{model.name}.fmu", fmu_fmi2=f"{model.name}_fmi2.fmu")


def _domains(found: Diagnosis) -> tuple[Domain, Domain]:
    """Where the improved model is proven; q and v are what its FMU calls position and speed."""
    position, speed = ("m", "m/s") if found.motion == "linear" else ("rad", "rad/s")
    (slow, fast), (left, right) = _proven_range(found)["speed"], _proven_range(found)["position"]
    return Domain("speed", slow, fast, speed, "v"), Domain("position", left, right, position, "q")


ROWS = 2**19
"""Rows that are made and written at a time."""
HOLE = 1.5
"""A step of a trace longer than this many of its usual steps is a hole: nothing was judged inside."""


def write_missing_torque(traces: Sequence[Trace], recordings: Sequence[Recording], path: Path) -> None:
    """Write for each row what the refitted base leaves, its 95 % band, and what the effects leave, in N m (N).

    Values are null where the diagnosis says nothing: where filters settle at the ends of a recording, inside gaps and
    beside them, at readings that were left out.
    """
    from pyarrow import parquet

    tables = (one for both in zip(traces, recordings, strict=True) for one in _tables(*both))
    first = next(tables)
    with replacing(path, True) as partial, parquet.ParquetWriter(partial, first.schema) as file:
        for one in itertools.chain([first], tables):
            file.write_table(one)


def _tables(trace: Trace, recording: Recording) -> Iterator["pa.Table"]:
    """The rows of a recording, some at a time: all columns together are as large as the recording itself."""
    import pyarrow as pa

    signals = {"missing_torque": trace.missing, "band": trace.band, "after": trace.tau - trace.after}
    for first in range(0, len(recording), ROWS):
        t = recording.t[first : first + ROWS]
        silent, names = ~covered(trace.t, t), pa.array([recording.name]).take(pa.array(np.zeros(len(t), int)))
        columns = {n: pa.array(np.interp(t, trace.t, signal), mask=silent) for n, signal in signals.items()}
        yield pa.table({"recording": names, "t": t, **columns})


def covered(known: Array, wanted: Array) -> np.ndarray:
    """Which wanted times lie between two neighbouring known times, (rows,) of bool."""
    steps = np.diff(known)
    whole = np.concatenate([[False], steps <= HOLE * float(np.median(steps)), [False]])
    after = np.searchsorted(known, wanted, "right")
    return np.asarray(whole[after] | (known[after - 1] == wanted))
