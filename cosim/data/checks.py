"""Judgements on columns that were read: each refusal is one sentence that names file, column, row and value.

Rows are counted from 1, the header not counted. Nothing is repaired.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cosim.data.limits import LARGEST, listed, short
from cosim.data.questions import coarse_time, empty, repeated, untimed
from cosim.data.runs import many, mixed, split, text_of
from cosim.support.errors import RecordingError

SLOWEST = 10.0
"""Longest sample time of an axis [s]."""
COARSE = 0.5
"""Share of rows whose time is that of the row before, beyond which time is written with too few digits."""
BRIDGED, WORTH = 0.05, 50
"""Steps of time up to so many s are put on an even grid; it may have so many times the rows of the recording."""


def renamed(path: Path, values: dict[str, np.ndarray], columns: Mapping[str, str]) -> dict[str, np.ndarray]:
    """Rename columns; one whose name is taken over by another is kept as `name_original`."""
    for name, source in columns.items():
        if source not in values:
            message = f'{path} has no column "{short(source)}" to serve as {name}; it has: {listed(tuple(values))}.'
            if "," in source and "=" in source:
                message += f" Several go with spaces: --columns {short(f'{name}={source}'.replace(',', ' '))}."
            raise RecordingError(message, culprit=str(path), value=source, choices=tuple(values))
    sources = {source: name for name, source in columns.items()}
    taken = {name: f"{name}_original" for name in columns if name in values and name not in sources}
    return {sources.get(name, taken.get(name, name)): column for name, column in values.items()}


def renamed_units(units: Mapping[str, str], columns: Mapping[str, str]) -> dict[str, str]:
    """Give units the names that their columns got."""
    sources = {source: name for name, source in columns.items()}
    return {sources.get(name, name): text for name, text in units.items()}


def chosen(values: Mapping[str, np.ndarray], required: tuple[str, ...]) -> tuple[str, ...]:
    """Resolve alternatives: of `q|v` the first that is there."""
    options = [[name for name in rule.split("|") if name in values] for rule in required]
    return tuple(names[0] for names in options if names)


def check_names(path: Path, values: dict[str, np.ndarray], required: tuple[str, ...], units: Mapping[str, str]) -> None:
    """Refuse a table without a needed column, and a unit for a column that is not there."""
    have = listed(tuple(values))
    for rule in ("t", *required):
        if not any(name in values for name in rule.split("|")):
            first = rule.split("|")[0]
            lacks = f"{path} has no column {rule.replace('|', ' or ')}; it has: {have}."
            message = f"{lacks} Name it with --columns {first}=..."
            if rule == "t":
                raise untimed(path, values, message)
            raise RecordingError(message, culprit=str(path), value=rule, choices=tuple(values))
    for name in units:
        if name not in values:
            message = f'{path} has no column "{short(name)}" to give a unit to; it has: {have}.'
            raise RecordingError(message, culprit=str(path), value=name, choices=tuple(values))


def numbers(
    path: Path, values: dict[str, np.ndarray], needed: tuple[str, ...]
) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Refuse needed columns that are not finite numbers, and leave out other such columns with a note."""
    table, notes = {}, []
    for name, column in values.items():
        fault = _fault(column)
        if fault is None:
            table[name] = np.ascontiguousarray(column, dtype=np.float64)
        elif name in needed and _is_empty_only(column):
            raise empty(path, name, fault)
        elif name in needed:
            raise RecordingError(f'{path}: column "{short(name)}" holds {fault}.', culprit=str(path), value=name)
        else:
            notes.append(f'{path.stem}: column "{short(name)}" was left out because it holds {fault}.')
    return table, tuple(notes)


def _fault(column: np.ndarray) -> str | None:
    if column.dtype.kind not in "fiub":
        row, value = next(((row, value) for row, value in enumerate(column) if not _is_number(value)), (0, column[0]))
        return f'"{short(str(value))}" at row {row + 1:,}, which is not a number'
    bad = np.flatnonzero(~np.isfinite(column))
    if not len(bad):
        large = np.flatnonzero(np.abs(column) > LARGEST)
        return f"{column[large[0]]:.3g} at row {large[0] + 1:,}, which is beyond any axis" if len(large) else None
    more = f" ({len(bad):,} such rows)" if len(bad) > 1 else ""
    return f"{column[bad[0]]} at row {bad[0] + 1:,}, which is not a finite number{more}"


