"""Channels with times of their own, put on one time base.

A file may hold channels of several devices: each has its own start, end, rate and gaps. `Columns.clocks` holds their
times; here they become a table.

    base      the times of the slower one of torque and position, as nothing is known between its samples; of equally
              fast ones those of the position, which is differentiated twice and so must stay as it was read
    torque    faster than the base: its mean over the interval that is centred at each row, which keeps the impulse;
              else read between two samples on a straight line
    position, speed    read between samples on the cubic through four of them; on a line where their steps are uneven
    set point, whole numbers    the last sample, which holds until the next
    others    read between two samples on a line

Torque and position are never extrapolated; the first and last samples of other channels hold for one of their own
periods, so that a slow one costs no rows. Nothing is read across a gap: a step longer than `GAP` times the channel's
own period, which is the larger of the median and the 90 % quantile of its steps. Rows that torque or position do not
reach are left out: at the ends the recording begins later or ends earlier, in the middle it has a gap. Samples that are
NaN are none.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.data import questions
from cosim.data.assign import OURS, assign
from cosim.data.checks import chosen
from cosim.data.columns import Array, Columns, Request
from cosim.data.limits import listed, short
from cosim.data.order import order_of, single
from cosim.data.registers import register_of
from cosim.data.roles import is_named
from cosim.support.errors import RecordingError

GAP = 1.5
"""A step of a channel longer than this many of its own periods is a gap."""
USUAL = 0.9
"""Quantile of its steps that is taken for the period of a channel whose samples come unevenly."""
EQUAL = 0.9
"""Ratio of two periods above which channels are equally fast."""
SAME = 1e-3
"""Share of a period within which two times are one: the sample is taken as it is."""
COVERED = 0.75
"""Share of a row's interval that samples of a mean must cover."""
EVEN = 0.5
"""Steps shorter than this share of the period are uneven: a cubic through such samples may leave them far."""
SPENT = 0.1
"""Share of the rows that channels other than torque and position may cost; one that would cost more is left out."""
LEAST = 2
"""Samples that a channel needs."""


@dataclass(frozen=True, eq=False)
class Channel:
    """The valid samples of a channel: times [s] and values, of one shape.

    `invalid` samples were left out, `done` says in words how the others were put in order.
    """

    name: str
    t: Array
    x: Array
    invalid: int = 0
    done: tuple[str, ...] = ()

    @property
    def grows(self) -> bool:
        """Whether each sample is later than the one before it."""
        return bool((np.diff(self.t) > 0).all())

    @cached_property
    def period(self) -> float:
        """Usual distance of two samples [s]."""
        return float(np.median(np.diff(self.t)))

    @cached_property
    def longest(self) -> float:
        """The longest step that is no gap [s]."""
        return GAP * max(self.period, float(np.quantile(np.diff(self.t), USUAL)))

    @property
    def span(self) -> str:
        """Rate, start, end and gaps in words."""
        gaps = int((np.diff(self.t) > self.longest).sum())
        holes = f", {gaps:,} gap{'s' * (gaps > 1)}" if gaps else ""
        return f"{1 / self.period:,.6g} Hz, {self.t[0]:.6g} s to {self.t[-1]:.6g} s{holes}"

    def cells(self) -> tuple[Array, Array]:
        """Start and end of what each sample stands for [s]: up to the middle between two, half a period at a gap."""
        steps = np.diff(self.t)
        half = 0.5 * np.where(steps > self.longest, self.period, steps)
        ends = 0.5 * self.period
        return self.t - np.concatenate([[ends], half]), self.t + np.concatenate([half, [ends]])


@dataclass(frozen=True, eq=False)
class Read:
    """A channel at the times of the base: values, whether there is one, and how it was read."""

    channel: Channel
    values: Array
    valid: npt.NDArray[np.bool_]
    how: str


