"""What the base gains by other numbers of its own is no merit of the effect beside which it took them.

A fit sits where the plain error is least, which evidence need not prefer: beside an effect a base may end at numbers
that explain what is fast far better, with the effect or without it.
"""

from math import log

from cosim.diagnosis.comparison import Aside, Comparison
from cosim.estimation.fit import Fit, with_values

FAR = 3.0
"""Factor from which a number of the base counts as another one: what owners write is rarely more than a factor of two
off. Beside a saturation that a measured screw seemed to have the inertia was 46 times larger."""


def owed_to_base(comparison: Comparison, found: Fit, current: Fit, aside: Aside) -> float:
    """Nats by which a structure gains by the numbers that were found beside an effect, without that effect.

    Args:
        comparison: what all comparisons share.
        found: the structure with the effect.
        current: the structure without it.
        aside: nuisances that stand aside for the effect.

    Returns:
        At least 0; 0 where no number of the base is more than `FAR` from what it is without the effect.
    """
    known, moved = current.parameters(), found.parameters()
    if not any(_is_far(known[name], moved[name]) for name in known if name in moved and is_of_base(name)):
        return 0.0
    names = [name for name in known if name in moved]
    there = with_values(current.mount, names, found.values[[found.free.index(name) for name in names]])
    alone = comparison.problem.fit(there, 1)
    return max(0.0, comparison.evidence(alone, aside) - comparison.evidence(current, aside))


def is_of_base(name: str) -> bool:
    """Whether a parameter, by its full name, is one of the axis or its friction law."""
    return name.startswith(("axis.", "friction."))


def _is_far(before: float, after: float) -> bool:
    return min(before, after) > 0 and abs(log(after / before)) > log(FAR)
