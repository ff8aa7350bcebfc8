"""The diagnosis on a terminal: plain text, 80 columns, colour never needed."""

import os
import sys
import textwrap
from typing import TextIO

from cosim.diagnosis.report.quantities import Scales
from cosim.diagnosis.report.words import (
    Block,
    blocks,
    delivered,
    heading,
    law,
    left_out,
    lowered,
    model,
    proven_range,
    shows_from,
    verdict,
)
from cosim.diagnosis.result import Diagnosis, Finding

WIDTH = 80
WORDS = {"found": "FOUND", "not_proven": "unproven", "ambiguous": "MAYBE"}
NAME, SIZE, RANGE = 21, 12, 16


def summary(diagnosis: Diagnosis, bold: bool = False) -> str:
    """Return the whole answer as lines of at most 80 columns; `bold` marks the verdict with an ANSI code."""
    scales = Scales.of(diagnosis)
    title = printable(_title(diagnosis))
    parts = [
        [f"\033[1m{line}\033[0m" if bold else line for line in textwrap.wrap(title, WIDTH)],
        [line for block in blocks(diagnosis) for line in _block(block)],
        _goes_with(diagnosis),
        _rest(diagnosis),
        _wrapped(law(diagnosis), 0),
        _error(diagnosis, scales),
        _next(diagnosis),
        _wrote(diagnosis, scales),
    ]
    return "\n".join(line for part in parts for line in part)


def print_summary(diagnosis: Diagnosis, stream: TextIO | None = None) -> None:
    """Print the summary; bold only on a terminal that wants it (NO_COLOR, TERM=dumb)."""
    out = stream or sys.stdout
    text = summary(diagnosis, bold=styled(out))
    encoding = getattr(out, "encoding", None) or "utf-8"
    print(text.encode(encoding, "replace").decode(encoding), file=out)


def styled(stream: TextIO) -> bool:
    """Return whether a stream is a terminal that takes ANSI codes."""
    return stream.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def _title(diagnosis: Diagnosis) -> str:
    card = model(diagnosis) or diagnosis.mount
    found = sum(finding.answer == "found" for finding in diagnosis.findings)
    if verdict(diagnosis) == "found":
        return f"{found} effect{'s are' if found != 1 else ' is'} missing from {card}"
    return f"{heading(diagnosis)} ({card})"


def _block(block: Block) -> list[str]:
    """Return one row, or one a rival, joined by "or"."""
    if len(block.findings) == 1:
        return _row(WORDS.get(block.answer, block.answer), block.first)
    first = _row("EITHER", block.first)
    return first + [line for rival in block.findings[1:] for line in _wrapped(f"or {lowered(rival.title)}", 12)]


def _row(word: str, finding: Finding) -> list[str]:
    name = lowered(finding.title)
    where = finding.where.description if finding.where else ""
    columns = f"  {word:<9} {name:<{NAME}} {finding.size:<{SIZE}} {finding.size_range:<{RANGE}} {where}"
    return textwrap.wrap(printable(columns.rstrip()), WIDTH, subsequent_indent=" " * 12, drop_whitespace=True) or [""]


def _wrapped(text: str, indent: int) -> list[str]:
    margin = " " * indent
    return textwrap.wrap(printable(text), WIDTH, initial_indent=margin, subsequent_indent=margin)


def _goes_with(diagnosis: Diagnosis) -> list[str]:
    """Return on what an unknown rest depends."""
    return _wrapped(f"The rest goes with: {', '.join(diagnosis.depends_on)}", 2) if diagnosis.depends_on else []


def _rest(diagnosis: Diagnosis) -> list[str]:
    """Return what was not seen, with the size that would have shown, and what could not be tested."""
    lines: list[str] = []
    for answer, word in (("not_seen", "not seen"), ("not_testable", "no test")):
        chosen = [finding for finding in diagnosis.findings if finding.answer == answer]
        text = ", ".join(_limit(finding) for finding in chosen)
        if text:
            lines += textwrap.wrap(f"  {word:<9} {printable(text)}", WIDTH, subsequent_indent=" " * 12)
    return lines


def _limit(finding: Finding) -> str:
    from_size = shows_from(finding).replace("\N{NO-BREAK SPACE}", " ")
    limit = f"< {from_size}" if from_size else finding.evidence if finding.answer == "not_testable" else ""
    return lowered(finding.title) + (f" ({limit.rstrip('.')})" if limit else "")


def _error(diagnosis: Diagnosis, scales: Scales) -> list[str]:
    held, unit = diagnosis.heldout, scales.torque
    before, after, noise = (unit.number(x) for x in (held.before_rms, held.after_rms, held.floor_rms))
    found = sum(finding.answer == "found" for finding in diagnosis.findings)
    improved = f" with the effect{'s' if found > 1 else ''} {after}," if found else ""
    return _wrapped(
        f"Error on the recording not fitted, RMS [{unit.unit}]: refitted {before},{improved} noise {noise}", 0
    )


def _next(diagnosis: Diagnosis) -> list[str]:
    """Return the one experiment that would tell more, and its command."""
    plan = diagnosis.next_experiment
    said = [str(plan["description"])] if plan.get("description") else []
    said += [f"cosim run {plan['scenario']} --out next"] if plan.get("scenario") else []
    said += [str(plan["command"])] if plan.get("command") else []
    return _wrapped("Next: " + ", then: ".join(said), 0) if said else []


def _wrote(diagnosis: Diagnosis, scales: Scales) -> list[str]:
    files = ["report.html", *reversed(delivered(diagnosis))]
    proven = proven_range(diagnosis, scales)
    suffix = f" (proven {proven.removeprefix('from ')})" if proven and len(files) > 1 else ""
    lines = [f"Wrote {' '.join(files)}{suffix}", *left_out(diagnosis)]
    return [line for text in lines for line in _wrapped(text, 0)]


def printable(text: str) -> str:
    """Return text without control characters: a name in a file must not steer the terminal."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


__all__ = ["print_summary", "printable", "styled", "summary"]
