"""What the base gains by other numbers of its own is no merit of the effect beside which it took them.

A fit sits where the plain error is least, which evidence need not prefer: beside an effect a base may leave the card
for numbers that explain what is fast far better, with the effect or without it. Where it comes back to the card, it
was the base that had stood in for the effect.
"""

from math import log

from cosim.diagnosis.evidence.comparison import Aside, Comparison
from cosim.estimation.fit import Fit, with_values

FAR = 3.0
"""Factor from which a number of the base counts as another one: what owners write is rarely more than a factor of two
off. Beside a saturation that a measured screw seemed to have the inertia was 46 times larger."""


def owed_to_base(comparison: Comparison, found: Fit, current: Fit, aside: Aside) -> tuple[float, float]:
    """Nats by which a structure gains by the numbers that were found beside an effect, without that effect.

    Args:
        comparison: what all comparisons share.
        found: the structure with the effect.
        current: the structure without it.
        aside: nuisances that stand aside for the effect.

    Returns:
        At least 0; 0 where no number of the base is further from the card than without the effect, by more than `FAR`.
        The second one counts the few ways in which an equation may be wrong, as a contest of names does.
    """
    known, moved = current.parameters(), found.parameters()
    card = {variable.name: variable.start for variable in comparison.problem.mount.parameters()}
    shared = [name for name in known if name in moved and name.startswith(("axis.", "friction."))]
    if not any(_has_left(card[name], known[name], moved[name]) for name in shared):
        return 0.0, 0.0
    names = [name for name in known if name in moved]
    there = with_values(current.mount, names, found.values[[found.free.index(name) for name in names]])
    alone = comparison.problem.fit(there, 1)
    rows, forms = (
        max(0.0, comparison.evidence(alone, aside, few) - comparison.evidence(current, aside, few))
        for few in (False, True)
    )
    return rows, forms


def _has_left(card: float, before: float, after: float) -> bool:
    """Whether a number is further from the card's than before, by more than the factor."""
    if min(card, before, after) <= 0:
        return False
    return abs(log(after / card)) - abs(log(before / card)) > log(FAR)
