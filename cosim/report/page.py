"""Everything the template prints, put together from a diagnosis, and the recordings for its explorer."""

import re
from collections.abc import Iterator
from importlib.resources import files as resources

import numpy as np

from cosim.diagnosis.answer.result import Diagnosis, Finding, Trace
from cosim.diagnosis.effects import named
from cosim.diagnosis.measure.breakdown import Samples, bars, samples, worst
from cosim.plots.explorer import Sheet, of_page, record, script_of_page
from cosim.plots.quantities import joined
from cosim.report import tables, unknown, words
from cosim.report.figures_dynamic import effect
from cosim.report.figures_friction import friction
from cosim.report.figures_own import own
from cosim.report.figures_proof import looked_for, proof
from cosim.report.figures_time import WIDE, overlay, recording
from cosim.report.figures_where import plane, region, strongest
from cosim.report.findings import block, untrained
from cosim.report.lead import heading, lead
from cosim.report.learned import nameless
from cosim.report.next_experiment import next_experiment
from cosim.report.quantities import Scales
from cosim.report.sheet import Picture
from cosim.support.plain import JsonObject

MOST_RECORDINGS, MOST_REGIONS = 6, 12


def context(diagnosis: Diagnosis) -> dict[str, object]:
    """Return the values of the template."""
    scales = Scales.of(diagnosis)
    chosen = samples(diagnosis.traces)
    sections = (_first, _findings, _middle, _time, _end)
    return {name: value for section in sections for name, value in section(diagnosis, scales, chosen).items()}


def _first(diagnosis: Diagnosis, scales: Scales, chosen: Samples) -> dict[str, object]:
    """Return the first screen."""
    kind = words.verdict(diagnosis)
    rows = scales.labelled(diagnosis.parts)
    return {
        "heading": heading(diagnosis),
        "mount": diagnosis.mount,
        **_doubts(diagnosis),
        "identity": identity(diagnosis),
        "lead": lead(diagnosis, scales),
        "facts": unknown.facts(diagnosis, scales) if kind == "unknown" else None,
        "limits": tables.limits(diagnosis, scales) if kind == "none" else None,
        "unseen": ("", "") if kind == "none" else tables.unseen(diagnosis),
        "proof": proof(diagnosis, rows, scales),
        "parts_table": tables.parts(rows, scales),
        "added": diagnosis.adds_physics,
        "with_effects": _with_effects(diagnosis),
        "compared": _compared(diagnosis),
        "box": _box(diagnosis, [row.label for row in rows if row.change == "worse"], scales),
        "noun": scales.noun,
    }


SAID = 2
"""Sentences of a doubt that stand open; what more there is to it is folded."""


def _doubts(diagnosis: Diagnosis) -> dict[str, object]:
    """Return alarms and other doubts, each with what is folded; and remarks, which stand below the answer."""
    alarms, others, remarks = words.doubts(diagnosis)
    cut = [re.split(r"(?<=[.!?]) (?=[A-Z])", text) for text in (*alarms, *others)]
    return {
        "careful": [(" ".join(parts[:SAID]), " ".join(parts[SAID:])) for parts in cut],
        "remarks": remarks,
    }


def identity(diagnosis: Diagnosis) -> list[dict[str, str]]:
    """Return machine, recordings, model and version."""
    made, many = diagnosis.provenance, len(diagnosis.traces)
    recorded = [float(entry["seconds"]) for entry in made.get("recordings", ()) if entry.get("seconds")]
    seconds = sum(recorded) or sum(float(trace.t[-1] - trace.t[0]) for trace in diagnosis.traces if trace.t.size)
    rates = [entry["rate_hz"] for entry in made.get("recordings", ()) if entry.get("rate_hz")]
    rest = f", {seconds:.0f} s" + (f" at {_rate(rates[0])}" if rates else "")
    facts = [("", diagnosis.mount, ""), ("", f"{many} recording{'s' if many != 1 else ''}", rest)]
    facts.append(("Model", words.model(diagnosis), ""))
    facts.append(("cosim", str(made.get("version", "")), ""))
    return [dict(zip(("label", "value", "rest"), part, strict=True)) for part in facts if part[1]]


def _rate(hertz: float) -> str:
    return joined(f"{hertz / 1000:.4g}", "kHz") if round(hertz) >= 1000 else joined(f"{hertz:.4g}", "Hz")


def _with_effects(diagnosis: Diagnosis) -> str:
    held = len({finding.name for finding in diagnosis.in_model})
    if diagnosis.learned:
        return "with what was learned" if not held else "with the effects and what was learned"
    if held and words.verdict(diagnosis) == "either":
        return "with the likeliest cause"
    return "with the effect" if held == 1 else f"with the {words.count(held).lower()} effects"


