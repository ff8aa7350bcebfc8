"""The diagnosis on a terminal: plain text, 80 columns, colour never needed."""

import textwrap
from collections.abc import Sequence
from pathlib import Path

from cosim.diagnosis.answer.result import Diagnosis, Finding
from cosim.diagnosis.decide.calibration import LIKELY
from cosim.plots.quantities import spelled
from cosim.report import words
from cosim.report.findings import do, untrained, where
from cosim.report.lead import heading, in_motion
from cosim.report.next_experiment import to_record
from cosim.report.quantities import Scales
from cosim.report.words import Block, delivered, lowered

WIDTH = 80
REPORT = "report.html"
WORDS = {answer: words.ANSWERS[answer].lower() for answer in ("found", "ambiguous", "not_proven")}
NAME, SIZE, RANGE = 21, 12, 16
REMARKS = 3
"""Remarks on recordings and card that the terminal prints."""
ORDER = 10
"""Columns of what to do, before the text."""


def summary(diagnosis: Diagnosis, out: Path | None = None) -> str:
    """Return the whole answer as lines of at most 80 columns: the verdict, what to do, which file to open, the rest.

    Args:
        diagnosis: the answer.
        out: folder of its files, where they were written.
    """
    scales = Scales.of(diagnosis)
    title, goes = printable(_title(diagnosis)), ", ".join(diagnosis.depends_on)
    limits = "the report" if REPORT in diagnosis.files else "diagnosis.json"
    parts = [
        textwrap.wrap(title, WIDTH),
        _doubts(diagnosis),
        [line for block in words.blocks(diagnosis) for line in _to_do(block, diagnosis)],
        _files(diagnosis, scales, out),
        [""],
        [line for block in words.blocks(diagnosis) for line in _block(block, scales)],
        _wrapped(diagnosis.broadband.get("statement", ""), 2),
        _wrapped(f"The remaining error correlates with: {goes}" if goes else "", 2),
        _wrapped(untrained(diagnosis, scales), 2) if "unknown" in diagnosis.verdict else [],
        _wrapped(words.others(diagnosis, f", limits in {limits}"), 2),
        _wrapped(spelled(diagnosis.learned.get("statement", "") or diagnosis.not_learned.get("statement", "")), 0),
        _formulas(diagnosis),
        _wrapped(words.law(diagnosis), 0),
        _error(diagnosis, scales),
        _remarks(diagnosis, out),
        _next(diagnosis),
        _wrote(diagnosis),
    ]
    return "\n".join(line for part in parts for line in part)


def _doubts(diagnosis: Diagnosis) -> list[str]:
    """Return what to read before the answer, what keeps effects from being named first."""
    alarms, others, _ = words.doubts(diagnosis)
    marked = [("Careful", text) for text in alarms] + [("Note", text) for text in others]
    return [line for word, text in marked for line in _ordered(word, text)]


def _remarks(diagnosis: Diagnosis, out: Path | None) -> list[str]:
    """Return the first remarks on recordings and card; where there is a report, it holds the others."""
    remarks = words.doubts(diagnosis)[2]
    shown = remarks[:REMARKS] if out and REPORT in diagnosis.files else remarks
    rest = len(remarks) - len(shown)
    more = [f"{rest} more remark{'s' if rest > 1 else ''} in {REPORT}"] if rest else []
    return [line for text in (*shown, *more) for line in _ordered("Note", text)]


def _ordered(word: str, text: str) -> list[str]:
    """Return a word and what it is about, set off to the right of it."""
    margin = " " * ORDER
    return textwrap.wrap(printable(f"{word:<{ORDER}}{text}"), WIDTH, subsequent_indent=margin)


def _to_do(block: Block, diagnosis: Diagnosis) -> list[str]:
    """Return what to do about a finding."""
    action = do(block, diagnosis) if block.answer != "not_proven" else ""
    return _ordered("Do", f"{block.title}: {action[:1].lower()}{action[1:]}") if action else []


def _files(diagnosis: Diagnosis, scales: Scales, out: Path | None) -> list[str]:
    """Return which file to open, and which model to use where."""
    lines = _ordered("Open", str(out / REPORT)) if out and REPORT in diagnosis.files else []
    proven, files = words.proven_range(diagnosis, scales), delivered(diagnosis)
    suffix = f" (proven {proven})" if proven else ""
    return lines + (_ordered("Use", files[0] + suffix) if files else [])