def on_one_time(request: Request, found: Columns) -> Columns:
    """Put channels with times of their own on one time base, which is that of columns that are needed.

    A table whose columns share their times stays as it is.

    Returns:
        Columns of equal length with the time `t` [s], and a note that says what was read at which times.

    Raises:
        RecordingError: torque and position have no time in common, or time of a channel does not grow.
    """
    if not found.clocks:
        return found
    path, own = request.path, request.columns.get("t")
    found = _of_one_clock(found, own) if own is not None else _without_times(found)
    if (table := _as_table(found)) is not None:
        return table
    repeated = request.layout.get(questions.REPEATED, "")
    channels = {name: one for name in found.clocks if (one := _channel(found, name, repeated))}
    if not channels:
        return replace(found, values={}, clocks={})
    longest = max(channels.values(), key=lambda one: len(one.t))
    named = replace(found, values={"t": longest.t} | {name: one.x for name, one in channels.items()}, clocks={})
    served = assign(request, named)
    roles = {theirs: ours for ours, theirs in served.sources.items() if theirs in channels and ours in OURS}
    needed = [served.sources[ours] for ours in chosen(served.values, request.required) if ours != "t"]
    for name in needed:
        _check_times(path, channels[name])
    if not any(one.grows for one in channels.values()):
        _check_times(path, longest)
    channels = {name: one for name, one in channels.items() if one.grows}
    roles = {name: ours for name, ours in roles.items() if name in channels}
    for name in (theirs for theirs, ours in roles.items() if ours == "q"):
        channels[name] = _turned(channels[name], served.units.get("q", ""))
    return _table(path, found, channels, roles, needed)


def _of_one_clock(found: Columns, name: str) -> Columns:
    """Only the channels that share their times with the column that the user calls the time."""
    own = found.clocks.get(name)
    return found if own is None else replace(found, clocks={k: v for k, v in found.clocks.items() if v is own})


def _without_times(found: Columns) -> Columns:
    """Leave out the vectors of time themselves."""
    named = {name: clock for name, clock in found.clocks.items() if is_named(name, "time")}
    times = [name for name, clock in named.items() if np.array_equal(found.values[name], clock)]
    times = times if len(times) < len(found.clocks) else []
    values = {name: column for name, column in found.values.items() if name not in times}
    return replace(found, values=values, clocks={k: v for k, v in found.clocks.items() if k not in times})


def _as_table(found: Columns) -> Columns | None:
    """Channels as a table, if they share one clock and all of their samples are valid."""
    first, *others = found.clocks.values()
    columns = [found.values[name] for name in found.clocks]
    if any(one is not first for one in others) or not all(
        _is_numeric(one) and np.isfinite(one).all() for one in columns
    ):
        return None
    times = (name for name in found.clocks if is_named(name, "time") and np.array_equal(found.values[name], first))
    own = next(times, "t")
    values = {own: first} | {name: found.values[name] for name in found.clocks if name != own}
    return replace(found, values=values, units=found.units | {own: "s"}, clocks={})


def _is_numeric(column: np.ndarray) -> bool:
    return column.dtype.kind in "fiub"


def _channel(found: Columns, name: str, repeated: str) -> Channel | None:
    t, x = found.clocks[name], found.values[name]
    if not (_is_numeric(t) and _is_numeric(x)):
        return None
    t, x = t.astype(np.float64), x.astype(np.float64)
    valid = np.isfinite(x) & np.isfinite(t)
    if valid.sum() < LEAST:
        return None
    ordered = single(order_of(t[valid], {name: x[valid]}), repeated)
    if len(ordered.t) < LEAST:
        return None
    return Channel(name, ordered.t, x[valid][ordered.rows], int((~valid).sum()), ordered.done)


def _check_times(path: Path, channel: Channel) -> None:
    """Refuse a channel whose time does not grow."""
    if channel.grows:
        return
    row = int(np.flatnonzero(np.diff(channel.t) <= 0)[0])
    before, after = float(channel.t[row]), float(channel.t[row + 1])
    how = "stands still and values differ" if after == before else "runs backwards"
    where = f"at its sample {row + 2:,} ({before:.9g} s to {after:.9g} s)"
    text = f'{path}: the time of "{short(channel.name)}" {how} {where}.'
    if after == before:
        raise questions.repeated(path, text)
    raise RecordingError(f"{text} Split the file there.", culprit=str(path), value=after)


