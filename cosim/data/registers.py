"""Registers that begin again: positions that hold one turn, a counter or a range; a torque that lost its sign.

    position:  x_k + P n_k     n_k counts the steps of about -P less those of about P
    signed:    x_k - P         where x_k >= P / 2, P = 2^16 or 2^32 steps: two's complement read without its sign

Lengths P of a position, the first that fits:

    2 pi, 360 degrees ...   a turn in the unit of the file; 2 pi or 360 where none is stated
    2^8 ... 2^32 steps      a counter: all values are whole numbers of the step, in 0 ... P or -P/2 ... P/2
    25 rad, 8 pi, 191 rad   what drives of the MIT protocol send, from -P/2 to P/2

Neither can be motion or torque: where a register begins again the motion goes on, in steps as everywhere else, while a
motion that jumps by another length than P, by more or less than an ordinary step, leaves what it is. A torque would
jump over its whole range, and nothing is ever read in between. What may be either is left as it is.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from math import pi

import numpy as np
import numpy.typing as npt

from cosim.data.columns import Array
from cosim.support.units import unit

SIGNED = ("tau", "v")
"""Columns that may have lost their sign."""
TURNS = (2 * pi, 360.0)
"""Length of a turn where no unit is stated [rad, degrees]."""
SENT = (25.0, 8 * pi, 191.0)
"""Ranges [rad] of positions that drives of the MIT protocol send: from -12.5, -4 pi or -95.5 rad to as much."""
SAME, STAYS = 1e-3, 5
"""How near to such an end [rad] the largest position is at it, and rows that hold exactly it: no motion does so."""
COUNTERS = range(8, 33)
"""Bits of counters and of encoders of one turn."""
CERTAIN = 16
"""Bits from which on a counter needs no other sign; the motion must be seen to pass the end of a shorter one ..."""
PASSING = 50
"""... within so many rows on either side."""
LIKE = 2.0
"""Multiple of an ordinary step by which a jump may miss the length, as the motion between two rows goes on, and by
which a motion must have moved to be seen."""
USUAL = 0.995
"""Quantile of the other steps that is an ordinary step: a false reading is none."""
ORDINARY = 0.25
"""Share of the length below which an ordinary step must be: else rows are too far apart to tell jump from motion."""
ROUNDED = 1e-3
"""Share of a turn by which values may leave it: it is written with so many digits."""
BITS = (16, 32)
"""Lengths of registers of a torque."""
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


@dataclass(frozen=True, eq=False)
class Register:
    """A position that begins again: the length, in its unit, and how many of them are to be added to each row."""

    length: float
    turns: Array

    def __str__(self) -> str:
        return f"begins again at {self.length:,.10g}; its turns were counted, from the first row on."


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
    if "q" in out and (found := register_of(out["q"], units.get("q", ""), out.get("t"))):
        out["q"] = out["q"] + found.length * found.turns
        notes.append(f'{name}: "q" {found}')
        if "q_d" in out:
            out["q"], out["q_d"] = _together(out["q"], out["q_d"], found.length)
    for column in (one for one in SIGNED if one in out):
        if length := _range(out[column]):
            end = length / 2
            out[column] = np.where(out[column] < end, out[column], out[column] - length)
            notes.append(f'{name}: "{column}" was written without its sign; {length:.6g} less from {end:.6g} on.')
    return out, tuple(notes)


def register_of(values: Array, stated: str, t: Array | None = None) -> Register | None:
    """Find out whether a position begins again.

    Args:
        values: positions, shape (rows,).
        stated: their unit, empty where none is.
        t: their times, where rows may be missing.
    """
    if not np.isfinite(values).all():
        return None  # said where rows are checked
    steps = np.diff(values)
    if not len(steps) or not 0 < np.ptp(values) < 2 * np.abs(steps).max():
        return None
    missing = (
        np.ones(len(steps)) if t is None else np.maximum(np.diff(t) / max(float(np.median(np.diff(t))), 1e-300), 1)
    )
    found = (_register(values, steps, missing, *one) for one in _lengths(values, stated))
    return next((one for one in found if one), None)


def _lengths(values: Array, stated: str) -> Iterator[tuple[float, bool]]:
    """Lengths of registers that could hold all values, and whether the motion must be seen to pass the end."""
    known = unit(stated) if stated else None
    angle = known.factor if known and known.si == "rad" else 1.0
    low, high = float(values.min()), float(values.max())
    turns = TURNS if known is None else (2 * pi / angle,) if known.si == "rad" else ()
    yield from ((turn, False) for turn in turns if high - low <= (1 + ROUNDED) * turn)
    steps = dict.fromkeys((1.0 if bool((values == np.rint(values)).all()) else 0.0, _step(np.abs(values))))
    for bits, step in product(COUNTERS, steps):
        length, half = step * 2.0**bits, 0.5 * step
        if any(least - half <= low <= high < least + length - half for least in (0.0, -0.5 * length)):
            yield length, bits < CERTAIN
    for sent in (one / angle for one in SENT) if known is None or known.si == "rad" else ():
        if max(-low, high) <= (0.5 + ROUNDED) * sent:
            yield sent, True


def _register(values: Array, steps: Array, missing: Array, length: float, passing: bool) -> Register | None:
    """The register of a length, if where it begins again the motion goes on."""
    size = np.abs(steps)
    jumps = size > 0.5 * length
    others = size[~jumps]
    moved = others[others > 0]
    if not len(moved):
        return None
    usual = max(float(np.quantile(others, USUAL)), float(np.median(moved)))
    again = jumps & (np.abs(size - length) <= LIKE * usual * missing + LEAST * length)
    if usual >= ORDINARY * length or 2 * again.sum() <= jumps.sum() or not again.any():
        return None
    turns = np.concatenate([[0.0], np.cumsum(np.where(again, -np.sign(steps), 0.0))])
    ends = np.flatnonzero(again)
    whole = values + length * turns
    before = whole[ends] - whole[np.maximum(ends - PASSING, 0)]
    after = whole[np.minimum(ends + 1 + PASSING, len(values) - 1)] - whole[ends + 1]
    passed = np.minimum(-np.sign(steps[ends]) * before, -np.sign(steps[ends]) * after) > LIKE * usual
    return Register(length, turns) if passed.any() or not passing else None


def _together(position: Array, set_point: Array, length: float) -> tuple[Array, Array]:
    """A position and its set point in one turn: in that of the set point, unless it begins again, too."""
    steps = np.diff(set_point)
    inside = np.ptp(set_point) <= (1 + ROUNDED) * length
    found = _register(set_point, steps, np.ones(len(steps)), length, False) if inside else None
    joined = set_point + length * found.turns if found else set_point
    apart = length * np.rint(np.median(position - joined) / length)
    return (position, joined + apart) if found else (position - apart, joined)


def at_an_end(values: Array, stated: str) -> tuple[float, npt.NDArray[np.int64]]:
    """Where a position stays at an end of what a drive of the MIT protocol can send.

    Returns:
        The end, in the unit of the file, and the first row of each such stretch and the row behind it, shape (n, 2).
    """
    known = unit(stated) if stated else None
    if known is None or known.si == "rad":
        size = float(np.abs(values).max(initial=0.0))
        half = next((one / 2 for one in SENT if abs(one / 2 - size * (known.factor if known else 1.0)) < SAME), 0.0)
        there = np.abs(values) == size
        edges = np.flatnonzero(np.diff(there, prepend=False, append=False)).reshape(-1, 2)
        stays = edges[np.diff(edges).ravel() >= STAYS]
        if half and len(stays):
            return size, stays.astype(np.int64)
    return 0.0, np.empty((0, 2), dtype=np.int64)


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
