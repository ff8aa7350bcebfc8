"""JSON as columns: records, one object a line, columns by name, rows of numbers, and tests of WPILib's SysId.

    [{"t": 0.0, "q": 1.2}, ...]             records; also one a line, and also as a member of an object
    {"t": [0.0, ...], "q": [1.2, ...]}      columns; those of the commonest length, wherever they are in the file
    {"columns": ["t", "q"], "data": [[0.0, 1.2], ...]}    rows with names, as pandas writes them
    [[0.0, 1.2], ...]                       rows without names

Names of nested members are joined by points, `joint.position`; a list of numbers is `q.1`, `q.2` ... A member `units`
with texts by column states units. Several members with rows of one width are recordings, told apart by `part`.
"""

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosim.data.columns import Columns
from cosim.data.limits import check_cells, check_columns, check_time, check_unpacked, listed, short
from cosim.data.text.encoding import text_of
from cosim.support.errors import RecordingError

OPENED, PARTED = 100, 40
"""Bytes in memory of an object or a list, and of each value in it, as Python holds them."""
DEEPEST = 20
"""Members inside members that are looked into; no logger writes more."""
PART = "part"
"""Name of the column that tells apart recordings which are members of one object."""
UNITS = ("units", "unit")
SYSID = ("timestamp", "voltage", "position", "velocity")
"""Columns of a test of WPILib's SysId, kinds Simple, Elevator and Arm: s, V, units of the file, units per second.

Source: github.com/wpilibsuite/sysid, sysid-application/src/main/native/cpp/analysis/AnalysisManager.cpp.
"""
SYSID_UNITS = {"radians": "rad", "degrees": "deg", "rotations": "turn", "meters": "m", "feet": "ft", "inches": "in"}
EVERY = 10_000
"""Lines of text between two looks at the time that reading took."""
Found = dict[str, list[Any]]


@dataclass(frozen=True)
class Table:
    """A table in a file: the path of members to it, its columns, and whether they have no names."""

    name: str
    found: Found
    numbered: bool = False

    @property
    def size(self) -> int:
        """Number of values."""
        return sum(map(len, self.found.values()))


def read(path: Path) -> Columns:
    """Read a JSON file, or one of an object a line, also .gz.

    Raises:
        RecordingError: it is no JSON, or holds no table of numbers.
    """
    data, _ = text_of(path)
    return columns_of(path, data)


def is_records(data: bytes) -> bool:
    """Whether a text of another suffix is one of an object a line: its first line is a whole object."""
    first = data.lstrip()[: 1 << 16].partition(b"\n")[0].strip()
    if not (first.startswith(b"{") and first.endswith(b"}")):
        return False
    try:
        return isinstance(json.loads(first), dict)
    except (ValueError, RecursionError):
        return False


def columns_of(path: Path, data: bytes) -> Columns:
    """Make columns of JSON text."""
    claimed = OPENED * (data.count(b"{") + data.count(b"[")) + PARTED * data.count(b",")
    check_unpacked(path, claimed + len(data))
    value, notes = _value(path, data)
    if isinstance(value, dict) and (tests := _parts(value)):
        return _of_parts(path, value, tests, notes)
    tables = list(_tables(path, value))
    if not tables:
        text = f"{path} holds no table: neither records with numbers, nor lists of them of one length"
        begins = short(data[:60].decode("utf-8", "replace"))
        raise RecordingError(f"{text}; it begins with {begins!r}.", culprit=str(path))
    table = max(tables, key=lambda one: one.size)
    chosen, *others = (one.name or "the file's own members" for one in [table, *(x for x in tables if x is not table)])
    notes += (f"{path.stem}: of its tables {chosen} was read; left out: {listed(tuple(others))}.",) if others else ()
    arrays = {name: _array(cells) for name, cells in table.found.items()}
    stated = _units(value) if isinstance(value, dict) else {}
    return Columns(arrays, {k: u for k, u in stated.items() if k in arrays}, notes=notes, numbered=table.numbered)


def _value(path: Path, data: bytes) -> tuple[Any, tuple[str, ...]]:
    """Parse a text: one value, or one a line, whose last line may be torn."""
    text = data.decode("utf-8", "replace")
    try:
        return json.loads(text), ()
    except RecursionError:
        raise RecordingError(f"{path} holds lists in lists, too deep for a recording.", culprit=str(path)) from None
    except ValueError as error:
        whole = error
    lines = [(number, line) for number, line in enumerate(text.split("\n"), 1) if line.strip()]
    records: list[Any] = []
    for number, line in lines:
        if number % EVERY == 0:
            check_time(path)
        try:
            records.append(json.loads(line))
        except (ValueError, RecursionError):
            if number == lines[-1][0] and records:
                return records, (f"{path.stem}: its last line was left out, as it is torn: {short(line)!r}.",)
            sentence = f"line {number:,} is no JSON: {short(line)!r}" if records else f"it is no JSON: {whole}"
            raise RecordingError(f"{path}: {sentence}.", culprit=str(path), value=number) from None
    return records, ()


def _parts(value: Mapping[str, Any]) -> dict[str, list[list[Any]]]:
    """Return the members that are rows of numbers of one width, if there are several."""
    rows = {name: member for name, member in value.items() if _is_rows(member)}
    return rows if len(rows) > 1 and len({len(member[0]) for member in rows.values()}) == 1 else {}