def _turned(channel: Channel, stated: str) -> Channel:
    """A position whose turns are counted: between the end of a register and its start nothing can be read."""
    found = register_of(channel.x, stated, channel.t)
    if found is None:
        return channel
    return replace(channel, x=channel.x + found.length * found.turns, done=(*channel.done, str(found)))


def _base(needed: Sequence[Channel], roles: Mapping[str, str]) -> Channel | None:
    """The channel whose times are the rows."""
    if not needed:
        return None
    slowest = max(one.period for one in needed)
    among = [one for one in needed if one.period >= EQUAL * slowest]
    first = among[0]
    together = all(_coincide(first, one) for one in among)
    positions = [one for one in among if roles.get(one.name) in ("q", "v")]
    return first if together or not positions else positions[0]


def _coincide(one: Channel, other: Channel) -> bool:
    """Whether two channels were sampled at the same instants wherever both were."""
    low, high = max(one.t[0], other.t[0]), min(one.t[-1], other.t[-1])
    inner = one.t[(one.t >= low) & (one.t <= high)]
    near = other.t[np.clip(np.searchsorted(other.t, inner - SAME * other.period), 0, len(other.t) - 1)]
    hit = np.abs(near - inner) <= SAME * other.period
    return bool(hit.mean() > 0.5) if len(inner) else False


def _table(
    path: Path, found: Columns, channels: Mapping[str, Channel], roles: Mapping[str, str], needed: Sequence[str]
) -> Columns:
    longest = max(channels.values(), key=lambda one: len(one.t))
    base = _base([channels[name] for name in needed], roles) or longest
    reads = {name: _read(one, base, roles.get(name, ""), name in needed) for name, one in channels.items()}
    rows = np.ones(len(base.t), bool)
    for name in (one for one in needed if one in reads):
        rows &= reads[name].valid
    if not rows.any():
        spans = " and ".join(f'"{name}" ({channels[name].span})' for name in needed if name in channels)
        text = f"{path}: {spans} have no times in common; record them at the same time."
        raise RecordingError(text, culprit=str(path), value=0)
    kept, rows, costly = _kept(reads, rows, roles, needed)
    names = {name: "t_original" if name == "t" else name for name in kept}
    values = {"t": base.t[rows]} | {names[name]: one.values[rows] for name, one in kept.items()}
    units = {names[name]: text for name, text in found.units.items() if name in kept} | {"t": "s"}
    left = [name for name in found.values if name not in kept and name not in costly]
    notes = (*found.notes, *_notes(path, base, kept, base.t[rows]))
    for which, some in (("that do not cover these rows", costly), ("without numbers of their own times", left)):
        notes += (f"{path.stem}: channels {which} were left out: {listed(tuple(some))}.",) if some else ()
    return replace(found, values=values, units=units, clocks={}, notes=notes)


def _kept(
    reads: Mapping[str, Read], rows: npt.NDArray[np.bool_], roles: Mapping[str, str], needed: Sequence[str]
) -> tuple[dict[str, Read], npt.NDArray[np.bool_], list[str]]:
    """Channels that go along, the rows at which all of them are, and the names of those that would cost too many.

    A set point and a temperature may cost rows anywhere, other channels at the ends only.
    """
    least, costly = (1 - SPENT) * rows.sum(), []
    for name in sorted((one for one in reads if one not in needed), key=lambda one: one not in roles):
        both = rows & reads[name].valid
        first, last = (int(np.argmax(both)), len(both) - int(np.argmax(both[::-1]))) if both.any() else (0, 0)
        whole = name in roles or bool(both[first:last].sum() == rows[first:last].sum())
        if both.sum() >= least and whole:
            rows = both
        else:
            costly.append(name)
    return {name: one for name, one in reads.items() if name not in costly}, rows, costly


