"""The step of a digital reading: what a column cannot show because its values are rounded.

Differences of successive readings of a converter are whole numbers of its step; those of a fine or a computed signal
are not whole numbers of anything. So the step is the smallest difference that comes again and again, if nearly all
others are multiples of it.
"""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
ROWS = 100_000
"""Rows that are looked at: enough to meet each small multiple of a step thousands of times."""
ALIKE = 1e-3
"""Differences within this share of each other are the same one: float32 and units in few digits are finer."""
AGAIN = 0.005
"""Share of the differences, and at least five of them, that must be alike to be a step."""
WHOLE, MOSTLY = 0.05, 0.95
"""Nearly all: this share of the differences lies within so much of a multiple. By chance, a tenth of them would."""
MOST = 10.0
"""Multiples above this say nothing: there rounding of the values in the file adds up."""

SEEN_STEPS = 2.0
"""Steps that a displacement needs to be seen: each of its two ends is known to one."""


def resolution(values: Array) -> float:
    """Return the step of a column in its own unit, 0 where it is too fine to be seen."""
    changes = np.sort(np.abs(np.diff(values[:ROWS])))
    changes = changes[changes > 1e-12 * float(np.ptp(values))]
    if len(changes) < 20:
        return 0.0
    alike = np.searchsorted(changes, (1 + ALIKE) * changes, "right") - np.arange(len(changes))
    often = np.flatnonzero(alike >= max(5.0, AGAIN * len(changes)))
    if not len(often):
        return 0.0
    step = float(np.median(changes[often[0] : often[0] + alike[often[0]]]))
    multiples = changes[changes < MOST * step] / step
    whole = np.abs(multiples - np.rint(multiples)) < WHOLE
    return step if whole.mean() > MOSTLY else 0.0
