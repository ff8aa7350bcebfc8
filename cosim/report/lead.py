"""The first sentences: the verdict as a heading, and what must be said below it."""

from math import nan

from cosim.diagnosis.answer.result import Diagnosis, Finding, HeldOut
from cosim.diagnosis.decide.calibration import LIKELY, SURE
from cosim.plots.quantities import joined
from cosim.report.quantities import Scales
from cosim.report.words import Block, blocks, count, lowered, sized, stated, verdict

NO_MODEL = "No improved model was written; card.toml is the delivered card with its numbers refitted."


def heading(diagnosis: Diagnosis, model: str = "the model") -> str:
    """Return the verdict as a heading; effects are missing from `model`."""
    match verdict(diagnosis):
        case "withheld":
            return "Check the recordings first: no effect can be named"
        case "unknown":
            named = any(name != "unknown" for name in diagnosis.verdict)  # an effect, be it one of several rivals
            return _beside_unknown(diagnosis, model) if named else _unknown_heading(diagnosis)
        case "none":
            these = "this recording" if len(diagnosis.traces) == 1 else "these recordings"
            return f"Nothing missing that {these} can show"
    return _open(diagnosis, model)


_UNKNOWN = "Something is missing, and it is none of the effects cosim knows"
_REST = "part of the error fits no known effect"
_SHAKEN = "Something shakes the machine all the time, and the motion does not cause it"
_NOT_CONFIRMED = "Something is missing that no known effect explains on the validation runs"


def _unknown_heading(diagnosis: Diagnosis) -> str:
    """Claim that it is no known effect only where none of them is left to be confirmed."""
    if diagnosis.broadband:
        return _SHAKEN
    return _NOT_CONFIRMED if any(one.answer == "not_proven" for one in diagnosis.findings) else _UNKNOWN


def _beside_unknown(diagnosis: Diagnosis, model: str) -> str:
    """Say first what the verdict has first: what has no name, where the names may be no more than imitations of it."""
    said = _open(diagnosis, model)
    return f"{_REST.capitalize()}; {lowered(said)}" if diagnosis.verdict[0] == "unknown" else f"{said}; {_REST}"


def _open(diagnosis: Diagnosis, model: str) -> str:
    """Count what was found apart from what is only possible: a cause alone, or several of which one is true."""
    found = [finding for finding in diagnosis.findings if finding.answer == "found"]
    asked = _ambiguous(diagnosis)
    if found:
        alone = sum(len(block.findings) == 1 for block in asked)
        more = f", perhaps {count(alone).lower()} more" if alone else ""
        return f"{_missing(found, model)}{more}"
    if any(len(block.findings) > 1 for block in asked):
        return _rivals(asked, model)
    many = count(len(asked))
    return f"{many} effect{'s' if len(asked) != 1 else ''} may be missing from {model}"


def _rivals(asked: list[Block], model: str) -> str:
    """Name the possible causes where they are two; how sure it is follows what they have together."""
    together = min(sum(one.probability for one in block.findings) for block in asked)
    sure = "likely missing" if together < SURE else "missing"
    verb = f"are {sure}" if len(asked) > 1 else f"is {sure}"
    said = (
        f"{count(len(asked))} effect{'s' if len(asked) > 1 else ''} {verb if together >= LIKELY else 'may be missing'}"
    )
    if len(asked) > 1:
        return f"{said} from {model}, with more than one possible cause"
    causes = asked[0].findings
    if len(causes) > 2:
        return f"{said} from {model}, with {count(len(causes)).lower()} possible causes"
    return f"{said} from {model}: {' or '.join(lowered(one.title) for one in causes)}"


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


def lead(diagnosis: Diagnosis, scales: Scales) -> list[str]:
    """Return one or two plain sentences below the heading; sizes, doubts and rivals stand in the table of findings."""
    return [sentence for sentence in _LEADS[verdict(diagnosis)](diagnosis, scales) if sentence]


def _detected(diagnosis: Diagnosis, scales: Scales) -> list[str]:
    found = [block for block in blocks(diagnosis) if block.answer == "found"]
    said = f"The model lacks {_listed(found)}."
    if len(found) == 1:
        said = stated(found[0].first) or f"{found[0].title} acts on the machine."
    if more := _either(diagnosis, "a further error"):
        said = f"{said.removesuffix('.')}; {more}"
    return [said, improvement(diagnosis, scales)]


def _listed(found: list[Block]) -> str:
    """Name effects with their sizes, as they read inside a sentence."""
    names = [lowered(block.title) + (f" ({size})" if (size := sized(block.first)[0]) else "") for block in found]
    return f"{', '.join(names[:-1])} and {names[-1]}" if names[1:] else names[0]


