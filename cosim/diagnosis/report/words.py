"""The sentences of the report and the terminal: mechanic first, one meaning a word."""

from dataclasses import dataclass

from cosim.diagnosis.report.quantities import Scales
from cosim.diagnosis.result import Diagnosis, Finding
from cosim.pictures.quantities import joined, number, raised, trimmed

COUNTS = ("No", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine", "Ten")
ANSWERS = {
    "found": "Found",
    "ambiguous": "Possible cause",
    "not_proven": "Not proven",
    "not_seen": "Not seen",
    "not_testable": "Cannot be tested",
    "unknown": "Unknown",
}
MEANINGS = (
    ("found", "Found", "The 95 % range excludes zero, the error on unseen runs falls, and every rival fits worse."),
    (
        "ambiguous",
        "Two possible causes",
        "The rivals are too close to separate. Neither goes into the improved model, unless one is a special case of "
        "the other, which predicts alike.",
    ),
    ("not_proven", "Not proven", "It fits better, but not on runs the fit never saw."),
    ("not_seen", "Not seen", "It would have shown from the size given."),
    ("not_testable", "Cannot be tested", "The recordings lack the condition given; it says how to record it."),
    ("unknown", "Unknown", "Error above the noise that no known effect lowers."),
)


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
        return "finding-" + "".join(letter for letter in self.first.effect if letter.isalnum() or letter == "_")


def count(number: int) -> str:
    """Return a small number as a word that starts a sentence."""
    return COUNTS[number] if number < len(COUNTS) else str(number)


def law(diagnosis: Diagnosis) -> str:
    """Return the sentence on the base's friction law, empty where no other one is proposed."""
    told = diagnosis.friction_law
    if not told.get("proposed") or told["proposed"] == told.get("base"):
        return ""
    share = f"{100 * float(told['gain']):.0f} %"
    return (
        f"Friction law: {told['proposed']} in place of {told['base']} would remove up to {share} of the error "
        "energy that is left. This is no missing effect."
    )


def verdict(diagnosis: Diagnosis) -> str:
    """Return "found", "either" (only rivals), "unknown" or "none"."""
    if "unknown" in diagnosis.verdict:
        return "unknown"
    answers = {finding.answer for finding in diagnosis.findings}
    return "found" if "found" in answers else "either" if "ambiguous" in answers else "none"


def blocks(diagnosis: Diagnosis) -> tuple[Block, ...]:
    """Group the findings that have something to say: found, rivals together, not proven; ranked as they came."""
    grouped: list[Block] = []
    taken: set[str] = set()
    for finding in diagnosis.findings:
        if finding.answer in ("not_seen", "not_testable") or finding.effect in taken:
            continue
        rivals = (finding,) if finding.answer != "ambiguous" else _rivals(finding, diagnosis)
        taken |= {rival.effect for rival in rivals}
        grouped.append(_block(rivals))
    order = {"found": 0, "ambiguous": 1}
    return tuple(sorted(grouped, key=lambda block: order.get(block.answer, 2)))


def _rivals(finding: Finding, diagnosis: Diagnosis) -> tuple[Finding, ...]:
    group = next((group for group in diagnosis.ambiguous_with if finding.effect in group), (finding.effect,))
    others = (other for other in diagnosis.findings if other.effect in group and other.effect != finding.effect)
    return (finding, *(other for other in others if other.answer == "ambiguous"))


def _block(findings: tuple[Finding, ...]) -> Block:
    first = findings[0]
    if len(findings) == 1:
        return Block(first.title, first.answer, ANSWERS.get(first.answer, first.answer), findings)
    title = " or ".join([first.title, *(lowered(rival.title) for rival in findings[1:])])
    return Block(title, first.answer, f"{count(len(findings))} possible causes", findings)


def model(diagnosis: Diagnosis) -> str:
    """Name the file that something is missing from: the FMU that is the base, or the card."""
    made = diagnosis.provenance
    return str(made.get("base_fmu", "")).split(" (")[0] or str(made.get("card", {}).get("name", ""))


def heading(diagnosis: Diagnosis) -> str:
    """Return the verdict as a heading."""
    found = sum(finding.answer == "found" for finding in diagnosis.findings)
    many = f"{count(found)} effect{'s are' if found != 1 else ' is'} missing from the model"
    match verdict(diagnosis):
        case "unknown":
            return f"{many}, and something unknown" if found else _BESIDE_RIVALS if _named(diagnosis) else _UNKNOWN
        case "either":
            return "Something is missing, with more than one possible cause"
        case "none":
            return f"Nothing missing that {_these(diagnosis)} can show"
    return many


_UNKNOWN = "Something is missing, and it is none of the effects cosim knows"
_BESIDE_RIVALS = "Something is missing, with more than one possible cause, and something unknown"


def _named(diagnosis: Diagnosis) -> bool:
    """Whether the verdict names an effect, be it one of several rivals."""
    return any(name != "unknown" for name in diagnosis.verdict)


def _these(diagnosis: Diagnosis) -> str:
    return "this recording" if len(diagnosis.traces) == 1 else "these recordings"


def lead(diagnosis: Diagnosis, scales: Scales) -> list[str]:
    """Return two to four plain sentences below the heading."""
    return [sentence for sentence in _LEADS[verdict(diagnosis)](diagnosis, scales) if sentence]


def _found(diagnosis: Diagnosis, scales: Scales) -> list[str]:
    found = [block for block in blocks(diagnosis) if block.answer == "found"]
    said = [closed(block.first.statement or f"{block.title} acts on the machine") for block in found[:3]]
    has = "The simulation does not have it." if len(found) == 1 else "The simulation has neither."
    has = has if len(found) < 3 else "The simulation has none of them."
    return [*said, has, _either(diagnosis, "A further error"), improvement(diagnosis, scales)]


def _rival(diagnosis: Diagnosis, scales: Scales) -> list[str]:
    held, unit = diagnosis.heldout, scales.torque
    before, after, noise = (unit.number(value) for value in (held.before_rms, held.after_rms, held.floor_rms))
    error = f"On unseen runs the error is {joined(before, unit.unit)}, with the likeliest cause {after}, noise {noise}."
    return [_either(diagnosis, "The error"), error, "No improved model was written."]


def _either(diagnosis: Diagnosis, subject: str) -> str:
    """Name the first set of rivals."""
    sets = [block for block in blocks(diagnosis) if block.answer == "ambiguous"]
    if not sets:
        return ""
    causes = " or ".join(lowered(rival.title) for rival in sets[0].findings)
    if len(sets[0].findings) == 1:
        return f"{subject} may come from {causes}; that is not certain."
    return f"{subject} has {count(len(sets[0].findings)).lower()} possible causes: {causes}."


def _nothing(diagnosis: Diagnosis, scales: Scales) -> list[str]:
    held = diagnosis.heldout
    error, noise = scales.torque.text(held.before_rms), scales.torque.text(held.floor_rms)
    near = "to within the noise" if held.before_rms <= 1.25 * held.floor_rms else "as well as any known effect can"
    proven = [block.title for block in blocks(diagnosis) if block.answer == "not_proven"]
    fits = f"{' and '.join(proven)}: fits better, but not on unseen runs." if proven else ""
    first = f"The refitted simulation matches the machine {near} on runs it never saw ({error} error, {noise} noise)."
    return [first, fits, "No improved model was written."]


def _unknown(diagnosis: Diagnosis, scales: Scales) -> list[str]:
    """Say what was named, that the others are not the rest, and where the rest goes."""
    named, found = _named(diagnosis), [block for block in blocks(diagnosis) if block.answer == "found"]
    said = [closed(block.first.statement) for block in found[:3]]
    own = next((finding.statement for finding in diagnosis.findings if finding.effect == "unknown"), "")
    others = [f for f in diagnosis.findings if f.effect != "unknown" and f.answer in ("not_seen", "not_proven")]
    none = f"None of the {len(others)} {'other ' if named else ''}known effects that could be tested "
    none += "explains the rest." if named else "lowers it."
    written = "" if found else "No improved model was written."
    return [*said, _either(diagnosis, "The error"), closed(own), _numbers(diagnosis, scales), none, written]


_LEADS = {"found": _found, "either": _rival, "none": _nothing, "unknown": _unknown}


def _numbers(diagnosis: Diagnosis, scales: Scales) -> str:
    held, unit = diagnosis.heldout, scales.torque
    return f"The error on unseen runs is {unit.text(held.after_rms)} against {unit.text(held.floor_rms)} of noise."


def improvement(diagnosis: Diagnosis, scales: Scales) -> str:
    """Return the held-out proof in one sentence."""
    held, unit = diagnosis.heldout, scales.torque
    before, noise = unit.number(held.before_rms), unit.number(held.floor_rms)
    verb = "falls" if held.confidence_interval[0] > 0 else "does not clearly fall:"
    return f"On unseen runs the error {verb} from {before} to {unit.text(held.after_rms)}; noise is {noise}."


def delivered(diagnosis: Diagnosis) -> tuple[str, ...]:
    """List the files of the better model, the one to use first: beside an FMU of another team its correction."""
    made = diagnosis.improved
    names = ("correction", "ssp") if "correction" in made else ()
    return tuple(str(made[name]) for name in (*names, "fmu", "card") if made.get(name))


def left_out(diagnosis: Diagnosis) -> list[str]:
    """Say what a correction lacks, and why there is no SSP."""
    made = diagnosis.improved
    titles = {finding.effect: lowered(finding.title) for finding in diagnosis.findings}
    names = [titles.get(name, str(name)) for name in made.get("not_in_correction", ())]
    said = [f"No torque can give {' and '.join(names)}: that is in the card only."] if names else []
    return said + ([f"There is no SSP: {closed(str(made['no_ssp']))}"] if made.get("no_ssp") else [])


def proven_range(diagnosis: Diagnosis, scales: Scales) -> str:
    """Return where the improved model is proven, for example "from 20 to 90°/s"; empty if unknown."""
    said = []
    for name, scale in (("speed", scales.speed), ("position", scales.position)):
        ends = diagnosis.improved.get(name)
        if isinstance(ends, (list, tuple)) and len(ends) == 2:
            said.append(f"from {scale.span(float(ends[0]), float(ends[1]))}")
    return " and ".join(said)


def shows_from(finding: Finding) -> str:
    """Return the smallest size that would have shown, with the unit of the size."""
    if finding.visible_from is None:
        return ""
    size = joined(trimmed(number(finding.visible_from)), unit_of(finding))
    return f"{size} {finding.evidence}" if finding.answer == "not_seen" and finding.evidence else size


def unit_of(finding: Finding) -> str:
    """Return the unit of the main number."""
    text = finding.size.replace("\N{NO-BREAK SPACE}", " ").strip()
    if text:
        return raised(text.lstrip("+-−0123456789.,e ").strip())
    return raised(next(iter(finding.units.values()), "").removeprefix("1"))


def lowered(title: str) -> str:
    """Return a title as it reads inside a sentence; names and abbreviations keep their capitals."""
    return title if len(title) > 1 and title[1].isupper() else title[:1].lower() + title[1:]


def started(sentence: str) -> str:
    """Return a sentence that begins as one."""
    return sentence[:1].upper() + sentence[1:]


def either(sentences: list[str]) -> list[str]:
    """Return statements of which one is true, if several, as such."""
    told = [text for text in sentences if text]
    return [f"Either: {told[0]}", *(f"Or: {text}" for text in told[1:])] if len(told) > 1 else told


def closed(sentence: str) -> str:
    """Return a sentence that ends as one."""
    text = sentence.strip()
    return text if not text or text.endswith((".", "!", "?")) else text + "."