def _compared(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Return lines over time and their names: where nothing was added there is one model, not twice the same."""
    if not diagnosis.adds_physics:
        return [("", "measured"), ("before", "model, refitted")]
    return [("", "measured"), ("before", "before, refitted"), ("after", _with_effects(diagnosis))]


def _box(diagnosis: Diagnosis, worse: list[str], scales: Scales) -> dict[str, str] | None:
    """Say where the improved model is proven and where to keep the old one."""
    files = words.delivered(diagnosis)
    if not files:
        return None
    proven = words.proven_range(diagnosis, scales)
    text = "is proven on the validation runs only."
    if proven:
        text = f"is proven {proven}. Outside this range it is not validated: use the original model there."
    said = [f"in front of {words.model(diagnosis)}"] if "correction" in diagnosis.improved else []
    said += [text, f"It is worse here: {', '.join(worse)}." if worse else ""]
    if "ssp" in diagnosis.improved:
        said.append(f"{diagnosis.improved['ssp']} holds both, wired to a controller.")
    return {"file": files[0], "text": " ".join(filter(None, [*said, *words.left_out(diagnosis)]))}


def _findings(diagnosis: Diagnosis, scales: Scales, chosen: Samples) -> dict[str, object]:
    found = [one for one in words.blocks(diagnosis) if one.first.effect != "unknown"]
    blocks = [block(one, diagnosis, scales, _picture(one.first, diagnosis, scales, chosen)) for one in found]
    return {"blocks": blocks, "experiment": next_experiment(diagnosis, scales)}


def _picture(finding: Finding, diagnosis: Diagnosis, scales: Scales, chosen: Samples) -> Picture | None:
    """Draw the view in which an effect shows; where the model holds it, its own curve with what was measured of it."""
    curved = friction(finding, diagnosis, chosen, scales) if named(finding.effect).view == "keep turning" else None
    return curved or own(finding, diagnosis, chosen, scales) or effect(finding, chosen, scales)


def _middle(diagnosis: Diagnosis, scales: Scales, chosen: Samples) -> dict[str, object]:
    """Return everything looked for, what stays, proof, and where."""
    return {
        "looked": tables.looked(diagnosis, scales),
        "looked_picture": looked_for(diagnosis.findings, diagnosis.ambiguous_with),
        "meanings": words.MEANINGS,
        "nameless": nameless(diagnosis, scales),
        "unexplained": unexplained(diagnosis, scales),
        "spans": tables.spans(diagnosis),
        "proof_table": tables.proof(diagnosis, scales),
        "proof_sentence": _proof_sentence(diagnosis, scales),
        "places": list(_places(diagnosis, scales, chosen)),
    }


MISFIT = "Friction-model error alone could explain this."
"""What can be said of a rest that was judged to be no effect: what it goes with was not asked."""


def unexplained(diagnosis: Diagnosis, scales: Scales) -> list[str]:
    """Say how much error is left above the noise, and what it goes with."""
    held, unit = diagnosis.heldout, scales.torque
    rest = float(np.sqrt(max(held.after_rms**2 - held.floor_rms**2, 0.0)))
    if quiet := rest <= 0.5 * held.floor_rms or bool(diagnosis.broadband):
        error, noise = unit.text(held.after_rms), unit.text(held.floor_rms)
        left = diagnosis.broadband.get("statement") or (
            f"Hardly anything: {error} of validation error against a noise floor of {noise}."
        )
    else:
        left = f"{unit.text(rest)} of validation error stays unexplained, beyond the noise."
    goes = f"It correlates with {', '.join(diagnosis.depends_on)}." if diagnosis.depends_on else ""
    misfit = "" if goes or quiet or words.verdict(diagnosis) == "withheld" else MISFIT
    there = "" if quiet else untrained(diagnosis, scales)
    return [text for text in (left, there, goes, misfit) if text]


def _proof_sentence(diagnosis: Diagnosis, scales: Scales) -> str:
    held, unit = diagnosis.heldout, scales.torque
    kept = f"{held.name} was not used for fitting."
    if not diagnosis.adds_physics:
        return f"{kept} Nothing was added to the model, so there is no gain to prove."
    low, high = held.confidence_interval
    sure = "" if low > 0 else " That range includes zero: no clear change." if high >= 0 else " It is worse."
    gain = f"The error falls by {unit.text(held.before_rms - held.after_rms)} (95 % range {unit.span(low, high)})."
    return f"{kept} {gain}{sure}{_black_box(diagnosis, scales)}"


def _black_box(diagnosis: Diagnosis, scales: Scales) -> str:
    """Say what a smooth black box would have reached in place of named physics."""
    held, unit = diagnosis.heldout, scales.torque
    if held.black_box_rms is None:
        return ""
    error = unit.text(held.black_box_rms)
    return f" The refitted base with a black box beside it, learnt on the training recordings, leaves {error}."


def _places(diagnosis: Diagnosis, scales: Scales, chosen: Samples) -> Iterator[Picture]:
    after = {other.axis: other for other in diagnosis.regions_after} if diagnosis.adds_physics else {}
    for before in diagnosis.regions[:MOST_REGIONS]:
        yield region(before, after.get(before.axis), scales)
    if chosen.t.size > 200 and (top := strongest(chosen)) > 0:
        yield plane("before", chosen, chosen.before, scales, top)
        if diagnosis.adds_physics:
            yield plane("after", chosen, chosen.after, scales, top)


def _time(diagnosis: Diagnosis, scales: Scales, chosen: Samples) -> dict[str, object]:
    """Return when, and the worst seconds."""
    traces = sorted((t for t in diagnosis.traces if t.t.size > 1), key=lambda trace: not trace.heldout)
    shown, hidden = traces[:MOST_RECORDINGS], traces[MOST_RECORDINGS:]
    missing, error = map(max, zip(*map(_most, shown), strict=True))
    span = worst(traces[0], traces[0].tau - traces[0].after)
    return {
        "times": [recording(place, trace, scales, (missing, error)) for place, trace in enumerate(shown)],
        "hidden": f"{len(hidden)} more recordings are in the explorer below." if hidden else "",
        "overlay": overlay(traces[0], span, scales, WIDE),
        "overlay_small": overlay(traces[0], span, scales),
        "worst": tables.worst(traces[0], scales),
    }


def _most(trace: Trace) -> tuple[float, float]:
    """Return the heights that hold missing torque (but for single spikes) and RMS bars."""
    tall = float(np.nanquantile(np.abs(trace.missing), 0.999))
    return 1.15 * max(tall, float(np.nanmax(trace.band))), 1.05 * float(np.nanmax(bars(trace)[1:]))


def _end(diagnosis: Diagnosis, scales: Scales, chosen: Samples) -> dict[str, object]:
    """Return parameters, quality, provenance, explorer."""
    made, here = diagnosis.provenance, resources("cosim.report")
    script, digest = script_of_page()
    details = [made.get("date", ""), f"cosim {made['version']}" if made.get("version") else ""]
    details += [f"seed {made['seed']}"] if "seed" in made else []
    details += [f"{diagnosis.seconds:.1f} s"] if diagnosis.seconds else []
    return {
        "parameters": tables.parameters(diagnosis),
        "parameters_sentence": " ".join(_refitted(diagnosis)),
        "law": words.law(diagnosis),
        "quality": diagnosis.data_quality,
        "command": str(made.get("command", "")),
        "files": tables.files(diagnosis),
        "made": ", ".join(str(text) for text in details if text),
        "data": payload(diagnosis, scales),
        "script": script,
        "script_hash": digest,
        "css": here.joinpath("report.css").read_text("utf-8"),
    }


def _refitted(diagnosis: Diagnosis) -> Iterator[str]:
    """Say that the base was refitted, and whether the loop, in which noise reaches the motion, biased the numbers."""
    yield "The base was refitted on the training recordings before any effect was tested."
    tested = diagnosis.loop_bias
    if tested and tested["biased"]:
        moves = [f"{name} by {100 * move:+.0f} %".replace("-", "−") for name, move in tested["moved"].items()]
        yield f"An instrumental-variable test with the set point would move {', '.join(moves)}: the control loop, or an"
        yield "imprecise friction law, biases the fit."
    elif tested:
        yield "An instrumental-variable test with the set point does not move them: the loop did not bias the fit."


def payload(diagnosis: Diagnosis, scales: Scales) -> JsonObject:
    """Return what `explorer.js` reads."""
    traces = [trace for trace in diagnosis.traces if trace.t.size > 1]
    seconds = sum(float(trace.t[-1] - trace.t[0]) for trace in traces) or 1.0
    torque = scales.torque.unit
    models = [("before", "before", (6, 3)), ("after", "after", ())][: 2 if diagnosis.adds_physics else 1]
    errors = [("lost", "before", ()), ("left", "after", ())][: len(models)]
    sheets = (
        Sheet(f"{scales.noun} [{torque}]", 0.45, [("tau", "ink", ()), *models]),
        Sheet(f"error: measured minus model [{torque}]", 0.32, errors),
        Sheet(f"position [{scales.position.unit}]", 0.23, [("q", "ink", ())]),
    )
    records = [_packed(trace, scales, seconds) for trace in traces]
    differences = [["lost", "tau", "before"], ["left", "tau", "after"]]
    shown = next((i for i, trace in enumerate(traces) if trace.heldout), 0)
    return of_page(sheets, records, "after", differences=differences, open=shown)


def _packed(trace: Trace, scales: Scales, seconds: float) -> JsonObject:
    torque = scales.torque.factor
    signals = {
        "tau": trace.tau * torque,
        "before": trace.before * torque,
        "after": trace.after * torque,
        "q": trace.q * scales.position.factor,
    }
    packed = record(trace.name, trace.t, signals, float(trace.t[-1] - trace.t[0]) / seconds)
    spans = {"before": worst(trace, trace.missing), "after": worst(trace, trace.tau - trace.after)}
    return {**packed, "heldout": trace.heldout, "spans": {key: list(span) for key, span in spans.items()}}
