"""The recordings of a diagnosis for the explorer of its page: torque, both models, their errors, position."""

from cosim.diagnosis.answer.result import Diagnosis, Trace
from cosim.diagnosis.measure.breakdown import worst
from cosim.plots.explorer import Sheet, record
from cosim.report.quantities import Scales
from cosim.support.plain import JsonObject


def payload(diagnosis: Diagnosis, scales: Scales) -> JsonObject:
    """Return what `explorer.js` reads."""
    traces = [trace for trace in diagnosis.traces if trace.t.size > 1]
    seconds = sum(float(trace.t[-1] - trace.t[0]) for trace in traces) or 1.0
    torque, noun = scales.torque.unit, "torque" if diagnosis.motion == "rotary" else "force"
    models = [("before", "before", (6, 3)), ("after", "after", ())][: 2 if diagnosis.adds_physics else 1]
    errors = [("lost", "before", ()), ("left", "after", ())][: len(models)]
    sheets = (
        Sheet(f"{noun} [{torque}]", 0.45, [("tau", "ink", ()), *models]),
        Sheet(f"error: measured minus model [{torque}]", 0.32, errors),
        Sheet(f"position [{scales.position.unit}]", 0.23, [("q", "ink", ())]),
    )
    return {
        "sheets": [sheet.as_json() for sheet in sheets],
        "differences": [["lost", "tau", "before"], ["left", "tau", "after"]],
        "recordings": [_packed(trace, scales, seconds) for trace in traces],
        "first": "after",
        "open": next((i for i, trace in enumerate(traces) if trace.heldout), 0),
    }


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
