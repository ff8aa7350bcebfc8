"""Rows in the order of their times: copies out, late rows in their places, registers of time continued.

    register    time falls by P = 2^8, 2^16, 2^24 or 2^32 ticks, where a tick is a power of ten of the unit, or by a day
                or a week, while every other column goes on
    copies      rows with the time and all values of an earlier one: of the row before, or of a stretch that was written
                twice
    late rows   a few rows whose times lie before one that was written already, and which are missing there: in their
                places they are about as far from their neighbours as other rows are
    reversed    each row is before the one above it: the newest stands first

Each is done with a note. What remains is not touched: where time falls and stays low another recording begins, and rows
of one time that differ are refused when they are judged (`checks.check_time`).
"""

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from cosim.data.assign import assign
from cosim.data.checks import COARSE
from cosim.data.columns import Array, Columns, Request
from cosim.data.limits import several, short
from cosim.data.questions import REPEATED
from cosim.data.times import DAY, clock_of

Rows = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]
BITS = (8, 16, 24, 32)
"""Lengths of registers of time."""
TICKS = tuple(10.0**power for power in range(-9, 4))
"""Ticks of such registers in the unit of the file."""
CLOCKS = tuple(days * DAY * tick for days in (1, 7) for tick in (1.0, 1e3, 1e6, 1e9))
"""Lengths of clocks that begin again: a day and a week in s, ms, us and ns."""
NEAR = 3.0
"""Usual steps by which a fall may miss the length of a register: rows may be late or lost there."""
GOES_ON = 3.0
"""Multiple of its largest other step by which a column may change where time begins again."""
LATE = 16
"""Rows in a row that may be late, as a network brings them out of order. More of them are another recording."""
APART, SMALL = 0.7, 0.05
"""Share of a small step (this quantile of them) by which late rows must be apart from their neighbours."""


@dataclass(frozen=True, eq=False)
class Ordered:
    """Rows to keep, in their order; their times; and in words what was done, `{time}` being the name of the time."""

    rows: Rows
    t: Array
    done: tuple[str, ...] = ()


def in_order(request: Request, found: Columns) -> Columns:
    """Return a table with its rows in the order of their times, and a note for each thing that was done.

    Raises:
        RecordingError: as `assign`, where it is open which column is the time.
    """
    path, served = request.path, assign(request, found)
    if "t" not in served.values:
        return found
    name, clock = served.sources["t"], clock_of(path, served).values
    if clock.dtype.kind not in "iuf":
        return found
    others = {key: one for key, one in found.values.items() if key != name}
    ordered = single(order_of(clock.astype(np.float64), others, found.restarts), request.layout.get(REPEATED, ""))
    if not ordered.done:
        return found
    values = {key: one[ordered.rows] for key, one in found.values.items()}
    if not np.array_equal(clock[ordered.rows], ordered.t):
        values[name] = ordered.t
    notes = tuple(f"{path.stem}: {text.format(time=short(name))}" for text in ordered.done)
    start = "" if ordered.rows[0] else found.start
    return replace(found, values=values, notes=(*found.notes, *notes), start=start)


def single(ordered: Ordered, repeated: str) -> Ordered:
    """Keep the first or the last of rows of one time."""
    again = np.diff(ordered.t) == 0
    if not repeated or not again.any():
        return ordered
    kept = np.append(True, ~again) if repeated == "first" else np.append(~again, True)
    count, first = int(again.sum()), int(ordered.rows[~kept].min()) + 1
    said = "rows have" if count > 1 else "row has"
    done = f"{count:,} {said} the time of another and differ; the {repeated} was kept. Row {first:,} is left out first."
    return Ordered(ordered.rows[kept], ordered.t[kept], (*ordered.done, done))


def order_of(t: Array, others: Mapping[str, np.ndarray], restarts: Sequence[int] = ()) -> Ordered:
    """Order rows by their times.

    Args:
        t: times as they were read, shape (rows,).
        others: the other columns; they tell copies from rows that differ, and a register from another recording.
        restarts: rows from which on another recording begins if time falls there.
    """
    steps = np.diff(t)
    rows: Rows = np.arange(len(t))
    if len(t) < 3 or not np.isfinite(t).all() or bool((steps > 0).all()) or not steps.any():
        return Ordered(rows, t)
    done: list[str] = []
    anew = frozenset(row for row in restarts if 0 < row < len(t) and t[row] < t[row - 1])
    if bool((steps <= 0).all()):
        rows = rows[::-1]
        done.append("its rows ran from the last to the first and were turned about.")
    t = t[rows]
    telling = [one[rows] for one in others.values() if not _is_row_number(one)]
    if not anew and (length := _register(t, telling)):
        t = t + length * np.concatenate([[0.0], np.cumsum(-np.rint(np.diff(t) / length))])
        done.append(f'"{{time}}" begins again at {length:,.10g}; it was continued.')
    kept = _kept(t, telling, anew)
    left = np.setdiff1d(np.arange(len(t)), kept)
    late = np.flatnonzero(np.diff(kept, prepend=-1) < 0)
    if len(left):
        one, many = "row that repeats the time and all values of another was", "rows that repeat the time and all"
        said = several(len(left), one, f"{many} values of others were")
        done.append(f"{said} left out; the first is row {rows[left].min() + 1:,}.")
    if len(late):
        said = several(len(late), "row that came late was", "rows that came late were")
        done.append(f"{said} put in the order of time; the first is row {rows[kept[late]].min() + 1:,}.")
    return Ordered(rows[kept], t[kept], tuple(done))


