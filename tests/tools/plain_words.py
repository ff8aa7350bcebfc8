"""Words of ../shared/design/STYLE.md with better ones, and which of them a text holds."""

import re

SWAPS = {
    "finds the physics its model left out": "finds missing physics in the model",
    "hides physics from its card": "a mount whose true model contains effects the card lacks",
    "kept for the proof": "used for validation (never fitted)",
    "told as a formula": "fitted as a lookup table or, if equally good, as a formula",
    "FMU of anyone's": "a third-party plant FMU",
    "from which its shares begin to say something": "use at least 60 cases for meaningful rates",
    "giving and taking FMUs": "exporting and importing FMUs",
    "not sure)": "inconclusive at this sample size",
    "has turned a motor yet": "not yet tested on a physical motor",
    "loaded by nobody": "built but untested",
    "how texts are written": "CSV format",
    "is nothing that can be shown": "unsupported file",
    "Nothing mechanical": "drive or bus, not mechanical",
    "is not quite the machine's": "friction-model error alone could explain this",
    "Tell apart": "How to distinguish",
    "tugs": "torque ripple",
    "spanner": "repair",
}
"""Words of ../shared/design/STYLE.md, "Words", with better ones; part of a sentence each."""
FORMS_OF = {
    r"meets recordings": "runs on recordings",
    r"for the proof\b": "for validation (never fitted)",
    r"(?<!variable \"\") has no name\b": "an effect outside the catalogue",
    r"\b(any|every)(one|body)'s\b": "a third-party FMU",
    r"\bseals? (the )?(truths?|answers?)|conceal effects from": "blind benchmark: hide effects, diagnose, score",
    r"\bMAYBE\b|\bnot seen\b|\bno test\b": "detected / possible / not detected / not testable",
    r"no size of it would": "not testable: these recordings do not excite it",
    r"energy that is left|is no missing effect": "would reduce the residual variance by up to 14 %",
    r"recordings? (that was |that were )?not fitted": "validation recording",
    r"is held by friction": "needs a recording where the axis sticks",
    r"\bt(ell|old)s? apart": "how to distinguish; these parameters are correlated",
    r"than the simulation\b": "actuation delay of 0.77 ms (drive or bus, not mechanical)",
    r"of their mean": "differs by 36 % between directions (of the mean)",
    r"leaves as much": "friction-model error alone could explain this",
    r"\b(it|rest|error|what it) goes with\b": "correlates with",
    r"who steps when": "step sizes, ordering and delays",
    r"\btugs?\b": "torque ripple",
    r"\bin its place\b": "instead",
    r"\bnever saw\b|\bunseen runs?\b": "validation runs",
}
"""Its other rows, as expressions: the sentence in all its forms."""
SWAPPED = {re.compile(re.escape(one), re.IGNORECASE): better for one, better in SWAPS.items()}
SWAPPED |= {re.compile(one, re.IGNORECASE): better for one, better in FORMS_OF.items()}


def unplain(text: str) -> list[str]:
    """The swaps that a text needs."""
    flat = " ".join(text.split())
    return [f"{found[0]!r}: write {SWAPPED[one]!r}" for one in SWAPPED for found in [one.search(flat)] if found]
