"""The block of one finding: plain sentence, what the mechanic needs, and closed numbers for the engineer."""

from dataclasses import dataclass

from cosim.diagnosis.report import tables, words
from cosim.diagnosis.report.equations import EQUATIONS
from cosim.diagnosis.report.quantities import Scales
from cosim.diagnosis.report.sheet import Picture
from cosim.diagnosis.result import Diagnosis, Finding, is_special
from cosim.pictures.quantities import minus


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
    picture: Picture | None
    do: str
    size: str
    size_range: str


def block(one: words.Block, diagnosis: Diagnosis, scales: Scales, picture: Picture | None) -> Shown:
    """Return what is printed of one finding."""
    first = one.first
    said = [words.closed(finding.statement) for finding in one.findings]
    if one.answer == "ambiguous":
        said = words.either(said)
        said.append(_in_model(*one.findings))
    rows = [("Size", _size(first)), ("Where", where(first, scales)), ("Evidence", first.evidence)]
    rows += [("Ruled out", ", ".join(first.ruled_out)), ("Tell apart", _apart(one)), ("Do this", _do(one, diagnosis))]
    closed = tuple(_numbers(finding) for finding in one.findings)
    filled = tuple((name, text) for name, text in rows if text)
    return Shown(
        one,
        tuple(filter(None, said)),
        filled,
        closed,
        picture,
        _do(one, diagnosis),
        *map(minus, (first.size, first.size_range)),
    )


def _in_model(first: Finding, *rivals: Finding) -> str:
    """Say which of the possible causes goes into the improved model."""
    if not rivals:
        return "It goes into no model."
    if is_special(first.effect, [rival.effect for rival in rivals]):
        other = "the other" if len(rivals) == 1 else "each of the others"
        return f"{first.title} goes into the model: it is a special case of {other} and predicts alike."
    return "None of these goes into a model."


def _size(finding: Finding) -> str:
    span = f", 95 % range {finding.size_range}" if finding.size_range else ""
    return minus(f"{finding.size}{span}") if finding.size else ""


def where(finding: Finding, scales: Scales) -> str:
    """Return the description and, where given, the regions in the units of the page."""
    if finding.where is None:
        return ""
    scale = scales.of_axis(finding.where.axis)
    spans = [scale.span(low, high) for low, high in finding.where.regions[:4]]
    if len(finding.where.regions) > 4:
        spans.append(f"{len(finding.where.regions) - 4} more")
    named = f" ({', '.join(spans)})" if spans and finding.where.description else ", ".join(spans)
    return finding.where.description + named


def _apart(one: words.Block) -> str:
    texts = dict.fromkeys(finding.told_apart_by for finding in one.findings if finding.told_apart_by)
    return "; ".join(texts)


def _do(one: words.Block, diagnosis: Diagnosis) -> str:
    """Return the action; rivals ask for the next experiment."""
    if one.answer == "ambiguous" and diagnosis.next_experiment.get("description"):
        return words.started(str(diagnosis.next_experiment["description"]))
    files = words.delivered(diagnosis)
    return one.first.action or (f"Use {files[0]}" if files and one.answer == "found" else "")


def _numbers(finding: Finding) -> Numbers:
    lines = [f"Share of the cross-validated training error it removes: {100 * finding.gain:.0f} %."]
    if finding.answer in ("found", "ambiguous"):
        lines.append(
            f"Probability {finding.probability:.2f}: its share of the evidence among its rivals, "
            "calibrated on simulated cases."
        )
    limit = words.shows_from(finding)
    lines += [f"Would have shown from {limit}."] if limit else []
    lines.append("Ranges: block bootstrap, 95 %.")
    return Numbers(finding.title, EQUATIONS.get(finding.effect, ""), tables.numbers(finding), tuple(lines))