def _rival(diagnosis: Diagnosis, scales: Scales) -> list[str]:
    held, unit = diagnosis.heldout, scales.torque
    before, noise = (unit.number(value) for value in (held.before_rms, held.floor_rms))
    likeliest = unit.number(held.after_rms if held.possible_rms is None else held.possible_rms)
    would = "with the likeliest cause" if held.possible_rms is None else "with the likeliest cause it would be"
    error = f"The validation error is {joined(before, unit.unit)}, {would} {likeliest}, noise floor {noise}"
    return [_either(diagnosis, "The error"), f"{error}{_written(diagnosis)}."]


def _either(diagnosis: Diagnosis, subject: str) -> str:
    """Name each set of rivals, and each cause that is only possible, in one sentence."""
    said = []
    for block in _ambiguous(diagnosis):
        said.append(f"{subject} {_causes(block, diagnosis)}")
        subject = "a further error"
    return f"{'; '.join(said)}." if said else ""


def _causes(block: Block, diagnosis: Diagnosis) -> str:
    causes = " or ".join(lowered(rival.title) for rival in block.findings)
    if len(block.findings) == 1:
        probability = block.first.probability
        doubt = f"its probability is {probability:.2f}" if probability < LIKELY else "not certain"
        return f"may come from {causes} ({doubt})"
    held = ", of which the first is in the improved model" if block.first in diagnosis.in_model else ""
    return f"has {count(len(block.findings)).lower()} possible causes: {causes}{held}"


def _written(diagnosis: Diagnosis) -> str:
    """Say that there is no improved model, where there is none; a part of a sentence."""
    if diagnosis.learned:
        return "; the improved model holds it as a table"
    return "" if diagnosis.in_model else "; no improved model was written"


def led(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return the effects whose statement stands in the lead."""
    found = [block.first.name for block in blocks(diagnosis) if block.answer == "found"]
    return tuple(found) if len(found) == 1 and verdict(diagnosis) == "found" else ()


def _nothing(diagnosis: Diagnosis, scales: Scales) -> list[str]:
    held = diagnosis.heldout
    error, noise = scales.torque.text(held.before_rms), scales.torque.text(held.floor_rms)
    near = "to within the noise" if held.before_rms <= 1.25 * held.floor_rms else "as well as any known effect can"
    said = f"error {error}, noise floor {noise}{in_motion(held, scales)}"
    return [f"The refitted model matches the machine {near} on the validation runs ({said}).", NO_MODEL]


def in_motion(held: HeldOut, scales: Scales) -> str:
    """Return the error in clear motion, where rests are most of the error: a static law says nothing about rest."""
    moving = held.sliding.get("after_rms", nan)
    return f"; {scales.torque.number(moving)} in clear motion" if moving < held.after_rms / 2 else ""


def _unknown(diagnosis: Diagnosis, scales: Scales) -> list[str]:
    """Say what the model holds beside it, that no other effect explains the rest, and how large the error is."""
    found = [block for block in blocks(diagnosis) if block.answer == "found" or block.first in diagnosis.in_model]
    own = next((stated(finding) for finding in diagnosis.findings if finding.effect == "unknown"), "")
    others = [f for f in diagnosis.findings if f.effect != "unknown" and f.answer in ("not_seen", "not_proven")]
    subject = f"With {_listed(found)} an error remains that" if found else "The error is one that"
    none = f"{subject} none of the {len(others)} {'other ' if found else ''}known effects tested here explains."
    held, unit = diagnosis.heldout, scales.torque
    numbers = f"The validation error is {unit.text(held.after_rms)}, the noise floor {unit.text(held.floor_rms)}."
    numbers = improvement(diagnosis, scales) if diagnosis.learned else numbers
    return [own if own and not found else none, numbers.removesuffix(".") + _written(diagnosis) + "."]


def _withheld(diagnosis: Diagnosis, scales: Scales) -> list[str]:
    """What blocks the naming stands above the lead."""
    return ["An effect fitted now would only make up for this error of the recordings.", NO_MODEL]


_LEADS = {"withheld": _withheld, "found": _detected, "either": _rival, "none": _nothing, "unknown": _unknown}


def improvement(diagnosis: Diagnosis, scales: Scales) -> str:
    """Return the validation error before and after in one sentence; where rests hide it, that of clear motion first."""
    held, unit = diagnosis.heldout, scales.torque
    before, noise = unit.number(held.before_rms), unit.number(held.floor_rms)
    moving, clear = _moving(held, scales), held.confidence_interval[0] > 0
    verb = "falls" if clear else "does not clearly fall:"
    where = "over all samples, rests included, it" if moving and not clear else "The validation error"
    said = f"{where} {verb} from {before} to {unit.text(held.after_rms)} (noise floor {noise})."
    return said if clear or not moving else f"{moving}; {said}"


def _moving(held: HeldOut, scales: Scales) -> str:
    """Say what becomes of the error in clear motion, where it falls visibly: a static law says nothing about rest."""
    before, after = (held.sliding.get(f"{name}_rms", nan) for name in ("before", "after"))
    unit = scales.torque
    falls = f"from {unit.number(before)} to {unit.text(after)}"
    seen = after < before and unit.number(before) != unit.number(after)
    return f"In clear motion the validation error falls {falls}" if seen else ""
