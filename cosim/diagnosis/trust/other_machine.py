"""Is the held-out recording of the machine that the training recordings are of? Its inertia and friction tell."""

from collections.abc import Sequence
from math import hypot, log

from cosim.diagnosis.answer.doubt_entry import Alternative, Sanity
from cosim.diagnosis.trust.balance import Balance, Estimate

INERTIA, FRICTION = log(1.6), log(3.0)
"""Factors by which inertia and friction of one machine may differ: it varies with position, and warms up."""
SURELY = 3.0
"""Standard errors by which they must differ beyond that."""
CAUSES = (
    Alternative(what="another payload, or another machine", likelihood=0.7),
    Alternative(what="another unit or gear ratio in one of the files", likelihood=0.3),
)
"""No recording tells these apart; files of one machine are mostly exported alike."""


def other_machine(train: Sequence[Balance], heldout: Sequence[Balance]) -> tuple[Sanity, ...]:
    """Say which held-out recordings are of another machine than all training recordings."""
    found = []
    for held in heldout:
        told = [_difference(one, held) for one in train]
        if told and all(told):
            name, text = held.recordings[0].name, told[0]
            said = (
                f"{name} is held out, and is not of the machine of the training recordings: {text}. It proves nothing "
                "about that machine."
            )
            found.append(Sanity(finding="other_machine", statement=said, alternatives=CAUSES))
    return tuple(found)


def _difference(train: Balance, held: Balance) -> str:
    """How a held-out recording differs from one of training; empty where it does not."""
    solved = [one.solution(one.own_order) for one in (train, held)]
    pairs = [[getattr(one, name) for one in solved] for name in ("inertia", "coulomb")]
    for words, (before, after), most in zip(("inertia", "friction"), pairs, (INERTIA, FRICTION), strict=True):
        if _differs(before, after, most):
            return f"its {words} is {after.value / before.value:.2g} times that of {train.recordings[0].name}"
    return ""


def _differs(before: Estimate, after: Estimate, most: float) -> bool:
    """Whether two positive numbers differ by more than a factor and their errors allow."""
    if min(before.value, after.value) <= 0:
        return False
    error = hypot(before.error / before.value, after.error / after.value)
    return abs(log(after.value / before.value)) > most + SURELY * error
