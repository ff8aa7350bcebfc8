"""The tables of the page, as rows of text, and what the catalogues say there of effects and of the base."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from math import inf
from typing import Any

import numpy as np

from cosim.diagnosis.answer.entries import Source
from cosim.diagnosis.answer.result import Diagnosis, Finding, Part, Trace
from cosim.diagnosis.measure.breakdown import bars
from cosim.plots.quantities import decimals, number, raised, scale_of
from cosim.report.quantities import Scales
from cosim.report.words import ABSENT, ANSWERS, limit, lowered, others, shows_from, sized, started, unseen_torque
from pyfmi_models.assembly import LINEAR_UNITS, Axis
from pyfmi_models.effects import CATALOGUE, Effect
from pyfmi_models.friction import LAWS
from pyfmi_models.model import Variable


@dataclass(frozen=True)
class Table:
    """Columns and rows of text; the first cell of a row names it, `numeric` columns are set right."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numeric: tuple[int, ...] = ()
    style: str = "stack named"


def looked(diagnosis: Diagnosis, scales: Scales) -> Table:
    """List every effect with its answer and what it would have shown from, or why it cannot be tested."""
    least = unseen_torque(diagnosis, scales)
    rows = tuple((f.title, ANSWERS.get(f.answer, f.answer), sized(f)[0], _from(f, least)) for f in diagnosis.findings)
    return Table(("Effect", "Answer", "Size", "Shows from, or why not"), rows, (), "stack named tight")


def _from(finding: Finding, least: str) -> str:
    """Say from which size an effect shows; where its own number is no size, from which torque."""
    if finding.answer in ("found", "ambiguous", "not_proven"):
        return shows_from(finding)
    if finding.answer == "not_seen":
        return limit(finding) or f"a torque of {least}" * bool(least)
    return "; ".join(text.rstrip(".") for text in (finding.evidence, finding.action) if text)


def limits(diagnosis: Diagnosis, scales: Scales) -> Table:
    """List effects that were not seen or cannot be tested, for the first screen of "nothing is missing".

    Effects of which the same is said share a row.
    """
    least = unseen_torque(diagnosis, scales)
    groups: dict[tuple[str, str], list[Finding]] = {}
    for answer in ("not_seen", "not_decided", "not_testable"):
        for finding in (one for one in diagnosis.findings if one.answer == answer):
            groups.setdefault((answer, _from(finding, least)), []).append(finding)
    titles = {key: [lowered(finding.title) for finding in group] for key, group in groups.items()}
    rows = [(", ".join([groups[key][0].title, *titles[key][1:]]), ANSWERS[key[0]], key[1]) for key in groups]
    return Table(("Effect", "Answer", "Would have shown from"), tuple(rows), (), "stack named limits")


def numbers(finding: Finding) -> Table:
    """List the parameters of a finding with standard error and 95 % range."""
    rows = []
    for name, unit, value in _values(finding):
        error, ends = finding.standard_errors.get(name), finding.ranges.get(name)
        cells = number(value, 4), number(error) if error is not None else "", _span(finding.effect, name, ends)
        rows.append((name, *cells, raised(unit)))
    return filled(Table(("Parameter", "Value", "Standard error", "95 % range", "Unit"), tuple(rows), (1, 2, 3)))


def _span(effect: str, name: str, ends: tuple[float, float] | None) -> str:
    """Both ends of a range; only the upper one where the lower is none that the parameter may have."""
    if not ends:
        return ""
    low, high = decimals(ends, 3)
    return f"up to {high}" if ends[0] < least(effect, name) else f"{low} to {high}"


def _values(finding: Finding) -> Iterator[tuple[str, str, float]]:
    """Name, unit and value of each parameter; of the further waves of a ripple with their number before it."""
    for name, value in finding.parameters.items():
        yield name, finding.units.get(name, ""), value
    for number_, wave in enumerate(finding.harmonics, 2):
        for name, value in wave.items():
            yield f"{name}, wave {number_}", finding.units.get(name, ""), value


def filled(table: Table) -> Table:
    """Leave out the columns in which no row says anything."""
    keep = [i for i, _ in enumerate(table.columns) if any(row[i] for row in table.rows)]
    rows = tuple(tuple(row[i] for i in keep) for row in table.rows)
    numeric = tuple(place for place, i in enumerate(keep) if i in table.numeric)
    return Table(tuple(table.columns[i] for i in keep), rows, numeric, table.style)


def proof(diagnosis: Diagnosis, scales: Scales) -> Table:
    """List the error of the recording that was not fitted: over all samples, in clear motion, of the position."""
    held, unit = diagnosis.heldout, scales.torque
    names = ("nominal_rms", "before_rms", "after_rms", "floor_rms")
    whole = decimals(tuple(getattr(held, name) * unit.factor for name in names), 3)
    rows = [(f"RMS, all samples [{unit.unit}]", *whole)]
    if held.sliding:
        cells = _cells(held.sliding, names, unit.factor)
        rows.append((f"RMS, clear motion only [{unit.unit}]", *cells))
    if held.position:
        unit = scale_of("rad" if diagnosis.motion == "rotary" else "m", max(map(abs, held.position.values())))
        rows.append((f"Position, closed loop [{unit.unit}]", *_cells(held.position, names, unit.factor)))
    named = ("Held-out recording", "As delivered", "Refitted", "With the effects", "Noise")
    return Table(named, tuple(rows), (1, 2, 3, 4))


