"""Tables in long form: a row is one reading of one signal, `time, name, value`, as historians and brokers write them.

Each name becomes a channel with the times of its own readings; a column of units gives their units.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from cosim.data.columns import Columns
from cosim.data.limits import check_columns
from cosim.data.roles import is_named
from cosim.data.text.own_times import seconds

NAMES = frozenset(
    (
        *("name", "signal", "channel", "variable", "tag", "tagname", "pv", "field", "_field", "parameter", "sensor"),
        *("key", "metric", "measurement", "item", "symbol", "series", "node", "topic", "path"),
    )
)
"""Names of the column that says which signal a row is of, in small letters."""
VALUES = frozenset(("value", "_value", "val", "reading", "data", "wert", "y"))
"""Names of the column of the readings."""
UNITS = frozenset(("unit", "units", "einheit"))
Channels = dict[str, np.ndarray]
LEAST = 10
"""Readings of a signal on average: a column of remarks has less."""


def in_columns(path: Path, found: Columns) -> Columns:
    """Return a table in long form with a channel for each of its signals; any other table as it is."""
    place = None if found.clocks else _places(found)
    if place is None:
        return found
    time, name, value = place
    names = np.array([str(one) for one in found.values[name]], dtype=object)
    signals = list(dict.fromkeys(names.tolist()))
    if not 1 < len(signals) <= len(names) / LEAST:
        return found
    check_columns(path, len(signals))
    clock, readings = seconds(path, found, time), _numbers(found.values[value])
    values, clocks = by_signal(names, clock, readings)
    note = f"{path.stem}: its rows are readings of {len(signals)} signals; each became a channel with its own times."
    units = _units(found, names)
    return replace(found, values=values, units=units, clocks=clocks, numbered=False, notes=(*found.notes, note))


def by_signal(names: np.ndarray, t: np.ndarray, readings: np.ndarray) -> tuple[Channels, Channels]:
    """Return the readings of each signal in the order of their times, and these; readings without a time are none."""
    values, clocks = {}, {}
    for name in dict.fromkeys(names.tolist()):
        rows = np.flatnonzero((names == name) & np.isfinite(t))
        rows = rows[np.argsort(t[rows], kind="stable")]
        values[name], clocks[name] = readings[rows], t[rows]
    return values, clocks


def _places(found: Columns) -> tuple[str, str, str] | None:
    """Return the columns of time, name and value, or None."""
    columns = found.values
    texts = [name for name, column in columns.items() if column.dtype == object]
    if found.numbered:
        numeric = [name for name in columns if name not in texts]
        if len(columns) == 3 and len(texts) == 1 and len(numeric) == 2:
            return numeric[0], texts[0], numeric[1]
        return None
    named = {name: name.strip().lower() for name in columns}
    signal = [name for name in texts if named[name] in NAMES]
    value = [name for name in columns if named[name] in VALUES and name not in signal]
    times = [name for name in columns if name not in (*signal, *value) and is_named(name, "time")]
    return (times[0], signal[0], value[0]) if times and len(signal) == len(value) == 1 else None


def _numbers(column: np.ndarray) -> np.ndarray:
    return np.array([_number(one) for one in column]) if column.dtype == object else column.astype(np.float64)


def _number(value: object) -> float:
    try:
        return float(str(value))
    except ValueError:
        return float("nan")


def _units(found: Columns, names: np.ndarray) -> dict[str, str]:
    """Return the unit of each signal, as its first reading states it."""
    column = next((found.values[name] for name in found.values if name.strip().lower() in UNITS), None)
    if column is None:
        return {}
    first: dict[str, str] = {}
    for name, text in zip(names, column, strict=True):
        first.setdefault(name, text if isinstance(text, str) else "")
    return {name: text for name, text in first.items() if text}
