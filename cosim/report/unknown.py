"""What is known about an error that no known effect explains: where, when, how large, what it goes with."""

import numpy as np

from cosim.diagnosis.answer.result import Array, Diagnosis, Finding, Region
from cosim.diagnosis.decide.decision import IN_BURSTS
from cosim.diagnosis.measure.breakdown import bars
from cosim.diagnosis.measure.findings import ACTION
from cosim.report.figures_where import NAMES, runs
from cosim.report.next_experiment import is_about, to_record
from cosim.report.quantities import Scales
from cosim.report.tables import Table

AXES = ("position", "speed", "direction")


def facts(diagnosis: Diagnosis, scales: Scales) -> Table:
    """Return the table of the first screen."""
    own = next((finding for finding in diagnosis.findings if finding.effect == "unknown"), None)
    rows = [
        ("Where", _where(diagnosis, own, scales)),
        ("When", _when(diagnosis)),
        ("Size", _size(diagnosis, own, scales)),
        ("What", diagnosis.broadband.get("statement", "")),
        ("Correlates with", ", ".join(diagnosis.depends_on) or "nothing that was recorded"),
        ("Do this", _action(diagnosis, own)),
    ]
    return Table(("Question", "What is known about it"), tuple(row for row in rows if row[1]), (), "facts")


def _where(diagnosis: Diagnosis, own: Finding | None, scales: Scales) -> str:
    if own and own.where and own.where.description:
        return own.where.description
    said = [place(region, scales) for region in diagnosis.regions if region.axis in AXES]
    return ", ".join(text for text in said if text) or "no place stands out"


def place(region: Region, scales: Scales) -> str:
    """Say where the mean missing torque stands out of its band: beyond half of its peak."""
    size = np.abs(np.nan_to_num(region.mean))
    loud = (size > np.nan_to_num(region.band)) & (size > 0.5 * size.max())
    if region.axis == "speed":
        loud = np.convolve(loud, np.ones(5), "same") > 1
    if region.axis == "direction":
        return _direction(region, loud)
    if not loud.any() or len(runs(loud)) > 3 or loud.sum() > 0.6 * np.isfinite(region.mean).sum():
        return f"every {NAMES.get(region.axis, region.axis)}" if loud.any() and region.axis == "speed" else ""
    unit, half = scales.of_unit(region.unit), 0.5 * float(np.median(np.diff(region.centres)))
    spans = [unit.span(region.centres[low] - half, region.centres[high] + half) for low, high in runs(loud)]
    return f"{NAMES.get(region.axis, region.axis)} {' and '.join(spans)}"


def _direction(region: Region, loud: Array) -> str:
    sides = {("backward" if centre < 0 else "forward") for centre in region.centres[loud.astype(bool)] if centre}
    return f"{sides.pop()} only" if len(sides) == 1 else "both directions" if sides else ""


def _when(diagnosis: Diagnosis) -> str:
    """Count the seconds in which the error stands out of the noise."""
    limit = 1.5 * diagnosis.heldout.floor_rms
    loud = np.concatenate([bars(trace)[1] > limit for trace in diagnosis.traces]) if diagnosis.traces else np.empty(0)
    return f"in {int(loud.sum())} of {loud.size} seconds above 1.5 times the noise" if loud.size else ""


def _size(diagnosis: Diagnosis, own: Finding | None, scales: Scales) -> str:
    if own and own.size:
        return f"{own.size} ({own.size_range})" if own.size_range else own.size
    placed = [r for r in diagnosis.regions if r.axis != "frequency" and np.isfinite(r.mean).any()]
    peaks = [float(np.nanmax(np.abs(region.mean))) for region in placed]
    return f"mean error up to {scales.torque.text(max(peaks))} at one place" if peaks else ""


def _action(diagnosis: Diagnosis, own: Finding | None) -> str:
    if own and own.action:
        return own.action
    if diagnosis.broadband:
        return ACTION
    if is_about(diagnosis, ("unknown",)) and (order := to_record(diagnosis)):
        return order
    on = diagnosis.depends_on[0] if diagnosis.depends_on else ""
    if on == IN_BURSTS:
        return ACTION
    return _vary(on, diagnosis)


SETTABLE = {
    "position": "repeat the run over another range of positions, and compare",
    "speed": "repeat the run at half and at twice the speed, and compare",
    "direction": "repeat the run mirrored, and compare",
    "acceleration": "repeat the run with softer and with harder starts, and compare",
    "temperature": "repeat the same run, cold and warm, and compare",
    "time": "repeat the same run, cold and warm, and compare",
}
"""What somebody can do about what an error goes with."""


def _vary(on: str, diagnosis: Diagnosis) -> str:
    """Say how to change what an error goes with: a column that was recorded can be varied, of the rest what it is."""
    columns = {name for trace in diagnosis.traces for name in trace.extras}
    if on in columns:
        return f"vary {on} and keep the motion, then compare"
    if not on:
        return "look at the machine there, then repeat the run"
    words = ("time", "temperature", "acceleration", "direction", "position", "speed")
    known = next((word for word in words if word in on), "")
    return SETTABLE.get(known, "look at the machine there, then repeat the run")
