"""Tables whose channels have times of their own: several columns of time, each in front of the channels it belongs to.

    Time [s]; Torque; Time [s]; Position        NI and LabVIEW; also Time 1, Torque, Time 2, Position
    tau; q; t_tau; t_q                          in any order, by their names

A column of time begins a group, which may end before the others do. Where all of them are alike, they are one time.

Elsewhere a channel has the time in its own group (`torque/time` of `torque/value`, `tau.time` of `tau`), or the one
that is named after it (`t_tau` of `tau`, `time_torque` of `torque`), or the only one of its length, in this order.
Where none of these tells one, it has no time.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from cosim.data.assign import units_stated
from cosim.data.columns import Columns
from cosim.data.roles import is_named
from cosim.data.text.names import SECONDS, words_of
from cosim.data.times import read_clock
from cosim.support.errors import RecordingError, UndecidedError

NUMBER = re.compile(r"\s*\(#\d+\)$")
"""What tells apart columns of one name."""
GROUPS = re.compile(r"(.*)[./]([^./]+)")
"""A name behind that of its group."""
AXES = ("x", "x_value", "channel name", "relative time")
"""Names that tools give to the times of a channel, in small letters; any other name says that it is a time."""


def parted(path: Path, found: Columns) -> Columns:
    """Return a table with its channels on clocks of their own, if several columns of it are times; else as it is.

    Raises:
        RecordingError: what the times count is not stated and cannot be known.
    """
    names = [*found.values]
    starts = [place for place, name in enumerate(names) if _is_time(found, name)]
    groups = list(pairwise([*starts, len(names)]))
    if found.clocks or len(starts) < 2:
        return found
    owned = {name: names[start] for start, end in groups for name in names[start + 1 : end]}
    if starts[0] or any(end - start < 2 for start, end in groups):
        owned = _by_name(found, [names[start] for start in starts])
        starts = [names.index(time) for time in dict.fromkeys(owned.values())]
        if len(starts) < 2:
            return found
    times = [found.values[names[start]] for start in starts]
    if all(np.array_equal(times[0], other, equal_nan=True) for other in times[1:]):
        return _of_one_time(found, names, starts)
    values: dict[str, np.ndarray] = {}
    clocks: dict[str, np.ndarray] = {}
    stamps = {time: seconds(path, found, time) for time in dict.fromkeys(owned.values())}
    for name, time in owned.items():
        there = np.isfinite(stamps[time])
        values[name], clocks[name] = found.values[name][there], stamps[time][there]
    units = {name: text for name, text in found.units.items() if name in values}
    return replace(found, values=values, units=units, clocks=clocks)


def _by_name(found: Columns, times: Sequence[str]) -> dict[str, str]:
    """Return the time that is named after each channel; nothing where a channel has none."""
    channels = [name for name in found.values if name not in times]
    owned = owners(channels, times, dict.fromkeys(found.values, len(next(iter(found.values.values())))))
    return owned if len(owned) == len(channels) else {}


def _of_one_time(found: Columns, names: Sequence[str], starts: Sequence[int]) -> Columns:
    """Keep the first of several columns of time that are alike, under the name that it has without its number."""
    others = {names[start] for start in starts[1:]}
    bare = {names[starts[0]]: NUMBER.sub("", names[starts[0]])}
    values = {bare.get(name, name): column for name, column in found.values.items() if name not in others}
    units = {bare.get(name, name): text for name, text in found.units.items() if name not in others}
    return replace(found, values=values, units=units)


def _is_time(found: Columns, name: str) -> bool:
    """Whether a column is named as a time and grows as far as it goes."""
    column, bare = found.values[name], NUMBER.sub("", name)
    named = bare.lower() in AXES or is_named(bare, "time")
    if not named or column.dtype.kind not in "fi":
        return False
    valid = column[np.isfinite(column)]
    return len(valid) > 1 and bool(np.all(np.diff(valid) > 0))


def seconds(path: Path, found: Columns, name: str) -> np.ndarray:
    """Return a column of time in seconds; NaN where it has ended.

    Raises:
        RecordingError: what it counts is not stated and cannot be known from its rate.
    """
    column = found.values[name]
    try:
        clock = read_clock(path, column, NUMBER.sub("", name), units_stated(found, name, "t"), servo=True)
    except UndecidedError as error:
        text = f"{error} Of a file whose channels have times of their own, write the unit into the name: Time [ms]."
        raise RecordingError(text, culprit=str(path), value=name) from error
    if clock.values.dtype == object:
        text = f'{path}: column "{name}" holds no times: {str(column[0])[:40]!r}.'
        raise RecordingError(text, culprit=str(path), value=name)
    return clock.seconds


def owners(channels: Iterable[str], times: Sequence[str], lengths: Mapping[str, int]) -> dict[str, str]:
    """Return which of the vectors of time belongs to each channel; one that has none is missing.

    Args:
        channels: names of channels.
        times: names of vectors of time.
        lengths: how long each is.
    """
    groups = {time: grouped(time)[0] for time in times}
    named = {time: _named_after(time) for time in times}
    owned: dict[str, str] = {}
    for name in channels:
        group, words = grouped(name)[0], set(words_of(name))
        fitting = [time for time in times if lengths[time] == lengths[name]]
        ways = (
            [time for time in fitting if groups[time] and groups[time] in (group, name)],
            [time for time in fitting if named[time] and named[time] <= words],
            fitting,
        )
        owner = next((way[0] for way in ways if len(way) == 1), None)
        owned |= {name: owner} if owner else {}
    return owned


def grouped(name: str) -> tuple[str, str]:
    """Return the group of a channel, empty where it has none, and its name in it."""
    found = GROUPS.fullmatch(name)
    return (found[1], found[2]) if found else ("", name)


def _named_after(time: str) -> set[str]:
    """Return the words in the name of a time that are none of a time: those of its channel."""
    words = words_of(grouped(time)[1])
    return {word for word in words if word not in SECONDS and not is_named(word, "time")}
