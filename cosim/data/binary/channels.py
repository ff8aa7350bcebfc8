"""The arrays of a file as a table of those that have one length, or as channels with times of their own.

A vector of time may belong to each channel, or to each device.
"""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cosim.data.columns import Columns
from cosim.data.limits import check_cells, listed
from cosim.data.roles import is_named
from cosim.data.text.own_times import grouped, owners, seconds

PLAIN = ("data", "value", "values", "val", "y", "signal", "samples")
"""Names of the values of a channel that has its name from its group."""
GROWS = 0.8
"""Share of the steps of a time that are positive: a few samples may stand twice or be late."""
MOST = 200
"""Vectors of time of one file: each is compared with each channel."""
MOST_BESIDE = 100
"""Signals of one table: of two dimensions the longer one is time, as tools for simulation log to arrays."""


def columns_of_arrays(path: Path, found: Mapping[str, np.ndarray], units: Mapping[str, str], sign: str = "") -> Columns:
    """Return the arrays of a file as channels with times of their own, else those of the commonest length as a table.

    Args:
        path: the file, for messages and notes.
        found: arrays by their whole names.
        units: the units that the file states, by name.
        sign: what parts a name from its group, where names are long: in a table the last part is the name if it tells.

    Raises:
        RecordingError: as `with_clocks`.
    """
    if channels := with_clocks(path, found, units):
        return channels
    names = _last_parts(found, sign) if sign else {name: name for name in found}
    table = {names[name]: array for name, array in found.items()}
    values = vectors(path, table)
    stated = {names.get(name, name): text for name, text in units.items() if text}
    kept = {name: text for name, text in stated.items() if name in values}
    return Columns(values, kept, notes=_left_out(path, table, values))


def with_clocks(path: Path, found: Mapping[str, np.ndarray], units: Mapping[str, str]) -> Columns | None:
    """Return the arrays of a file as channels with times of their own; None where they have one time, or none.

    Args:
        path: the file, for messages and notes.
        found: arrays by their whole names, groups parted by points or strokes; a table (rows, k) is k channels.
        units: the units that the file states, by name.

    Raises:
        RecordingError: what a time counts is not stated and cannot be known from its rate.
    """
    vectors = _vectors(found)
    times = [name for name, one in vectors.items() if _is_time(name, one)]
    channels = [name for name in vectors if name not in times]
    if not 1 < len(times) <= MOST or not channels:
        return None
    owned = owners(channels, times, {name: len(one) for name, one in vectors.items()})
    used = list(dict.fromkeys(owned.values()))
    if len(used) < 2 or all(np.array_equal(vectors[used[0]], vectors[one]) for one in used):
        return None
    check_cells(path, sum(len(vectors[name]) for name in (*owned, *used)), 1)
    plain = Columns({name: vectors[name].astype(np.float64) for name in (*owned, *used)}, dict(units))
    clocks = {time: seconds(path, plain, time) for time in used}
    names = _short([*owned, *used])
    left = tuple(name for name in channels if name not in owned)
    note = f"{path.stem}: arrays without a time of their length were left out: {listed(left)}."
    return replace(
        plain,
        values={names[name]: plain.values[name] for name in owned} | {names[time]: clocks[time] for time in used},
        units={names[name]: text for name, text in units.items() if name in owned},
        clocks={names[name]: clocks[owned.get(name, name)] for name in (*owned, *used)},
        notes=(note,) if left else (),
    )


def _vectors(found: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the numeric arrays as vectors, longer than one."""
    numeric = {name: value for name, value in found.items() if value.dtype.kind in "fiub" and value.size > 1}
    tables = {name: as_columns(value) for name, value in numeric.items()}
    return {
        f"{name}_{k + 1}" if is_table(numeric[name].shape) else name: table[:, k]
        for name, table in tables.items()
        for k in range(table.shape[1])
    }


def _is_time(name: str, column: np.ndarray) -> bool:
    """Whether a vector is named as a time and grows, as far as its samples are in order."""
    own = is_named(grouped(name)[1], "time") and column.dtype.kind in "fiu"
    return own and float(np.mean(np.diff(column.astype(np.float64)) > 0)) >= GROWS


def _last_parts(names: Collection[str], sign: str) -> dict[str, str]:
    """Return for each path its last part, where no other path has it; else the whole."""
    last = {name: name.rpartition(sign)[2] for name in names}
    often = Counter(last.values())
    return {name: one if often[one] == 1 else name for name, one in last.items()}


def _short(names: Sequence[str]) -> dict[str, str]:
    """Return for each name its last part where that is the only one; that of its group where it says nothing."""
    parts = {name: grouped(name) for name in names}
    telling = {name: group if group and last.lower() in PLAIN else name for name, (group, last) in parts.items()}
    last = {name: grouped(text)[1] for name, text in telling.items()}
    often = Counter(last.values())
    return {name: text if often[text] == 1 else name for name, text in last.items()}


def is_table(shape: tuple[int, ...]) -> bool:
    """Whether an array holds several signals beside each other."""
    return len(shape) == 2 and 1 < min(shape) <= MOST_BESIDE and max(shape) > min(shape)


def vectors(path: Path, found: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Keep the numeric vectors that have the commonest length longer than one; a table is its columns, `data_1` ...

    A table counts once: many columns of gains must not outnumber the few vectors of a recording.
    """
    signals = {name: as_columns(value) for name, value in found.items() if value.dtype.kind in "fiub"}
    lengths = Counter(len(one) for one in signals.values() if len(one) > 1)
    rows = lengths.most_common(1)[0][0] if lengths else 0
    kept = {name: value for name, value in signals.items() if len(value) == rows}
    check_cells(path, rows, sum(value.shape[1] for value in kept.values()))
    return {
        f"{name}_{k + 1}" if is_table(value.shape) else name: np.asarray(value[:, k], dtype=np.float64)
        for name, value in kept.items()
        for k in range(value.shape[1])
    }


def _left_out(path: Path, found: dict[str, np.ndarray], kept: Collection[str]) -> tuple[str, ...]:
    """Note the arrays of numbers that `vectors` did not keep; a number alone is a setting and needs no note."""
    numeric = [name for name, value in found.items() if value.dtype.kind in "fiub" and value.size > 1]
    lost = [name for name in numeric if name not in kept and f"{name}_1" not in kept]
    shapes = [f"{name} ({' x '.join(map(str, found[name].shape))})" for name in lost]
    return (f"{path.stem}: arrays of other lengths were left out: {listed(tuple(shapes))}.",) if shapes else ()


def as_columns(value: np.ndarray) -> np.ndarray:
    """Signals of an array as columns (rows, k); none of what is neither a vector nor a table."""
    if value.ndim == 1:
        return value[:, None]
    if not is_table(value.shape):
        return np.empty((0, 0))
    return value if len(value) > value.shape[1] else value.T
