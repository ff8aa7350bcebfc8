"""The first sentences: the verdict as a heading, and what must be said below it."""

from cosim.diagnosis.report.quantities import Scales
from cosim.diagnosis.report.words import Block, blocks, count, lowered, stated, verdict
from cosim.diagnosis.result import Diagnosis
from cosim.plots.quantities import joined

SURE = 0.8
"""Probability from which an effect that was found needs no word of doubt."""
LED = 3
"""Findings whose statement stands in the lead; of further ones it stands with the finding."""


def heading(diagnosis: Diagnosis) -> str:
    """Return the verdict as a heading."""
    found = sum(finding.answer == "found" for finding in diagnosis.findings)
    many = f"{count(found)} effect{'s are' if found != 1 else ' is'} missing from the model"
    match verdict(diagnosis):
        case "withheld":
            return "Check the recordings first: no effect can be named"
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
    said = [_stated(block) for block in found[:LED]]
    has = "The simulation does not have it." if len(found) == 1 else "The simulation has neither."
    has = has if len(found) < 3 else "The simulation has none of them."
    return [*said, has, *_doubts(found), _either(diagnosis, "A further error"), improvement(diagnosis, scales)]


def _rival(diagnosis: Diagnosis, scales: Scales) -> list[str]:
    held, unit = diagnosis.heldout, scales.torque
    before, after, noise = (unit.number(value) for value in (held.before_rms, held.after_rms, held.floor_rms))
    error = f"On unseen runs the error is {joined(before, unit.unit)}, with the likeliest cause {after}, noise {noise}."
    return [_either(diagnosis, "The error"), error, _written(diagnosis)]


def _either(diagnosis: Diagnosis, subject: str) -> str:
    """Name the first set of rivals."""
    sets = [block for block in blocks(diagnosis) if block.answer == "ambiguous"]
    if not sets:
        return ""
    causes = " or ".join(lowered(rival.title) for rival in sets[0].findings)
    if len(sets[0].findings) == 1:
        return f"{subject} may come from {causes}; that is not certain."
    many = count(len(sets[0].findings)).lower()
    held = "; the first is in the improved model" if sets[0].first in diagnosis.in_model else ""
    return f"{subject} has {many} possible causes: {causes}{held}."


def _stated(block: Block) -> str:
    return stated(block.first) or f"{block.title} acts on the machine."


def _doubts(found: list[Block]) -> list[str]:
    """Say of what was found that it is not sure."""
    return [
        f"{block.title} is likely, not certain: its probability is {block.first.probability:.2f}."
        for block in found
        if block.first.probability < SURE
    ]


def _written(diagnosis: Diagnosis) -> str:
    """Say that there is no improved model, where there is none."""
    if diagnosis.learned:
        return "The improved model holds it as a table: see What has no name."
    return "" if diagnosis.in_model else "No improved model was written."


def led(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return the effects whose statement stands in the lead."""
    found = [block.first.effect for block in blocks(diagnosis) if block.answer == "found"]
    return tuple(found[:LED]) if verdict(diagnosis) in ("found", "unknown") else ()


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
    said = [_stated(block) for block in found[:LED]]
    own = next((stated(finding) for finding in diagnosis.findings if finding.effect == "unknown"), "")
    others = [f for f in diagnosis.findings if f.effect != "unknown" and f.answer in ("not_seen", "not_proven")]
    none = f"None of the {len(others)} {'other ' if named else ''}known effects that could be tested "
    none += "explains the rest." if named or diagnosis.learned else "lowers it."
    numbers = improvement(diagnosis, scales) if diagnosis.learned else _numbers(diagnosis, scales)
    return [*said, *_doubts(found), _either(diagnosis, "The error"), own, numbers, none, _written(diagnosis)]


def _withheld(diagnosis: Diagnosis, scales: Scales) -> list[str]:
    """What blocks the naming stands above the lead."""
    return ["What a fit found beside this would be an error of the recordings.", _written(diagnosis)]


_LEADS = {"withheld": _withheld, "found": _found, "either": _rival, "none": _nothing, "unknown": _unknown}


def _numbers(diagnosis: Diagnosis, scales: Scales) -> str:
    held, unit = diagnosis.heldout, scales.torque
    return f"The error on unseen runs is {unit.text(held.after_rms)} against {unit.text(held.floor_rms)} of noise."


def improvement(diagnosis: Diagnosis, scales: Scales) -> str:
    """Return the held-out proof in one sentence."""
    held, unit = diagnosis.heldout, scales.torque
    before, noise = unit.number(held.before_rms), unit.number(held.floor_rms)
    verb = "falls" if held.confidence_interval[0] > 0 else "does not clearly fall:"
    return f"On unseen runs the error {verb} from {before} to {unit.text(held.after_rms)}; noise is {noise}."