def _title(diagnosis: Diagnosis) -> str:
    card = words.model(diagnosis) or diagnosis.mount
    title = heading(diagnosis, card)
    return title if card in title else f"{title} ({card})"


def _block(block: Block, scales: Scales) -> list[str]:
    """Return one row, or one a rival, joined by "or"."""
    if len(block.findings) == 1:
        return _row(WORDS.get(block.answer, block.answer), block.first, scales)
    is_likely = sum(one.probability for one in block.findings) >= LIKELY
    first = _row("either" if is_likely else WORDS["ambiguous"], block.first, scales)
    others = (f"or {lowered(one.title)}, probability {one.probability:.2f}" for one in block.findings[1:])
    return first + [line for text in others for line in _wrapped(text, 12)]


def _row(word: str, finding: Finding, scales: Scales) -> list[str]:
    """Return answer, name and size with its range of a finding, and below it probability and place."""
    likely = f"probability {finding.probability:.2f}" if finding.answer in ("found", "ambiguous") else ""
    size, size_range = words.sized(finding)
    columns = f"  {word:<9} {lowered(finding.title):<{NAME}} {size:<{SIZE}} {size_range:<{RANGE}}"
    first = textwrap.wrap(printable(columns.rstrip()), WIDTH, subsequent_indent=" " * 12) or [""]
    return first + _wrapped(", ".join(text for text in (likely, where(finding, scales)) if text), 12)


def _wrapped(text: str, indent: int) -> list[str]:
    margin = " " * indent
    return textwrap.wrap(printable(text), WIDTH, initial_indent=margin, subsequent_indent=margin)


def _formulas(diagnosis: Diagnosis) -> list[str]:
    """Return each closed form that is as good on unseen recordings as what was learned, with its numbers."""
    lines = []
    for one in diagnosis.learned.get("formula", ()):
        parameters = {name: f"{number['value']:.3g} {number['unit']}" for name, number in one["parameters"].items()}
        numbers = ", ".join(f"{name} {text.removesuffix(' 1')}" for name, text in parameters.items())
        lines += _wrapped(f"As good, and shorter: {one['equation']}; {numbers}", 0)
    return lines


def proposed(diagnosis: Diagnosis, files: Sequence[Path]) -> str:
    """Say where the formulas were written as effects, or why there is nothing to propose."""
    if files:
        return f"Proposed, for you to review: {', '.join(map(str, files))}; no model holds it."
    if diagnosis.learned:
        return "Nothing to propose: no formula is as good as what was learned."
    unknown = "unknown" in diagnosis.verdict
    reason = "nothing was learned outside the catalogue" if unknown else "nothing is left outside the catalogue"
    return f"Nothing to propose: {reason}."


def _error(diagnosis: Diagnosis, scales: Scales) -> list[str]:
    held, unit = diagnosis.heldout, scales.torque
    before, after, noise = (unit.number(x) for x in (held.before_rms, held.after_rms, held.floor_rms))
    added = len({finding.name for finding in diagnosis.in_model})
    improved = f" → {after} (with the effect{'s' if added > 1 else ''})" if added else ""
    improved = f" → {after} (with what was learned)" if diagnosis.learned else improved
    possible = f"; {unit.number(held.possible_rms)} with what is only possible" if held.possible_rms is not None else ""
    text = f"Validation RMS error [{unit.unit}]: {before} (refitted card){improved}{possible}; noise floor {noise}"
    return _wrapped(text + in_motion(diagnosis.heldout, scales), 0)


def _next(diagnosis: Diagnosis) -> list[str]:
    """Return the one experiment that would tell more, and its command."""
    plan = diagnosis.next_experiment
    said = [to_record(diagnosis)] if plan.get("description") else []
    said += [f"cosim run {plan['scenario']} --out next"] if plan.get("scenario") else []
    said += [str(plan["command"])] if plan.get("command") else []
    return _wrapped("Next: " + ", then: ".join(said), 0) if said else []


def _wrote(diagnosis: Diagnosis) -> list[str]:
    names = [*diagnosis.files, *reversed(delivered(diagnosis))]
    lines = [f"Wrote {' '.join(names)}" if names else "", *words.left_out(diagnosis)]
    return [line for text in lines for line in _wrapped(text, 0)]


def printable(text: str) -> str:
    """Return text without control characters: a name in a file must not steer the terminal."""
    return "".join(letter if letter.isprintable() else " " for letter in text)
