"""CSV exports of Beckhoff's TwinCAT Scope: a table of facts, one of channels, then values behind time columns.

The rows of the second table begin with their key (`Name`, `SymbolName`, `SampleTime[ms]`, `Unit` ...) and repeat it at
each time column: once for every channel, or once for all channels of one sample time, as the export was told. Times
count ms from the start of the export, or 100 ns since 1601 ("full timestamp").
Sources: Beckhoff Information System, TE13xx Scope View, "Export in csv" and "Scope Settings"; the recorded files in the
tests of github.com/CagtayFabry/pytcs show the layouts.
"""

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from cosim.data.columns import Columns
from cosim.data.text.layout import Layout
from cosim.data.text.table import table_of
from cosim.data.text.unit_words import is_unit, spelled
from cosim.support.errors import RecordingError

SEPARATORS = ("\t", ";", ",")
CHANNELS = ("SampleTime[ms]", "SymbolName", "Data-Type", "VariableSize")
"""Keys of which one tells a table of channels."""
KEYS: tuple[str, ...] = (
    *("Name", "SymbolComment", "Data-Type", "SampleTime[ms]", "VariableSize", "SymbolBased", "IndexGroup"),
    *("IndexOffset", "SymbolName", "NetID", "NetId", "Port", "Offset", "ScaleFactor", "BitMask", "Unit"),
    *("Unit ScaleFactor", "Unit Offset"),
)
STARTS = ("Starttime of export", "StartRecord")
TICKS = re.compile(r"[0-9]{1,18}")
"""A file time, up to the year 4769."""
TICKED = 1e16
"""Times above this are file times: in ms they would be 300,000 years."""
TICK, EPOCH = 1e-7, 11_644_473_600
"""A tick of Windows' file time [s], and the start of 1970 in it [s]."""


def recognises(lines: Sequence[str]) -> bool:
    """Whether a text is an export of TwinCAT Scope."""
    firsts = [_cells(line, _separator(lines))[0] for line in lines[:40]]
    return "Name" in firsts and any(key in firsts for key in CHANNELS) and firsts[0] == "Name"


def read(path: Path, data: bytes, lines: Sequence[str]) -> Columns:
    """Read an export of TwinCAT Scope; the channels behind each time column have its times."""
    separator = _separator(lines)
    facts, keys, first = _head(lines, separator)
    names, times = _channels(path, keys)
    columns = _values(path, data, separator, first, len(names))
    values, clocks = _channels_of(columns, names, times)
    units = {name: text for name, text in zip(names, _units(keys, names), strict=True) if text and name in values}
    return Columns(values, units, format="TwinCAT Scope", start=_start(facts), clocks=clocks)


def _values(path: Path, data: bytes, separator: str, first: int, count: int) -> list[np.ndarray]:
    """Return every column below the table of channels; rows end early where slow channels have no more samples."""
    sign, rows = separator.encode(), [row.rstrip(b"\r") for row in data.split(b"\n")[first:]]
    rows = [row + sign * (count - 1 - row.count(sign)) for row in rows if row.strip() and row.strip() != b"EOF"]
    decimal = "," if separator != "," and any(b"," in row for row in rows[:100]) else "."
    columns = table_of(path, b"\n".join(rows), Layout(separator, decimal, count, 0)).values
    return [columns.get(f"#{place + 1}", np.full(len(rows), np.nan)) for place in range(count)]


def _separator(lines: Sequence[str]) -> str:
    line = next((line for line in lines if line.startswith(("SampleTime[ms]", "SymbolName", "Data-Type"))), "")
    return max(SEPARATORS, key=line.count) if line else "\t"


def _cells(line: str, separator: str) -> list[str]:
    return [cell.strip().strip('"') for cell in line.rstrip("\r").split(separator)]


def _head(lines: Sequence[str], separator: str) -> tuple[dict[str, list[str]], dict[str, list[str]], int]:
    """Return the facts of the export, the rows of the table of channels by key, and the line after it."""
    facts: dict[str, list[str]] = {}
    keys: dict[str, list[str]] = {}
    first = 0
    for number, line in enumerate(lines):
        cells = _cells(line, separator)
        if cells[0] in ("Name", "File", *STARTS, "Endtime of export", "EndRecord") and number < 4 and not keys:
            facts[cells[0]] = cells
        elif cells[0] in KEYS:
            keys[cells[0]], first = cells, number + 1
        elif keys and line.strip():
            break
    return facts, keys, first


def _channels(path: Path, keys: dict[str, list[str]]) -> tuple[list[str], list[int]]:
    """Return the name of each column, a time column being named as its key, and where the time columns are."""
    key = "Name" if "Name" in keys else "SymbolName"
    names = keys.get(key, [])
    while names and not names[-1]:
        names = names[:-1]
    times = [place for place, name in enumerate(names) if name == key]
    if not times or len(names) < 2:
        text = f"{path}: its table of channels has no time columns; export it from TwinCAT Scope with Timelines = All."
        raise RecordingError(text, culprit=str(path))
    return names, times


def _channels_of(
    columns: Sequence[np.ndarray], names: Sequence[str], times: Sequence[int]
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return the channels and the times [s] of each; groups may end early, and share equal times."""
    clocks = [columns[start].astype(np.float64) for start in times]
    there = [~np.isnan(clock) for clock in clocks]
    first = min((float(clock[rows][0]) for clock, rows in zip(clocks, there, strict=True) if rows.any()), default=0.0)
    values: dict[str, np.ndarray] = {}
    owned: dict[str, np.ndarray] = {}
    for start, end, clock, rows in zip(times, [*times[1:], len(names)], clocks, there, strict=True):
        seconds = (clock[rows] - first) * TICK if first > TICKED else clock[rows] * 1e-3
        seconds = next((one for one in owned.values() if np.array_equal(one, seconds)), seconds)
        channels = {names[place]: columns[place][rows] for place in range(start + 1, end)}
        values |= channels
        owned |= dict.fromkeys(channels, seconds)
    return values, owned


def _units(keys: dict[str, list[str]], names: Sequence[str]) -> list[str]:
    """Return the unit of each column: `V (Voltage)` is V, `(None)` is none."""
    cells = [*keys.get("Unit", []), *[""] * len(names)][: len(names)]
    texts = [spelled(cell.split(" (")[0]) for cell in cells]
    return [text if is_unit(text) else "" for text in texts]


def _start(facts: dict[str, list[str]]) -> str:
    cells = next((facts[key] for key in STARTS if key in facts), [])
    if len(cells) < 2 or not TICKS.fullmatch(cells[1]):
        return ""
    return datetime.fromtimestamp(int(cells[1]) * TICK - EPOCH, UTC).isoformat(timespec="milliseconds")
