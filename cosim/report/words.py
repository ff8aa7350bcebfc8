"""The sentences of the report and the terminal: mechanic first, one meaning a word."""

import re
from dataclasses import dataclass

import numpy as np

from cosim.diagnosis.answer.result import Diagnosis, Finding
from cosim.plots.quantities import decimals, joined, minus, number, raised, scale_of, spelled, trimmed
from cosim.report.quantities import Scales

COUNTS = ("No", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine", "Ten")
ANSWERS = {
    "found": "Detected",
    "ambiguous": "Possible",
    "not_proven": "Not confirmed",
    "not_decided": "Not decided",
    "not_seen": "Not detected",
    "not_testable": "Not testable",
    "unknown": "Unknown",
}
ABSENT = {"not_seen": "not detected", "not_decided": "not decided", "not_testable": "not testable here"}
"""Answers about effects of which nothing is shown, in words."""
MEANINGS = (
    (
        "found",
        "Detected",
        "The validation error falls, and every rival fits worse. Its probability is 0.5 or more.",
    ),
    (
        "ambiguous",
        "Possible",
        "The validation error falls, but its probability is below 0.5 or its size is not determined. The improved "
        "model does not hold it, unless you ask with --with-possible.",
    ),
    (
        "ambiguous",
        "Two possible causes",
        "The rivals are too close to separate. The improved model holds the one named first, which is the likelier.",
    ),
    (
        "not_proven",
        "Not confirmed",
        "It fits better in training, but not on validation runs, or something outside the catalogue fits better still.",
    ),
    ("not_decided", "Not decided", "Another effect explains more instead."),
    ("not_seen", "Not detected", "It would have been detected from the size given (upper limit)."),
    ("not_testable", "Not testable", "The recordings lack the condition given; it says how to record it."),
    ("unknown", "Unknown", "Error above the noise that no known effect lowers."),
)


REMARKS = frozenset(
    (
        "base_far_from_card",
        "encoder_step",
        "half_sample",
        "end_stop",
        "little_motion",
        "own_torque",
        "own_set_point",
        "no_set_point",
        "not_determined",
        "single_readings",
    )
)
"""Doubts that only say what would make the answer better; all others are read before it."""


@dataclass(frozen=True)
class Block:
    """What the reader sees as one finding: an effect, or several that cannot be told apart."""

    title: str
    answer: str
    word: str
    findings: tuple[Finding, ...]

    @property
    def first(self) -> Finding:
        """The likeliest finding."""
        return self.findings[0]

    @property
    def anchor(self) -> str:
        """The place of the block in the page."""
        return "finding-" + "".join(letter for letter in self.first.name if letter.isalnum() or letter == "_")


NAMES = ("Stribeck",)
"""Names of people with which titles begin."""
FROM = "from "
"""Begins what is said of an effect whose number is no size of it, but grows with it."""
SEEN = 0.05
"""Share of the residual energy that an effect must hold to be seen."""


def count(number: int) -> str:
    """Return a small number as a word that starts a sentence."""
    return COUNTS[number] if number < len(COUNTS) else str(number)


def law(diagnosis: Diagnosis) -> str:
    """Return the sentence on the base's friction law, empty where no other one is proposed and no curve would help."""
    told, other = diagnosis.friction_law, ""
    gain, curve = told.get("gain", 0.0), told.get("curve", 0.0)
    if gain:
        other = f"{told['proposed']} instead of {told['base']}"
    if curve > gain:
        other, gain = f"a curve over speed that is not that of {told['base']}", curve
    less = f"would reduce the residual variance by up to {100 * gain:.0f} %; not counted as a missing effect."
    return f"Friction law: {other} {less}" if other else ""


def verdict(diagnosis: Diagnosis) -> str:
    """Return "withheld", "found", "either" (only rivals), "unknown" or "none"."""
    if any(one.blocks_naming for one in diagnosis.sanity):
        return "withheld"
    if "unknown" in diagnosis.verdict:
        return "unknown"
    answers = {finding.answer for finding in diagnosis.findings}
    return "found" if "found" in answers else "either" if "ambiguous" in answers else "none"


def blocks(diagnosis: Diagnosis) -> tuple[Block, ...]:
    """Group the findings that have something to say: found, rivals together, not proven; ranked as they came."""
    grouped: list[Block] = []
    taken: set[str] = set()
    for finding in diagnosis.findings:
        if finding.answer in ABSENT or finding.name in taken:
            continue
        rivals = (finding,) if finding.answer != "ambiguous" else _rivals(finding, diagnosis)
        taken |= {rival.name for rival in rivals}
        grouped.append(_block(rivals))
    order = {"found": 0, "ambiguous": 1}
    return tuple(sorted(grouped, key=lambda block: order.get(block.answer, 2)))


def _rivals(finding: Finding, diagnosis: Diagnosis) -> tuple[Finding, ...]:
    group = next((group for group in diagnosis.ambiguous_with if finding.name in group), (finding.name,))
    others = (other for other in diagnosis.findings if other.name in group and other.name != finding.name)
    several = (finding, *(other for other in others if other.answer == "ambiguous"))
    return tuple(sorted(several, key=lambda one: (one not in diagnosis.in_model, -one.probability)))


def _block(findings: tuple[Finding, ...]) -> Block:
    first = findings[0]
    if len(findings) == 1:
        return Block(first.title, first.answer, ANSWERS.get(first.answer, first.answer), findings)
    title = " or ".join([first.title, *(lowered(rival.title) for rival in findings[1:])])
    return Block(title, first.answer, f"{count(len(findings))} possible causes", findings)


def doubts(diagnosis: Diagnosis) -> tuple[list[str], list[str], list[str]]:
    """Return alarms, which keep effects from being named; other doubts to read before the answer; remarks for after."""
    alarms = [one.statement for one in diagnosis.sanity if one.blocks_naming]
    others = [one for one in diagnosis.sanity if not one.blocks_naming]
    graver, remarks = (
        [one.statement for one in others if (one.finding in REMARKS) is is_remark] for is_remark in (False, True)
    )
    return alarms, graver, remarks


def model(diagnosis: Diagnosis) -> str:
    """Name the file that something is missing from: the FMU that is the base, or the card."""
    made = diagnosis.provenance
    return str(made.get("base_fmu", "")).split(" (")[0] or str(made.get("card", {}).get("name", ""))


def machine(diagnosis: Diagnosis) -> str:
    """Return the kind of machine that the card names; empty where it names none."""
    return diagnosis.provenance.get("card", {}).get("machine", "")


def delivered(diagnosis: Diagnosis) -> tuple[str, ...]:
    """List the files of the better model, the one to use first: beside an FMU of another team its correction."""
    made = diagnosis.improved
    beside = (made["correction"], made.get("ssp", "")) if "correction" in made else ()
    return tuple(name for name in (*beside, made.get("fmu", ""), made.get("card", "")) if name)


def left_out(diagnosis: Diagnosis) -> list[str]:
    """Say what a correction lacks, and why there is no SSP."""
    made = diagnosis.improved
    titles = {finding.name: lowered(finding.title) for finding in diagnosis.findings}
    names = [titles.get(name, str(name)) for name in made.get("not_in_correction", ())]
    said = [f"A torque cannot stand for {' and '.join(names)}: that is in the card only."] if names else []
    return said + ([f"There is no SSP: {closed(str(made['no_ssp']))}"] if made.get("no_ssp") else [])


def proven_range(diagnosis: Diagnosis, scales: Scales) -> str:
    """Return where the improved model is proven, for example "from 20 to 90°/s"; empty if unknown."""
    said = []
    made = diagnosis.improved
    for ends, scale in ((made.get("speed"), scales.speed), (made.get("position"), scales.position)):
        if ends:
            said.append(f"from {scale.span(*ends)}")
    return " and ".join(said)


def sized(finding: Finding) -> tuple[str, str]:
    """Return size and its 95 % range as they are printed: angles and lengths in a unit that needs no zeros.

    What held-out recordings do not confirm has none: the size that training alone would give it may be any.
    """
    if finding.answer == "not_proven":
        return "", ""
    size = re.fullmatch(r"([-−\d.e+]+) (rad|m)", finding.size)
    if not size:
        long = r"(?<![\w.,])\d{5,}(?![\w,])"  # with separators, as those of tables have
        size_range = re.sub(long, lambda found: f"{int(found[0]):,}", finding.size_range)
        return spelled(minus(finding.size)), spelled(minus(size_range))
    scale = scale_of(size[2], abs(_value(size[1])))
    ends = tuple(_value(end) * scale.factor for end in finding.size_range.split(" to ") if end)
    return scale.text(_value(size[1]), 3), " to ".join(decimals(ends, 3))


def in_handy_units(text: str) -> str:
    """Return a sentence whose angles, lengths and speeds in SI units are in units that need no zeros."""
    return re.sub(r"(?<![\w.])(\d[\d.]*(?:e[-+]?\d+)?) (rad/s|m/s|rad|m)(?![\w·/])", _handy, text)


def _handy(found: re.Match[str]) -> str:
    value = _value(found[1])
    return scale_of(found[2], abs(value)).text(value)


def stated(finding: Finding) -> str:
    """Return the plain sentence of a finding."""
    return closed(minus(spelled(in_handy_units(finding.statement))))


def _value(text: str) -> float:
    return float(text.replace("−", "-"))


def shows_from(finding: Finding) -> str:
    """Return the smallest size that would have shown, with the unit of the size."""
    if finding.visible_from is None:
        return ""
    unit = unit_of(finding)
    size = joined(trimmed(number(finding.visible_from)), unit)
    if unit in ("rad", "m"):
        size = scale_of(unit, abs(finding.visible_from)).text(finding.visible_from)
    return f"{size} {finding.evidence}" if finding.answer == "not_seen" and finding.evidence else size


def limit(finding: Finding) -> str:
    """Return from which size, or of what kind, an effect would have shown: "8.3 ms", "wider than 3 mm"."""
    return spelled(in_handy_units(shows_from(finding) or finding.evidence.removeprefix(FROM)))


def unit_of(finding: Finding) -> str:
    """Return the unit of the main number."""
    text = finding.size.replace("\N{NO-BREAK SPACE}", " ").strip()
    if text:
        return raised(text.lstrip("+-−0123456789.,e ").strip())
    return raised(next(iter(finding.units.values()), "").removeprefix("1"))


def lowered(title: str) -> str:
    """Return a title as it reads inside a sentence; names and abbreviations keep their capitals."""
    keeps = title.startswith(NAMES) or title[1:2].isupper()
    return title if keeps else title[:1].lower() + title[1:]


def started(sentence: str) -> str:
    """Return a sentence that begins as one."""
    return sentence[:1].upper() + sentence[1:]


def unseen_torque(diagnosis: Diagnosis, scales: Scales) -> str:
    """Return the torque, RMS, with which any effect would have been seen, whatever its own number means."""
    left = [trace.tau - trace.after for trace in diagnosis.traces if not trace.heldout]
    judged = np.concatenate(left) if left else np.empty(0)
    size = float(np.sqrt(np.nanmean(judged**2) * SEEN / (1 - SEEN))) if judged.size else 0.0
    return f"{scales.torque.text(size)} RMS" if size else ""


def others(diagnosis: Diagnosis, limits: str) -> str:
    """Count the effects of which nothing is shown, by answer; `limits` says behind the first where theirs are."""
    answers = [one.answer for one in diagnosis.findings]
    counts = [f"{answers.count(answer)} {said}" for answer, said in ABSENT.items() if answer in answers]
    if not counts:
        return ""
    many, _, first = counts[0].partition(" ")
    return "; ".join([f"{many} other effect{'' if many == '1' else 's'}: {first}{limits}", *counts[1:]])


def either(sentences: list[str]) -> list[str]:
    """Return statements of which one is true, if several, as such."""
    told = [text for text in sentences if text]
    return [f"Either: {told[0]}", *(f"Or: {text}" for text in told[1:])] if len(told) > 1 else told


def closed(sentence: str) -> str:
    """Return a sentence that ends as one."""
    text = sentence.strip()
    return text if not text or text.endswith((".", "!", "?")) else text + "."