def _is_row_number(column: np.ndarray) -> bool:
    """Whether a column counts rows: it grows in copies, too, and tells nothing of them."""
    with np.errstate(invalid="ignore"):  # infinity less infinity; such rows are refused where rows are checked
        return column.dtype.kind in "iuf" and len(column) > 1 and bool((np.diff(column) == 1).all())


def _register(t: Array, others: Sequence[np.ndarray]) -> float:
    """Length of the register of time that begins again; 0 where there is none."""
    steps = np.diff(t)
    fall = -float(steps.min())
    usual = steps[(steps > 0) & (steps < 0.5 * fall)]
    if fall <= 0 or not len(usual):
        return 0.0
    step = max(float(np.median(usual)), float(np.quantile(usual, 0.9)))
    lengths = (*(tick * 2.0**bits for bits in BITS for tick in TICKS), *CLOCKS)
    near = [one for one in lengths if abs(one - fall) <= NEAR * step and _holds(one, t)]
    for length in sorted(near, key=lambda one: abs(one - fall - step)):
        again = np.abs(steps) > 0.5 * length
        misses = np.abs(np.abs(steps[again]) - length)
        if again.any() and misses.max() <= NEAR * step and all(_goes_on(one, again) for one in others):
            return length
    return 0.0


def _holds(length: float, t: Array) -> bool:
    """Whether a register of this length holds all values, without a sign or with one."""
    low, high = float(t.min()), float(t.max())
    return bool(0 <= low <= high < length or -0.5 * length <= low <= high < 0.5 * length)


def _goes_on(column: np.ndarray, again: Flags) -> bool:
    """Whether a column changes where time begins again no more than elsewhere."""
    if column.dtype.kind not in "iufb":
        changes = column[1:] != column[:-1]
        return bool(not changes[again].any() or changes[~again].any())
    changes = np.nan_to_num(np.abs(np.diff(column.astype(np.float64))))
    return bool(changes[again].max() <= GOES_ON * changes[~again].max(initial=0.0))


def _kept(t: Array, others: Sequence[np.ndarray], anew: Set[int]) -> Rows:
    """Rows without copies, each recording in the order of its times where what is out of order is only late."""
    blocks: list[Rows] = []
    for start, end in pairwise([*_starts(t, anew), len(t)]):
        block = start + np.argsort(t[start:end], kind="stable")
        again, same = _repeats(t, others, block)
        if again.sum() > max(COARSE * len(again), 2 * same.sum()):
            return np.arange(len(t))  # a time of too few digits: rows that differ have one time
        single = block[np.concatenate([[True], ~same])]
        late = t[start:end] < np.maximum.accumulate(t[start:end])
        block = single if _fits(t[single], late[single - start]) else np.sort(single)
        if blocks and start not in anew and (whole := _extended(t, others, blocks[-1], block)) is not None:
            blocks[-1] = whole
        else:
            blocks.append(block)
    return np.concatenate(blocks)


def _starts(t: Array, anew: Set[int]) -> Iterator[int]:
    """The first row, those of `anew`, and those from which on time stays lower for more than `LATE` rows."""
    yield 0
    top = -np.inf
    for row in (np.flatnonzero(np.diff(t) < 0) + 1).tolist():
        top = max(top, float(t[row - 1]))
        after = t[row : row + LATE + 1]
        if row in anew or (len(after) > LATE and float(after.max()) < top):
            yield row
            top = -np.inf


def _repeats(t: Array, others: Sequence[np.ndarray], block: Rows) -> tuple[Flags, Flags]:
    """Which rows of a sorted block, from its second, have the time of the one before, and which all of its values."""
    again = np.diff(t[block]) == 0
    return again, _equal(others, block[:-1], block[1:], again)


def _equal(others: Sequence[np.ndarray], rows: Rows, with_rows: Rows, among: Flags) -> Flags:
    """Which pairs of rows hold the same values, of those that are asked for."""
    at = np.flatnonzero(among)
    same = np.ones(len(at), bool)
    for column in others:
        one, other = column[rows[at]], column[with_rows[at]]
        same &= (one == other) | ((one != one) & (other != other))
    equal = np.zeros(len(among), bool)
    equal[at] = same
    return equal


def _fits(t: Array, late: Flags) -> bool:
    """Whether late rows, sorted, lie where rows are missing: about as far from their neighbours as others are."""
    if not late.any():
        return True
    steps = np.diff(t)
    beside = late[1:] | late[:-1]
    usual = steps[~beside] if (~beside).any() else steps
    return bool(steps[beside].min() >= APART * np.quantile(usual, SMALL) > 0)


def _extended(t: Array, others: Sequence[np.ndarray], block: Rows, more: Rows) -> Rows | None:
    """A block with the rows of the next that are new, if all others are copies of its own; else None."""
    old = t[more] <= t[block[-1]]
    at = np.clip(np.searchsorted(t[block], t[more]), 0, len(block) - 1)
    same = _equal(others, block[at], more, old & (t[block[at]] == t[more]))
    return np.concatenate([block, more[~old]]) if bool(old.any()) and bool(same[old].all()) else None
