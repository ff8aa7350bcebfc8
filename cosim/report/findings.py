"""The block of one finding: plain sentence, what the mechanic needs, and closed numbers for the engineer.

Beside them what is left where training never was: what acts there alone (a torque limit, a cable's end) was never
fitted.
"""

import re
from dataclasses import dataclass

import numpy as np

from cosim.diagnosis.answer.result import Array, Diagnosis, Finding, Trace, is_special
from cosim.diagnosis.measure.findings import without_model
from cosim.report import tables, words
from cosim.report.lead import led
from cosim.report.next_experiment import is_about, to_record
from cosim.report.quantities import Scales
from cosim.report.repairs import Check, repairs_of
from cosim.report.sheet import Picture
from cosim.report.tables import equation

NOTHING_YET = "Nothing yet: not confirmed. “cosim why” names the rule."
PROBABILITY = (
    "The probability is its share of the evidence among its rivals, calibrated on simulated telescope mounts and "
    "machines of six other classes; on machines unlike these it may come true less often."
)
ALIKE = 0.5
"""Per cent of the error energy by which two that remove as much may differ."""
_NATS = re.compile(r"^([^:]+): .*\(([\d,]+ nats) behind\)$").findall


@dataclass(frozen=True)
class Numbers:
    """The closed part: equation, parameters with their ranges, and what the answer rests on."""

    title: str
    equation: str
    table: tables.Table
    lines: tuple[str, ...]


@dataclass(frozen=True)
class Shown:
    """One finding as it is printed."""

    block: words.Block
    sentences: tuple[str, ...]
    rows: tuple[tuple[str, str], ...]
    numbers: tuple[Numbers, ...]
    checks: tuple[Check, ...]
    repairs: tables.Table
    picture: Picture | None
    do: str
    likely: str
    size: str
    size_range: str


def block(one: words.Block, diagnosis: Diagnosis, scales: Scales, picture: Picture | None) -> Shown:
    """Return what is printed of one finding; what the first screen says of it is not said again."""
    first = one.first
    said = [words.stated(finding) for finding in one.findings if finding.name not in led(diagnosis)]
    if one.answer == "not_proven":
        said = [f"In the training runs alone: {words.lowered(text)}" for text in said if text]
    if one.answer == "ambiguous":
        said = [*words.either(said), _in_model(diagnosis, *one.findings)]
    apart = (finding.told_apart_by for finding in one.findings)  # of possible causes another's would say the same
    rows = [("Where", where(first, scales)), ("How to distinguish", next(filter(None, apart), ""))]
    rows += [("Ruled out", _plainly(first.ruled_out)), ("Less likely", _plainly(first.less_likely))]
    closed = tuple(_numbers(finding) for finding in one.findings)
    filled = tuple((name, text) for name, text in rows if text)
    checks, repair = _at_the_machine(first, diagnosis)
    likely = f"probability {first.probability:.2f}" if first.answer in ("found", "ambiguous") else ""
    texts = do(one, diagnosis), likely, *words.sized(first)
    return Shown(one, tuple(filter(None, said)), filled, closed, checks, repair, picture, *texts)


def _at_the_machine(finding: Finding, diagnosis: Diagnosis) -> tuple[tuple[Check, ...], tables.Table]:
    """Return the checks of an effect in their order, and its repair by kind of machine."""
    known = repairs_of(finding.effect) if finding.answer in ("found", "ambiguous") else None
    rows = known.of(diagnosis.motion, words.machine(diagnosis)) if known else {}
    return known.checks if known else (), tables.Table(("Machine", "Repair"), tuple(rows.items()))


def _in_model(diagnosis: Diagnosis, first: Finding, *rivals: Finding) -> str:
    """Say which of the possible causes the improved model holds."""
    if first not in diagnosis.in_model:
        return "No model holds it." if not rivals else "No model holds any of these."
    if not rivals:
        return "The improved model holds it, though it is not certain."
    if is_special(first.effect, [rival.effect for rival in rivals]):
        other = "the other" if len(rivals) == 1 else "each of the others"
        return f"The improved model holds {words.lowered(first.title)}: it is a special case of {other}."
    return f"The improved model holds the likelier, {words.lowered(first.title)}."