def _read(channel: Channel, base: Channel, role: str, needed: bool) -> Read:
    """Read a channel at the times of the base."""
    if role == "tau" and channel.period < EQUAL * base.period:
        mean, covered = _means(channel, base)
        return Read(channel, mean, covered, "by its mean over each row's interval")
    right = np.clip(np.searchsorted(channel.t, base.t), 1, len(channel.t) - 1)
    left = right - 1
    step = channel.t[right] - channel.t[left]
    share = (base.t - channel.t[left]) / step
    near = np.where(share > 0.5, right, left)
    hit = np.abs(base.t - channel.t[near]) <= SAME * channel.period
    outside = np.maximum(channel.t[0] - base.t, base.t - channel.t[-1])
    at_ends = (outside > 0) & (outside <= (0.0 if needed else channel.period))
    between = hit | at_ends | ((share >= 0) & (share <= 1) & (step <= channel.longest))
    if bool(hit[between].all()):
        return Read(channel, channel.x[near], hit, "at the same times")
    at_most = f"samples at most {channel.longest:.3g} s apart"
    if role == "q_d" or (role == "" and bool(np.all(channel.x == np.rint(channel.x)))):
        held = np.where(hit | at_ends, channel.x[near], channel.x[left])
        return Read(channel, held, between, f"held between {at_most}")
    line = channel.x[left] + share * (channel.x[right] - channel.x[left])
    if role in ("q", "v"):
        line = _cubic(channel, left, share, line)
    return Read(channel, np.where(hit | at_ends, channel.x[near], line), between, f"between {at_most}")


def _means(channel: Channel, base: Channel) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Mean over the interval of each row, and whether samples cover it; each sample stands for its cell."""
    starts, ends = channel.cells()
    edges = np.column_stack([starts, ends]).ravel()
    lengths = np.column_stack([ends - starts, np.zeros(len(ends))]).ravel()
    told = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
    total = np.concatenate([[0.0], np.cumsum(lengths * np.repeat(channel.x, 2))[:-1]])
    low, high = base.cells()
    covered = np.interp(high, edges, told) - np.interp(low, edges, told)
    sums = np.interp(high, edges, total) - np.interp(low, edges, total)
    valid = covered >= COVERED * (high - low)
    return sums / np.where(valid, covered, 1.0), valid


def _cubic(channel: Channel, left: npt.NDArray[np.int64], share: Array, line: Array) -> Array:
    """The cubic through the two samples on either side (Lagrange); the line where steps are uneven, or at an end."""
    first = np.clip(left - 1, 0, max(len(channel.t) - 4, 0))
    if len(channel.t) < 4:
        return line
    t, x = (np.stack([column[first + k] for k in range(4)]) for column in (channel.t, channel.x))
    steps = np.diff(t, axis=0)
    even = ((steps >= EVEN * channel.period) & (steps <= channel.longest)).all(axis=0) & (first == left - 1)
    at = t[1] + share * (t[2] - t[1])
    cubic = np.zeros(len(share))
    for k in range(4):
        others = [one for one in range(4) if one != k]
        cubic += x[k] * np.prod([(at - t[one]) / (t[k] - t[one]) for one in others], axis=0)
    return np.where(even, cubic, line)


def _notes(path: Path, base: Channel, kept: Mapping[str, Read], t: Array) -> Iterator[str]:
    """Say what was joined on what, at which rate each channel was sampled, and which samples were left out."""
    others = {name: one for name, one in kept.items() if one.channel is not base}
    if not all(one.valid.all() and np.array_equal(one.channel.t, base.t) for one in others.values()):
        together: dict[str, list[str]] = {}
        for name, one in others.items():
            together.setdefault(f"({one.channel.span}) {one.how}", []).append(name)
        said = "; ".join(f"{_quoted(names)} {how}" for how, names in together.items())
        joined = f'channels with times of their own were put on the times of "{base.name}" ({base.span}): {said}.'
        yield f"{path.stem}: {joined} The rows are those that all of them have, {t[0]:.6g} s to {t[-1]:.6g} s."
    ordered: dict[str, list[str]] = {}
    for name, one in kept.items():
        for text in one.channel.done:
            ordered.setdefault(text.format(time="time"), []).append(name)
    yield from (f"{path.stem}: {_quoted(names)}: {text}" for text, names in ordered.items())
    invalid = {one.channel.name: one.channel.invalid for one in kept.values() if one.channel.invalid}
    if invalid:
        counts = ", ".join(f'{count:,} of "{name}"' for name, count in invalid.items())
        yield f"{path.stem}: invalid samples were left out: {counts}."


def _quoted(names: Sequence[str]) -> str:
    return listed(tuple(f'"{name}"' for name in names))