def _of_parts(
    path: Path, value: Mapping[str, Any], parts: Mapping[str, list[list[Any]]], notes: tuple[str, ...]
) -> Columns:
    """Put members below each other, the latest first, so that time runs backwards wherever another begins."""
    ordered = sorted(parts, key=lambda name: -_number(parts[name][0][0]))
    rows = [row for name in ordered for row in parts[name]]
    width = len(rows[0])
    check_cells(path, len(rows), width + 1)
    sysid = "sysid" in value and width == len(SYSID)
    names = SYSID if sysid else tuple(f"#{k}" for k in range(1, width + 1))
    arrays = {name: _array([row[k] for row in rows]) for k, name in enumerate(names)}
    arrays[PART] = np.array([name for name in ordered for _ in parts[name]], dtype=object)
    own = SYSID_UNITS.get(str(value.get("units", "")).lower(), "") if sysid else ""
    units = {"timestamp": "s", "voltage": "V"} | ({"position": own, "velocity": f"{own}/s"} if own else {})
    return Columns(
        arrays, units if sysid else {}, format="WPILib SysId" if sysid else "", notes=notes, numbered=not sysid
    )


def _tables(path: Path, value: Any, name: str = "", depth: int = 0) -> Iterator[Table]:
    """Walk through a value to the tables in it."""
    if isinstance(value, list) and (table := _of_list(path, value, name)):
        yield table
    if not isinstance(value, dict) or depth > DEEPEST:
        return
    names, rows = value.get("columns"), value.get("data")
    if isinstance(names, list) and isinstance(rows, list) and _is_rows(rows) and len(names) == len(rows[0]):
        yield Table(name, {str(one): [row[k] for row in rows] for k, one in enumerate(names)})
        return
    columns = _by_columns(value)
    if columns:
        yield Table(name, columns)
    taken = {one.rpartition(".")[0] if one not in value else one for one in columns}
    for key, member in value.items():
        if key not in taken:
            yield from _tables(path, member, f"{name}.{key}" if name else str(key), depth + 1)


def _of_list(path: Path, value: list[Any], name: str) -> Table | None:
    """Return the table of a list of records or of rows that hold numbers; None of any other list."""
    records = [one for one in value if isinstance(one, dict)]
    if records and len(records) == len(value):
        table = Table(name, _of_records(path, records))
    elif _is_rows(value):
        check_cells(path, len(value), len(value[0]))
        table = Table(name, {f"#{k + 1}": [row[k] for row in value] for k in range(len(value[0]))}, numbered=True)
    else:
        return None
    return table if any(_is_number(cells[0]) for cells in table.found.values()) else None


def _of_records(path: Path, records: Sequence[Mapping[str, Any]]) -> Found:
    """Return the columns of records; one that a record lacks has no value there."""
    rows = [dict(_leaves(one, "")) for one in records]
    names = list(dict.fromkeys(name for row in rows for name in row))
    check_columns(path, len(names))
    check_cells(path, len(rows), len(names))
    return {name: [row.get(name) for row in rows] for name in names}


def _leaves(value: Any, name: str, depth: int = 0) -> Iterator[tuple[str, Any]]:
    """Walk through a record to its values, each with the path to it."""
    if isinstance(value, dict | list) and depth < DEEPEST:
        pairs = value.items() if isinstance(value, dict) else enumerate(value, 1)
        for key, member in pairs:
            yield from _leaves(member, f"{name}.{key}" if name else str(key), depth + 1)
    else:
        yield name, value


def _by_columns(value: Mapping[str, Any]) -> Found:
    """Return the lists of values of the commonest length among the members of an object, tables as their columns."""
    lists = {name: member for name, member in value.items() if isinstance(member, list) and len(member) > 1}
    plain = {name: member for name, member in lists.items() if not any(isinstance(x, dict | list) for x in member)}
    wide = {name: member for name, member in lists.items() if _is_rows(member)}
    lengths = Counter(len(member) for member in [*plain.values(), *wide.values()])
    if not lengths:
        return {}
    rows = lengths.most_common(1)[0][0]
    found = {name: member for name, member in plain.items() if len(member) == rows}
    for name, member in wide.items():
        if len(member) == rows:
            found |= {f"{name}.{k + 1}": [row[k] for row in member] for k in range(len(member[0]))}
    return found if any(_is_number(member[0]) for member in found.values()) else {}


def _is_rows(value: Any) -> bool:
    """Whether a value is a list of equally long lists of values, two rows at least."""
    if not (isinstance(value, list) and len(value) > 1 and isinstance(value[0], list) and value[0]):
        return False
    width = len(value[0])
    return all(isinstance(row, list) and len(row) == width and not isinstance(row[0], dict | list) for row in value)


def _units(value: Mapping[str, Any]) -> dict[str, str]:
    stated: dict[Any, Any] = next((value[key] for key in UNITS if isinstance(value.get(key), dict)), {})
    return {str(name): text for name, text in stated.items() if isinstance(text, str)}


def _array(cells: Sequence[Any]) -> np.ndarray:
    """Return a column: numbers where all are numbers or nothing, integers that a double would cut exact, else text."""
    if not all(map(_is_number, cells)):
        return np.array([None if cell is None else str(cell) for cell in cells], dtype=object)
    if all(type(cell) is int for cell in cells) and 2**53 < max(map(abs, cells), default=0) < 2**63:
        return np.array(cells, dtype=np.int64)
    return np.array([_number(cell) for cell in cells], dtype=np.float64)


def _number(cell: Any) -> float:
    try:
        return float(cell)
    except (TypeError, ValueError, OverflowError):
        return math.nan


def _is_number(cell: Any) -> bool:
    """Whether a cell is a number or nothing."""
    return cell is None or isinstance(cell, int | float)