def where(finding: Finding, scales: Scales) -> str:
    """Return the description and, where given, the regions in the units of the page."""
    if finding.where is None:
        return ""
    if finding.where.axis == "direction":
        return finding.where.description
    scale, regions = scales.of_axis(finding.where.axis), finding.where.regions
    if finding.where.axis == "speed" and len(regions) == 1 and regions[0][0] == -regions[0][1]:
        return f"slower than {scale.text(regions[0][1])}"
    if finding.where.axis == "speed" and len(regions) == 2 and regions[0][1] == -regions[1][0] < 0:
        return f"faster than {scale.text(regions[1][0])}"
    spans = [scale.span(low, high) for low, high in regions[:4]]
    if len(regions) > 4:
        spans.append(f"{len(regions) - 4} more")
    described = re.sub(r"^around [-−\d.e+]+$", "around one place", finding.where.description)
    named = f" ({', '.join(spans)})" if spans and described else ", ".join(spans)
    return described + named


def _plainly(rivals: tuple[str, ...]) -> str:
    """Rivals without the unit of evidence, which stands among the numbers; where shares are equal, what parts them."""
    return "; ".join(_plain(rival) for rival in rivals)


def _plain(rival: str) -> str:
    bare = re.sub(r" \([\d,]+ nats behind\)", "", rival)
    shares = re.findall(r"([\d.]+) ?%", bare)
    if len(shares) != 2:
        return bare
    ahead = float(shares[0]) - float(shares[1])
    if ahead >= ALIKE:
        return f"{bare}, but fits worse where noise is low, or has more to adjust"
    return f"{bare}: the detail of what is left decides" if ahead > -ALIKE else bare


def do(one: words.Block, diagnosis: Diagnosis) -> str:
    """Return the action; rivals ask for the next experiment, and what did not prove itself for nothing."""
    if one.answer == "not_proven":
        return NOTHING_YET
    own = [finding.name for finding in one.findings]
    if one.answer == "ambiguous" and is_about(diagnosis, own) and (order := to_record(diagnosis)):
        return words.started(order)
    files = words.delivered(diagnosis)
    if one.first not in diagnosis.in_model:
        return without_model(one.first.action)
    return one.first.action or (f"Use {files[0]}" if files and one.answer == "found" else "")


def _numbers(finding: Finding) -> Numbers:
    lines = [words.started(words.closed(finding.evidence))] if finding.evidence else []
    if finding.answer in ("found", "ambiguous"):
        lines.append(PROBABILITY)
    behind = [f"{title}, {nats}" for one in (*finding.ruled_out, *finding.less_likely) for title, nats in _NATS(one)]
    lines += [f"Evidence by which rivals are behind: {'; '.join(behind)}."] if behind else []
    limit = words.shows_from(finding)
    lines += [f"Would have shown from {limit}."] if limit else []
    lines.append("Ranges: 95 %, robust to errors that are alike within a block.")
    return Numbers(finding.title, equation(finding.effect), tables.numbers(finding), tuple(lines))


MOST = 0.5
"""Share of the held-out error energy, from which on it is said where it lies. Unit: 1."""
DENSER = 2.0
"""Energy of a row there, at least, relative to that of a row on average: more ground alone is no reason. Unit: 1."""


def untrained(diagnosis: Diagnosis, scales: Scales) -> str:
    """Say that most of the held-out error lies beyond what training had of positions, speeds or torques; or nothing."""
    trained = [trace for trace in diagnosis.traces if not trace.heldout]
    held = [trace for trace in diagnosis.traces if trace.heldout]
    if not trained or not held:
        return ""
    left = _stacked(held, "tau") - _stacked(held, "after")
    axes = {"q": ("positions", scales.position), "v": ("speeds", scales.speed), "tau": ("torques", scales.torque)}
    told = [
        (*_beyond(_stacked(held, axis), left, _edges(trained, axis)), name, _edges(trained, axis), unit)
        for axis, (name, unit) in axes.items()
    ]
    energy, rows, name, edges, unit = max(told, key=lambda one: one[0])
    if energy < max(MOST, DENSER * rows):
        return ""
    where = f"at {name} outside {unit.span(*edges)}, which the fit never had ({100 * rows:.0f} % of the time)"
    part = f"{100 * energy:.0f} % of the error energy on validation runs"
    return f"{part} lies {where}: what acts there alone cannot be named without training data."


def _stacked(traces: list[Trace], axis: str) -> Array:
    return np.concatenate([getattr(trace, axis) for trace in traces])


def _edges(traces: list[Trace], axis: str) -> tuple[float, float]:
    values = _stacked(traces, axis)
    return float(np.nanmin(values)), float(np.nanmax(values))


def _beyond(values: Array, left: Array, edges: tuple[float, float]) -> tuple[float, float]:
    """Shares of the energy and of the rows outside the edges."""
    outside, whole = (values < edges[0]) | (values > edges[1]), float(np.nansum(left**2))
    return (float(np.nansum(left[outside] ** 2)) / whole if whole else 0.0), float(np.mean(outside))
