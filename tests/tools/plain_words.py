"""Words of ../shared/design/STYLE.md with better ones, and which of them a text holds."""

import re

UNTESTABLE = "detected / possible / not detected / not testable"
MODEL_ERROR = "friction-model error alone could explain this"
CORRELATED = "how to distinguish; these parameters are correlated"
VALIDATION = "validation runs, used for validation (never fitted)"
SWAPS = {
    r"finds the physics its model left out": "finds missing physics in the model",
    r"hides physics from its card": "a mount whose true model contains effects the card lacks",
    r"kept for the proof|for the proof\b|\bnever saw\b|\bunseen runs?\b": VALIDATION,
    r"recordings? (that was |that were )?not fitted": VALIDATION,
    r"told as a formula": "fitted as a lookup table or, if equally good, as a formula",
    r"FMU of anyone's|\b(any|every)(one|body)'s\b": "a third-party plant FMU",
    r"from which its shares begin to say something": "use at least 60 cases for meaningful rates",
    r"giving and taking FMUs": "exporting and importing FMUs",
    r"not sure\)": "inconclusive at this sample size",
    r"has turned a motor yet": "not yet tested on a physical motor",
    r"loaded by nobody": "built but untested",
    r"how texts are written": "CSV format",
    r"is nothing that can be shown": "unsupported file",
    r"Nothing mechanical|than the simulation\b": "actuation delay of 0.77 ms (drive or bus, not mechanical)",
    r"is not quite the machine's|leaves as much": MODEL_ERROR,
    r"\bt(ell|old)s? apart": CORRELATED,
    r"\btugs?\b": "torque ripple",
    r"spanner": "repair",
    r"meets recordings": "runs on recordings",
    r"(?<!variable \"\") has no name\b": "an effect outside the catalogue",
    r"\bseals? (the )?(truths?|answers?)|conceal effects from": "blind benchmark: hide effects, diagnose, score",
    r"\bMAYBE\b|\bnot seen\b|\bno test\b": UNTESTABLE,
    r"no size of it would": "not testable: these recordings do not excite it",
    r"energy that is left|is no missing effect": "would reduce the residual variance by up to 14 %",
    r"is held by friction": "needs a recording where the axis sticks",
    r"of their mean": "differs by 36 % between directions (of the mean)",
    r"\b(it|rest|error|what it) goes with\b": "correlates with",
    r"who steps when": "step sizes, ordering and delays",
    r"\bin its place\b": "instead",
}
"""Expressions for words of ../shared/design/STYLE.md, "Words", part of a sentence each, with better ones."""


def unplain(text: str) -> list[str]:
    """The swaps that a text needs."""
    flat = " ".join(text.split())
    found = {re.search(one, flat, re.IGNORECASE): better for one, better in SWAPS.items()}
    return [f"{one[0]!r}: write {better!r}" for one, better in found.items() if one]