def _is_empty_only(column: np.ndarray) -> bool:
    """Whether every sample of a column that is no finite number is none at all."""
    return column.dtype.kind == "f" and bool(np.isnan(column[~np.isfinite(column)]).all())


def _is_number(value: Any) -> bool:
    """Tell text that no number can be read from; a column of text is at fault where its first such value is."""
    try:
        float(value)
    except (TypeError, ValueError):
        return False
    return True


def check_time(path: Path, t: np.ndarray, minimum: int, values: Mapping[str, np.ndarray]) -> None:
    """Refuse a table that is too short or whose time does not grow; `values` are its columns by their own names."""
    if len(t) < minimum:
        message = f"{path} has {len(t)} row{'s' * (len(t) != 1)}; at least {minimum} are needed."
        raise RecordingError(message, culprit=str(path), value=len(t))
    wrong = np.flatnonzero(np.diff(t) <= 0)
    if not len(wrong):
        return
    row, before, after = int(wrong[0]) + 2, float(t[wrong[0]]), float(t[wrong[0] + 1])
    if after < before:
        message = f"{path}: time runs backwards at row {row:,} ({before:.9g} s to {after:.9g} s)."
        if split(path)[0].is_file():
            raise many(path, values, t, message)
        raise RecordingError(f"{message} Split the file there.", culprit=str(path), value=after)
    message = f"{path}: time stands still at row {row:,} ({before:.9g} s to {after:.9g} s)"
    if (apart := mixed(path, values, t)) and split(path)[0].is_file():
        raise RecordingError(f"{message}: {apart}", culprit=str(path), value=after)
    if float(np.mean(np.diff(t) == 0)) > COARSE:
        raise coarse_time(path, f"{message}.", t)
    raise repeated(path, f"{message}{_differing(values, row)}.")


def _differing(values: Mapping[str, np.ndarray], row: int) -> str:
    """Say how a row (from 1) differs from the one before it."""
    pairs = [(name, *column[row - 2 : row].tolist()) for name, column in values.items()]
    name, one, other = next(((name, one, other) for name, one, other in reversed(pairs) if one != other), ("", 0, 0))
    return f' and its rows differ: "{short(name)}" is {text_of(one)} and {text_of(other)}' if name else ""


def check_motion(path: Path, table: dict[str, np.ndarray], needed: tuple[str, ...]) -> None:
    """Refuse a needed column that never changes."""
    for name in needed:
        if np.ptp(table[name]) == 0:
            value = table[name][0]
            message = f'{path}: column "{name}" is {value:.6g} in every row; a constant signal tells nothing.'
            raise RecordingError(message, culprit=str(path), value=float(value))


def check_sampling(path: Path, t: np.ndarray) -> None:
    """Refuse time stamps that are no sampling of an axis: too slow, or steps of which few are the sample time.

    Signals are put on an even grid of the median step where they jitter; where that is a tiny part of the usual step,
    the grid would have millions of rows for one.
    """
    steps = np.diff(t)
    dt = float(np.median(steps))
    if dt > SLOWEST:
        rule = f"an axis is sampled every {SLOWEST:g} s at least"
        way = "If its time counts another unit than s, say which with --units t=ms"
        raise RecordingError(f"{path} is sampled every {dt:.3g} s; {rule}. {way}.", culprit=str(path), value=dt)
    rows = float(steps[steps <= BRIDGED].sum()) / dt
    if rows > WORTH * len(t):
        said = f"half of its time steps are {dt:.3g} s or less and others {float(steps.max()):.3g} s"
        text = f"{path}: {said}: that is no sample time. Export it with one sample time."
        raise RecordingError(text, culprit=str(path), value=dt)
