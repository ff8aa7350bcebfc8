"""The step of a digital reading: what a column cannot show because its values are rounded.

Differences of successive readings of a converter are whole numbers of its step; those of a fine signal are not whole
numbers of anything. So the step is the smallest difference that comes again and again, if nearly all others are
multiples of it, and if rounding shows: whatever the motion, a rounded reading takes now one step more, now one less.

    differences of a ramp v dt, in steps:      1 1 1 1 1 1        of a parabola:  1 2 3 4 5, or 1 3 5 7
    of a rounded reading of such motion:       2 2 3 2 2 3 2      at rest:        0 0 0 1 0 0 0

Readings that are repeated because they are held (`held`) count once.
"""

import numpy as np

from cosim.data.columns import Array
from cosim.data.held import rows_held

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
WAYS = (4, 16)
"""Differences in ways that must be whole steps too. In a steady motion readings that are held differ by much the same,
to a hundredth, and ways over a few of them do not. The shorter tell the step better, so that the longer are judged."""
ROUNDED = 0.01
"""Share of the differences, and at least five of them, at which rounding must show. At a steady speed it shows as often
as that unless a whole number of steps is met to one in two hundred; steps of ramps that meet are far fewer."""
NOISY = 0.3
"""Share of the differences at which noise above the step shows, if it leads to more than half of the small multiples:
corners of ramps that meet are as irregular, but their speeds are few."""

SEEN_STEPS = 2.0
"""Steps that a displacement needs to be seen: each of its two ends is known to one."""


def resolution(values: Array) -> float:
    """Return the step of a column in its own unit, 0 where it is too fine to be seen."""
    differences = np.diff(values[:ROWS])
    if rows_held(values[:ROWS]) > 1:
        differences = differences[differences != 0]
    changes = np.sort(np.abs(differences))
    changes = changes[changes > 1e-12 * float(np.ptp(values))]
    if len(changes) < 20:
        return 0.0
    alike = np.searchsorted(changes, (1 + ALIKE) * changes, "right") - np.arange(len(changes))
    often = np.flatnonzero(alike >= max(5.0, AGAIN * len(changes)))
    if not len(often):
        return 0.0
    step = float(np.median(changes[often[0] : often[0] + alike[often[0]]]))
    steps = differences / step
    return step if _are_whole(steps) and _is_rounded(steps) else 0.0


def _are_whole(steps: Array) -> bool:
    """Whether small differences, in steps, are whole numbers, and ways over `WAYS` of them, as on a lattice."""
    sums, one = np.cumsum(np.concatenate([[0.0], steps])), 1.0
    for rows in (1, *WAYS):
        ways = np.abs(sums[rows:] - sums[:-rows])
        size = ways[ways < MOST * max(1.0, rows / 2)] / one
        numbers = np.rint(size)
        moved = size > WHOLE
        if np.any(moved) and np.mean(np.abs(size - numbers)[moved] < WHOLE) <= MOSTLY:
            return False
        one *= float(numbers @ size) / max(float(numbers @ numbers), 1.0) or 1.0
    return True


def _is_rounded(steps: Array) -> bool:
    """Whether differences, in steps, show rounding: of slow motion by one more or less, of a noisy one everywhere."""
    numbers = np.where(np.abs(steps) < MOST, np.abs(np.rint(steps)), 0.0)
    few = (np.abs(steps[:-1]) < MOST) & (np.abs(steps[1:]) < MOST)
    bends = np.rint(np.diff(steps))
    by_one = (np.abs(bends[:-1]) == 1) & (bends[1:] != bends[:-1]) & few[:-1]
    moving = np.count_nonzero(numbers)
    if np.count_nonzero(by_one) >= max(5.0, ROUNDED * moving):
        return True
    anyhow = np.mean((np.abs(np.diff(bends)) >= 1)[numbers[1:-1] > 0])
    many = np.bincount(numbers.astype(np.int64))[1:] > ROUNDED * moving
    return bool(anyhow > NOISY and np.count_nonzero(many) > MOST / 2)
