"""The first sentences: the verdict as a heading, and what must be said below it."""

from math import nan

from cosim.diagnosis.answer.result import Diagnosis, Finding, HeldOut
from cosim.diagnosis.decide.calibration import LIKELY, SURE
from cosim.plots.quantities import joined
from cosim.report.quantities import Scales
from cosim.report.words import Block, blocks, count, lowered, stated, verdict

NO_MODEL = "No improved model was written; card.toml is the delivered card with its numbers refitted."
LED = 3
"""Findings whose statement stands in the lead; of further ones it stands with the finding."""


def heading(diagnosis: Diagnosis, model: str = "the model") -> str:
    """Return the verdict as a heading; effects are missing from `model`."""
    match verdict(diagnosis):
        case "withheld":
            return "Check the recordings first: no effect can be named"
        case "unknown":
            return (
                f"{_open(diagnosis, model)}, and something unknown"
                if _named(diagnosis)
                else _unknown_heading(diagnosis)
            )
        case "none":
            return f"Nothing missing that {_these(diagnosis)} can show"
    return _open(diagnosis, model)


_UNKNOWN = "Something is missing, and it is none of the effects cosim knows"
_NOT_CONFIRMED = "Something is missing that no known effect explains on unseen runs"


def _unknown_heading(diagnosis: Diagnosis) -> str:
    """Claim that it is no known effect only where none of them is left to be confirmed."""
    return _NOT_CONFIRMED if any(one.answer == "not_proven" for one in diagnosis.findings) else _UNKNOWN


def _named(diagnosis: Diagnosis) -> bool:
    """Whether the verdict names an effect, be it one of several rivals."""
    return any(name != "unknown" for name in diagnosis.verdict)


def _open(diagnosis: Diagnosis, model: str) -> str:
    """Count what was found apart from what is only possible: a cause alone, or several of which one is true."""
    found = [finding for finding in diagnosis.findings if finding.answer == "found"]
    asked = _ambiguous(diagnosis)
    if found:
        alone = sum(len(block.findings) == 1 for block in asked)
        more = f", perhaps {count(alone).lower()} more" if alone else ""
        return f"{_missing(found, model)}{more}"
    if any(len(block.findings) > 1 for block in asked):
        return "Something is missing, with more than one possible cause"
    many = count(len(asked))
    return f"{many} effect{'s' if len(asked) != 1 else ''} may be missing from {model}"


def _missing(found: list[Finding], model: str) -> str:
    """Say how many effects are missing, and which of them only likely: those with their probability."""
    likely = [f"{one.probability:.2f}" for one in found if one.probability < SURE]
    sure = len(found) - len(likely)
    told = f"probability {' and '.join([', '.join(likely[:-1]), likely[-1]] if likely[1:] else likely)}"
    if not likely:
        return f"{count(sure)} effect{'s are' if sure != 1 else ' is'} missing from {model}"
    if not sure:
        many = f"{count(len(likely))} effects are" if likely[1:] else "One effect is"
        return f"{many} likely missing from {model} ({told})"
    more = f"{count(len(likely)).lower()} more {'are' if likely[1:] else 'is'} likely ({told})"
    return f"{count(sure)} effect{'s are' if sure != 1 else ' is'} missing from {model}, {more}"


def _ambiguous(diagnosis: Diagnosis) -> list[Block]:
    return [block for block in blocks(diagnosis) if block.answer == "ambiguous"]


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
    before, noise = (unit.number(value) for value in (held.before_rms, held.floor_rms))
    likeliest = unit.number(held.after_rms if held.possible_rms is None else held.possible_rms)
    would = "with the likeliest cause" if held.possible_rms is None else "with the likeliest cause it would be"
    error = f"On unseen runs the error is {joined(before, unit.unit)}, {would} {likeliest}, noise {noise}."
    return [_either(diagnosis, "The error"), error, _written(diagnosis)]


def _either(diagnosis: Diagnosis, subject: str) -> str:
    """Name each set of rivals, and each cause that is only possible."""
    said = []
    for block in _ambiguous(diagnosis):
        said.append(f"{subject} {_causes(block, diagnosis)}")
        subject = "A further error"
    return " ".join(said)


def _causes(block: Block, diagnosis: Diagnosis) -> str:
    causes = " or ".join(lowered(rival.title) for rival in block.findings)
    if len(block.findings) == 1:
        unlikely = block.first.probability < LIKELY
        return f"may come from {causes}: {_probability(block) if unlikely else 'that is not certain'}."
    held = "; the first is in the improved model" if block.first in diagnosis.in_model else ""
    return f"has {count(len(block.findings)).lower()} possible causes: {causes}{held}."


def _stated(block: Block) -> str:
    return stated(block.first) or f"{block.title} acts on the machine."


def _doubts(found: list[Block]) -> list[str]:
    """Say of what was found that it is not sure."""
    return [
        f"{block.title} is not certain: {_probability(block)}." for block in found if block.first.probability < SURE
    ]


def _probability(block: Block) -> str:
    return f"its probability is {block.first.probability:.2f}"


def _written(diagnosis: Diagnosis) -> str:
    """Say that there is no improved model, where there is none."""
    if diagnosis.learned:
        return "The improved model holds it as a table: see What has no name."
    return "" if diagnosis.in_model else NO_MODEL


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
    return [first, fits, NO_MODEL]


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
    """Return the held-out proof in one sentence; where rests hide what motion shows, in two."""
    held, unit = diagnosis.heldout, scales.torque
    before, noise = unit.number(held.before_rms), unit.number(held.floor_rms)
    moving, clear = _moving(held, scales), held.confidence_interval[0] > 0
    verb = "falls" if clear else "does not clearly fall:"
    where = "Over all samples, rests included, it" if moving and not clear else "On unseen runs the error"
    said = f"{where} {verb} from {before} to {unit.text(held.after_rms)}; noise is {noise}."
    return said if clear or not moving else f"{moving} {said}"


def _moving(held: HeldOut, scales: Scales) -> str:
    """Say what becomes of the error in clear motion, where it falls visibly: a static law says nothing about rest."""
    before, after = (held.sliding.get(f"{name}_rms", nan) for name in ("before", "after"))
    unit = scales.torque
    falls = f"from {unit.number(before)} to {unit.text(after)}"
    seen = after < before and unit.number(before) != unit.number(after)
    return f"In clear motion the error on unseen runs falls {falls}." if seen else ""