def _cells(found: dict[str, float], names: tuple[str, ...], factor: float) -> tuple[str, ...]:
    short = [found.get(name, found.get(name.removesuffix("_rms"), float("nan"))) for name in names]
    return decimals(tuple(value * factor for value in short), 3)


def parts(rows: Sequence[Part], scales: Scales) -> Table:
    """List the rows of the proof figure as numbers."""
    unit = scales.torque
    cells = [(row.label, *decimals((row.before * unit.factor, row.after * unit.factor), 3), row.change) for row in rows]
    return Table(("Part", f"Before [{unit.unit}]", f"After [{unit.unit}]", "Change"), tuple(cells), (1, 2), "narrow")


def spans(diagnosis: Diagnosis) -> Table:
    """List the flagged time spans, longest first."""
    found = [(trace.name, low, high) for trace in diagnosis.traces for low, high in trace.intervals]
    found.sort(key=lambda row: row[1] - row[2])
    rows = tuple((name, f"{low:.2f}", f"{high:.2f}", f"{high - low:.2f}") for name, low, high in found[:40])
    return Table(("Recording", "From [s]", "To [s]", "Length [s]"), rows, (1, 2, 3), "narrow")


def worst(trace: Trace, scales: Scales) -> Table:
    """List the seconds of a recording with the largest error after, the worst first."""
    edges, before, after = bars(trace)
    order = np.argsort(-np.nan_to_num(after))[:6]
    factor = scales.torque.factor
    rows = tuple(
        (f"{edges[i]:.0f} to {edges[i + 1]:.0f} s", *decimals((before[i] * factor, after[i] * factor))) for i in order
    )
    unit = scales.torque.unit
    return Table((f"Worst seconds of {trace.name}", f"Before [{unit}]", f"After [{unit}]"), rows, (1, 2), "narrow")


def parameters(diagnosis: Diagnosis) -> Table:
    """List the base parameters: as delivered, refitted, with the missing physics."""
    rows, unknown = [], {one.variable.name for one in diagnosis.not_determined}
    for name, (given, refitted, full) in diagnosis.base_parameters.items():
        change = f"{100 * (full / given - 1):+.0f} %".replace("-", "−") if given else ""
        change = "not determined" if name in unknown else change
        values = (number(value, 4) for value in (given, refitted, full))
        rows.append((name, *values, change, raised(base_unit(name, diagnosis.motion))))
    named = ("Parameter", "As delivered", "Refitted", "With the effects", "Change", "Unit")
    return filled(Table(named, tuple(rows), (1, 2, 3, 4)))


def files(diagnosis: Diagnosis) -> Table:
    """List the recordings and the card with their hashes."""
    made = diagnosis.provenance.get("card", {})
    rows, card = [], Source(name=made.get("name", ""), role="model card", sha256=made.get("sha256", ""))
    for entry in (*diagnosis.provenance.get("recordings", ()), card):
        seconds, rate = entry.get("seconds"), entry.get("rate_hz")
        size = f"{seconds:.4g} s at {rate:.4g} Hz" if seconds and rate else ""
        if entry.get("name"):
            rows.append((str(entry["name"]), str(entry.get("role", "")), size, str(entry.get("sha256", ""))))
    return Table(("File", "Role", "Length", "SHA-256"), tuple(rows), (), "stack named hash")


def unseen(diagnosis: Diagnosis) -> tuple[str, str]:
    """Return one line on what was not detected and what these recordings cannot show, and the names that it folds."""
    named = {answer: [lowered(f.title) for f in diagnosis.findings if f.answer == answer] for answer in ABSENT}
    sentences = [f"{started(ABSENT[answer])}: {', '.join(names)}." for answer, names in named.items() if names]
    return others(diagnosis, ", limits in the table below" * bool(named["not_seen"])), " ".join(sentences)


def equation(effect: str) -> str:
    """The equation; an effect torque resists. Empty for what is no effect."""
    return _form(effect).equation


def least(effect: str, parameter: str) -> float:
    """The least value that a parameter of an effect may have; of what is no effect, any."""
    return next((one.low for one in _declared(_form(effect), parameter)), -inf)


def base_unit(parameter: str, motion: str) -> str:
    """The unit of a number of the base, `axis.inertia` or `friction.Fc.positive`; empty where none is known."""
    group, name, *_ = [*parameter.split("."), ""]
    parts = (Axis,) if group == "axis" else LAWS.values()
    unit = next((one.unit for part in parts for one in _declared(part, name)), "")
    return LINEAR_UNITS.get(unit, unit) if motion == "linear" else unit


def _declared(part: Any, name: str) -> Iterator[Variable]:
    """What a class of parts declares of the parameter of this name, if it has one."""
    return (item.metadata["variable"] for item in fields(part) if item.name == name and "variable" in item.metadata)


def _form(effect: str) -> type[Effect]:
    return CATALOGUE.get(effect, (Effect,))[0]
