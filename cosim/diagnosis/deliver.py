"""Write what a diagnosis found: JSON, missing torque, the better card, the better FMU, the report.

Files are written one by one, each complete or absent; the report comes last and names the others.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

import cosim
from cosim.diagnosis.closed_loop import Loops
from cosim.diagnosis.diagnose import Outcome
from cosim.diagnosis.experiment import SCENARIO, scenario
from cosim.diagnosis.result import Diagnosis, Finding, HeldOut
from cosim.files import check_free, directory, replacing
from cosim.recording import Recording
from pyfmi_models.card import Card
from pyfmi_models.card_writer import card_text
from pyfmi_models.export import export_fmu

FILES = ("diagnosis.json", "missing_torque.parquet", "card.toml", "report.html", SCENARIO)


def check_out(out: Path, force: bool) -> None:
    """Refuse, before any work is done, an output folder that holds a diagnosis already (raises OutputError)."""
    for name in FILES:
        check_free(out / name, force)


def deliver(
    outcome: Outcome,
    train: Sequence[Recording],
    heldout: Sequence[Recording],
    card: Card,
    out: Path,
    command: str,
    say: Callable[[str], None] = lambda _: None,
    more: Callable[[Card, Path], dict[str, Any]] = lambda *_: {},
    base: str = "",
    loops: Loops | None = None,
) -> Diagnosis:
    """Write all files of a diagnosis into `out` and return it with provenance and file names filled in.

    Where effects were found, `more` writes what else shall lie beside the better card, and tells it. `base` names the
    FMU in whose place the card stands, if it does. `loops` are the card's on the held-out recordings, where some were
    begun already.
    """
    if loops is None:
        with Loops(card, heldout) as own:
            return deliver(outcome, train, heldout, card, out, command, say, more, base, own)
    directory(out)
    loops.close("nominal", card.plant())
    loops.close("before", outcome.refitted.plant())
    provenance = _provenance(train, heldout, card, command) | ({"base_fmu": base} if base else {})
    found = replace(outcome.diagnosis, provenance=provenance)
    better = replace(outcome.card, origin=_origin(found, provenance))
    with replacing(out / "card.toml", True) as partial:
        partial.write_text(card_text(better, _comment(found)), "utf-8")
    if _names_effects(found):
        say("building the improved FMU")
        improved = {"card": "card.toml", **_fmus(better, found, out), **_proven_range(found), **more(better, out)}
        found = replace(found, improved=improved)
    loops.close("after", outcome.card.plant(), out / found.improved["fmu"] if "fmu" in found.improved else None)
    if outcome.experiment and better.controller:
        with replacing(out / SCENARIO, True) as partial:
            partial.write_text(scenario(outcome.experiment, better), "utf-8")
    _missing_torque(found, [*train, *heldout], out / "missing_torque.parquet")
    from cosim.diagnosis.report import write_report  # takes a second, in which the loops go on

    say("closing the loop")
    positions = {key: error.position for key, error in loops.errors().items()}
    found = replace(found, heldout=replace(found.heldout, position=positions))
    with replacing(out / "diagnosis.json", True) as partial:
        partial.write_text(json.dumps(as_json(found), indent=2, allow_nan=False) + "\n", "utf-8")
    say("writing the report")
    write_report(found, out / "report.html")
    return found


def as_json(found: Diagnosis) -> dict[str, Any]:
    """Return the diagnosis as the JSON object that `schema.json` beside this file describes."""
    held = found.heldout
    return {
        "verdict": list(found.verdict),
        "effects": [_effect(finding) for finding in found.findings],
        "friction_law": found.friction_law,
        "ambiguous_with": [list(group) for group in found.ambiguous_with],
        "next_experiment": found.next_experiment,
        "heldout": _heldout(held),
        "intervals": {trace.name: [list(span) for span in trace.intervals] for trace in found.traces},
        "depends_on": list(found.depends_on),
        "data_quality": list(found.data_quality),
        "loop_bias": found.loop_bias,
        "base_parameters": {name: list(values) for name, values in found.base_parameters.items()},
        "improved": found.improved,
        "provenance": found.provenance,
        "seconds": found.seconds,
        "version": cosim.__version__,
    }


def _effect(finding: Finding) -> dict[str, Any]:
    place = finding.where
    return {
        "effect": finding.effect,
        "answer": finding.answer,
        "probability": finding.probability,
        "gain": finding.gain,
        "visible_from": finding.visible_from,
        "ruled_out": list(finding.ruled_out),
        "action": finding.action,
        "parameters": finding.parameters,
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


def _heldout(held: HeldOut) -> dict[str, Any]:
    return {
        "name": held.name,
        "nominal_rms": held.nominal_rms,
        "before_rms": held.before_rms,
        "after_rms": held.after_rms,
        "floor_rms": held.floor_rms,
        "unvetoed_rms": held.unvetoed_rms,
        "confidence_interval": list(held.confidence_interval),
        "clear_motion": held.sliding,
        "black_box_rms": held.black_box_rms,
        "position": held.position,
    }


def _names_effects(found: Diagnosis) -> bool:
    return any(finding.answer == "found" for finding in found.findings)


def _provenance(train: Sequence[Recording], heldout: Sequence[Recording], card: Card, command: str) -> dict[str, Any]:
    recordings = [
        {
            "name": one.name,
            "sha256": one.sha256,
            "role": role,
            "seconds": one.duration,
            "rate_hz": 1 / one.sample_time,
        }
        for role, group in (("train", train), ("heldout", heldout))
        for one in group
    ]
    date = datetime.now(UTC).strftime("%Y-%m-%d %H:%M")
    described = {"name": Path(card.path).name, "path": card.path}
    return {
        "version": cosim.__version__,
        "command": command,
        "date": date,
        "recordings": recordings,
        "card": described,
    }


def _origin(found: Diagnosis, provenance: dict[str, Any]) -> dict[str, Any]:
    held = found.heldout
    return {
        "version": provenance["version"],
        "date": provenance["date"],
        "card": provenance["card"]["name"],
        "recordings": [{"name": r["name"], "sha256": r["sha256"], "role": r["role"]} for r in provenance["recordings"]],
        "evidence": f"held-out RMS {held.before_rms:.4g} refitted, {held.after_rms:.4g} with the effects named here",
    }


def _comment(found: Diagnosis) -> str:
    if not _names_effects(found):
        return "The base with its parameters refitted; no physics was added."
    named = ", ".join(finding.title.lower() for finding in found.findings if finding.answer == "found")
    said = f"Improved by a diagnosis: {named}.\nThe base is refitted; [origin] names the recordings that justify it."
    shaken = any(finding.effect == "periodic_disturbance" for finding in found.findings if finding.answer == "found")
    return said + (f"\nThe phase of the periodic disturbance is that of {found.traces[0].name}." if shaken else "")


def _proven_range(found: Diagnosis) -> dict[str, Any]:
    held = [trace for trace in found.traces if trace.heldout]
    q, v = (np.concatenate([getattr(trace, name) for trace in held]) for name in ("q", "v"))
    return {"speed": [float(v.min()), float(v.max())], "position": [float(q.min()), float(q.max())]}


def _fmus(card: Card, found: Diagnosis, out: Path) -> dict[str, str]:
    span, unit = _proven_range(found)["speed"], "m/s" if found.motion == "linear" else "rad/s"
    model = card.plant().model()
    proven = f"{model.description}; proven on a held-out recording for speeds {span[0]:.3g} to {span[1]:.3g} {unit}"
    model = replace(model, description=proven, name=f"{card.plant().name}_improved")
    export_fmu(model, out / f"{model.name}.fmu", fmi=3, force=True)
    export_fmu(model, out / f"{model.name}_fmi2.fmu", fmi=2, force=True)
    return {"fmu": f"{model.name}.fmu", "fmu_fmi2": f"{model.name}_fmi2.fmu"}


def _missing_torque(found: Diagnosis, recordings: Sequence[Recording], path: Path) -> None:
    """For each row of each recording: what the refitted base leaves, its 95 % band, what the effects leave."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    parts = []
    for trace, recording in zip(found.traces, recordings, strict=True):
        signals = {"missing_torque": trace.missing, "band": trace.band, "after": trace.tau - trace.after}
        columns = {name: np.interp(recording.t, trace.t, values) for name, values in signals.items()}
        names = pa.array([recording.name] * len(recording))
        parts.append(pa.table({"recording": names, "t": recording.t, **columns}))
    with replacing(path, True) as partial:
        pq.write_table(pa.concat_tables(parts), partial)
