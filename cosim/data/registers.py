"""Registers that begin again: a position that holds one turn, a torque whose sign was read as a large number.

    position:  x_k + P n_k     n_k counts the jumps of about P, the length of a turn in the unit of the file
    signed:    x_k - P         where x_k >= P / 2, P = 2^16 or 2^32 steps: two's complement read without its sign

Neither can be motion or torque: between two rows a position would jump by a turn and a torque over its whole range, and
nothing is ever read in between. What may be either is left as it is.
"""

from collections.abc import Mapping
from math import pi

import numpy as np
import numpy.typing as npt

from cosim.support.units import unit

Array = npt.NDArray[np.float64]
SIGNED = ("tau", "v")
"""Columns that may have lost their sign."""
TURNS = (2 * pi, 360.0)
"""Length of a turn where no unit is stated [rad, degrees]."""
NEAR = 0.05
"""Share of its length by which a jump may miss a turn: the motion between two rows goes on."""
ORDINARY = 0.25
"""Share of a turn below which all other steps must be: else rows are too far apart to tell a jump from a motion."""
BITS = (16, 32)
"""Lengths of registers."""
FULL = 0.998
"""Share of its range that a register without a sign must reach: what crosses zero is there just below its end."""
EMPTY = (0.25, 0.75)
"""Shares of the range between which nothing may be read: a torque that is small beside its range fills both ends."""
LEAST = 1e-11
"""Share of the largest value below which a difference is one of rounding: a register of 32 bits has 2e-10."""
WHOLE = 0.05
"""Share of a step by which a value may miss a whole number of them: a file holds so many digits."""
PARTS = (1, 2, 3)
"""Steps in the least difference: a coarse converter that is written in finer units never differs by one of them."""
REACHES = (1e1, 1e2, 1e3, 1e4, 1e5, 1e7, 1e10)
"""Multiples of a step by which it is made exact, the smaller first: those tell which multiples the larger are."""


def continued(
    name: str, table: Mapping[str, Array], units: Mapping[str, str]
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Put together what begins again.

    Args:
        name: the recording, for the notes.
        table: columns under our names, in the units of the file.
        units: those units, where they are stated.

    Returns:
        The table, and a sentence for each column that was changed.
    """
    out, notes = dict(table), []
    length = _turn(out["q"], units.get("q", "")) if "q" in out else 0.0
    if length:
        out["q"] = np.unwrap(out["q"], period=length)
        notes.append(f'{name}: "q" begins again at {length:.6g}; its turns were counted.')
    if length and "q_d" in out:
        out["q_d"] = _beside(out["q"], out["q_d"], length)
    for column in (one for one in SIGNED if one in out):
        if length := _range(out[column]):
            end = length / 2
            out[column] = np.where(out[column] < end, out[column], out[column] - length)
            notes.append(f'{name}: "{column}" was written without its sign; {length:.6g} less from {end:.6g} on.')
    return out, tuple(notes)


def _beside(position: Array, set_point: Array, length: float) -> Array:
    """A set point, which may begin again too, on the turns of the position."""
    steps = np.abs(np.diff(set_point))
    joined = np.unwrap(set_point, period=length) if _begins_again(set_point, steps, length) else set_point
    return np.asarray(joined + length * np.rint(np.median(position - joined) / length))


def _turn(values: Array, stated: str) -> float:
    """Length of the turn at which a position begins again; 0 where it does not."""
    steps = np.abs(np.diff(values))
    turns = TURNS if not stated else (2 * pi / float(unit(stated).to_si(np.ones(1))[0]),)
    return next((length for length in turns if _begins_again(values, steps, length)), 0.0)


def _begins_again(values: Array, steps: Array, length: float) -> bool:
    jumps = steps > length / 2
    whole = np.abs(steps[jumps] - length) < NEAR * length
    inside = np.ptp(values) <= (1 + 1e-3) * length
    return bool(jumps.any() and whole.all() and inside and steps[~jumps].max(initial=0.0) < ORDINARY * length)


def _range(values: Array) -> float:
    """Range of the register that a number was written to without its sign; 0 where it has one."""
    top = float(values.max(initial=0.0))
    if not top or values.min() < 0:
        return 0.0
    between = (values > EMPTY[0] * top) & (values < EMPTY[1] * top)
    if between.any() or not (values < EMPTY[0] * top).any():
        return 0.0
    step = _step(values)
    lengths = (step * 2.0**bits for bits in BITS)
    return next((length for length in lengths if step and FULL * length < top < length), 0.0)


def _step(values: Array) -> float:
    """What all values are whole numbers of; 0 where there is nothing such."""
    changes = np.diff(np.unique(values))
    top = float(values.max())
    least = float(np.min(changes[changes > LEAST * top], initial=top))
    exact = [_exact(least / parts, values) for parts in PARTS]
    return next((one for one in exact if float(np.abs(values / one - np.rint(values / one)).max()) < WHOLE), 0.0)


def _exact(step: float, values: Array) -> float:
    """A step as exact as the largest of the values say."""
    for reach in REACHES:
        some = values[values <= reach * step]
        times = np.rint(some / step)
        step = float(times @ some) / max(float(times @ times), 1.0) or step
    return step
