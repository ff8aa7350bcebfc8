"""Recordings: samples with units and origin, judged when they are read and never repaired.

Names: `t` [s], `tau` [N.m, or N on a linear axis], `q` [rad or m] or a measured speed `v`, `q_d` (set point),
`temperature` [degC]; any further column is kept. SI inside. Messages count rows from 1, the header not counted.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import OutputError, RecordingError
from cosim.files import replacing, sha256
from cosim.formats import read_columns
from cosim.units import unit

REQUIRED = ("tau", "q|v")
"""Columns an identification needs beside `t`; a bar separates alternatives."""
MINIMUM_ROWS = 100
GAP = 1.5
"""A step of time longer than this many sample times is a gap."""


@dataclass(frozen=True)
class Gap:
    """A hole in a recording: after `row` (from 1), from `start` to `end` in s, about `missing` samples."""

    row: int
    start: float
    end: float
    missing: int


@dataclass(frozen=True)
class Recording:
    """Samples by column, float64 and of equal length, with units, origin and notes on what was left out."""

    name: str
    table: dict[str, np.ndarray]
    units: dict[str, str] = field(default_factory=dict)
    origin: dict[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @classmethod
    def read(
        cls,
        path: Path | str,
        columns: Mapping[str, str] | None = None,
        units: Mapping[str, str] | None = None,
        required: tuple[str, ...] = REQUIRED,
    ) -> "Recording":
        """Read and judge a recording.

        Args:
            path: CSV (also .gz), Parquet, MAT, HDF5 or MDF4 file.
            columns: our name to the file's name, {"tau": "force"}.
            units: our name to the unit in the file, {"q": "arcsec"}; values become SI. `q_d` is in the unit of `q`
                unless it is given its own.
            required: columns that must be there, move, and be finite; () for any table with a time.

        Raises:
            RecordingError: one sentence that names file, column, row and value.
            UnitError: a unit is unknown.
        """
        path = Path(path)
        found = read_columns(path)
        values = _renamed(path, found.values, columns or {})
        stated = _renamed_units(found.units, columns or {}) | dict(units or {})
        stated |= {"q_d": stated["q"]} if "q" in stated and "q_d" in values and "q_d" not in stated else {}
        _check_names(path, values, required, stated)
        table, notes = _numbers(path, values, ("t", *_chosen(values, required)))
        si = {name: unit(text) for name, text in stated.items() if name in table}
        table = {name: si[name].to_si(column) if name in si else column for name, column in table.items()}
        _check_time(path, table["t"], MINIMUM_ROWS if required else 2)
        _check_motion(path, table, _chosen(values, required))
        origin = found.origin | {"file": {"name": path.name, "sha256": sha256(path)}}
        return cls(path.stem, table, {"t": "s"} | {name: one.si for name, one in si.items()}, origin, notes)

    def write(self, path: Path | str, force: bool = False) -> Path:
        """Write .parquet (with units and origin), .csv or .csv.gz; the file is complete or absent.

        Raises:
            OutputError: the file exists and `force` is not set, or its suffix is none of these.
        """
        from cosim.writer import WRITERS

        path = Path(path)
        writer = next((write for suffix, write in WRITERS.items() if path.name.endswith(suffix)), None)
        if writer is None:
            raise OutputError(
                f"{path} cannot be written; a recording becomes: {', '.join(WRITERS)}.", culprit=str(path)
            )
        with replacing(path, force) as partial:
            writer(partial, self.table, self.units, self.origin)
        return path

    def __getitem__(self, column: str) -> np.ndarray:
        return self.table[column]

    def __contains__(self, column: object) -> bool:
        return column in self.table

    def __iter__(self) -> Iterator[str]:
        return iter(self.table)

    def __len__(self) -> int:
        return len(self.t)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns in their order."""
        return tuple(self.table)

    @property
    def t(self) -> np.ndarray:
        """Time stamps in s, shape (rows,)."""
        return self.table["t"]

    @property
    def sha256(self) -> str:
        """SHA-256 of the file this was read from; empty for one made here."""
        return str(self.origin.get("file", {}).get("sha256", ""))

    @property
    def duration(self) -> float:
        """Time from the first to the last sample in s."""
        return float(self.t[-1] - self.t[0])

    @cached_property
    def sample_time(self) -> float:
        """Median step of time in s."""
        return float(np.median(np.diff(self.t)))

    @cached_property
    def gaps(self) -> tuple[Gap, ...]:
        """Holes in time, in their order."""
        steps = np.diff(self.t)
        rows = np.flatnonzero(steps > GAP * self.sample_time)
        missing = np.rint(steps[rows] / self.sample_time).astype(int) - 1
        ends = zip(rows.tolist(), missing.tolist(), strict=True)
        return tuple(Gap(row + 1, float(self.t[row]), float(self.t[row + 1]), max(count, 1)) for row, count in ends)

    @cached_property
    def jitter(self) -> float:
        """RMS deviation of the steps of time from their median, relative to it, gaps left out."""
        steps = np.diff(self.t)
        regular = steps[steps <= GAP * self.sample_time]
        return float(np.sqrt(np.mean((regular / self.sample_time - 1) ** 2)))

    def quality(self) -> tuple[str, ...]:
        """Say in sentences what is odd about this recording and was not repaired."""
        sentences = list(self.notes)
        if self.jitter > 0.01:
            sentences.append(
                f"{self.name}: the sample time of {self.sample_time:.6g} s jitters by {self.jitter:.1%} rms."
            )
        if self.gaps:
            longest = max(self.gaps, key=lambda gap: gap.end - gap.start)
            sentences.append(
                f"{self.name}: {len(self.gaps)} gap(s) in time; the longest is {longest.end - longest.start:.6g} s "
                f"after row {longest.row:,} ({longest.start:.6g} s)."
            )
        return tuple(sentences)

    def frame(self) -> Any:
        """Return the table as a pandas DataFrame."""
        import pandas as pd

        return pd.DataFrame(self.table)


def _renamed(path: Path, values: dict[str, np.ndarray], columns: Mapping[str, str]) -> dict[str, np.ndarray]:
    """Rename columns; one whose name is taken over by another is kept as `name_original`."""
    for name, source in columns.items():
        if source not in values:
            have = ", ".join(values)
            message = f'{path} has no column "{source}" to serve as {name}; it has: {have}.'
            raise RecordingError(message, culprit=str(path), value=source, choices=tuple(values))
    sources = {source: name for name, source in columns.items()}
    taken = {name: f"{name}_original" for name in columns if name in values and name not in sources}
    return {sources.get(name, taken.get(name, name)): column for name, column in values.items()}


def _renamed_units(units: Mapping[str, str], columns: Mapping[str, str]) -> dict[str, str]:
    sources = {source: name for name, source in columns.items()}
    return {sources.get(name, name): text for name, text in units.items()}


def _chosen(values: Mapping[str, np.ndarray], required: tuple[str, ...]) -> tuple[str, ...]:
    """Resolve alternatives: of `q|v` the first that is there."""
    options = [[name for name in rule.split("|") if name in values] for rule in required]
    return tuple(names[0] for names in options if names)


def _check_names(
    path: Path, values: dict[str, np.ndarray], required: tuple[str, ...], units: Mapping[str, str]
) -> None:
    have = ", ".join(values)
    for rule in ("t", *required):
        if not any(name in values for name in rule.split("|")):
            first = rule.split("|")[0]
            message = (
                f"{path} has no column {rule.replace('|', ' or ')}; it has: {have}. Name it with --columns {first}=..."
            )
            raise RecordingError(message, culprit=str(path), value=rule, choices=tuple(values))
    for name in units:
        if name not in values:
            message = f'{path} has no column "{name}" to give a unit to; it has: {have}.'
            raise RecordingError(message, culprit=str(path), value=name, choices=tuple(values))


def _numbers(
    path: Path, values: dict[str, np.ndarray], needed: tuple[str, ...]
) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Refuse needed columns that are not finite numbers, and leave out other such columns with a note."""
    table, notes = {}, []
    for name, column in values.items():
        fault = _fault(column)
        if fault is None:
            table[name] = np.ascontiguousarray(column, dtype=np.float64)
        elif name in needed:
            raise RecordingError(f'{path}: column "{name}" holds {fault}.', culprit=str(path), value=name)
        else:
            notes.append(f'{path.stem}: column "{name}" was left out because it holds {fault}.')
    return table, tuple(notes)


def _fault(column: np.ndarray) -> str | None:
    if column.dtype == object:
        row, value = next((row, value) for row, value in enumerate(column) if not _is_number(value))
        return f'"{value}" at row {row + 1:,}, which is not a number'
    bad = np.flatnonzero(~np.isfinite(column))
    if not len(bad):
        return None
    more = f" ({len(bad):,} such rows)" if len(bad) > 1 else ""
    return f"{column[bad[0]]} at row {bad[0] + 1:,}, which is not a finite number{more}"


def _is_number(value: Any) -> bool:
    """Tell text that no number can be read from; a column of text is at fault where its first such value is."""
    try:
        float(value)
    except (TypeError, ValueError):
        return False
    return True


def _check_time(path: Path, t: np.ndarray, minimum: int) -> None:
    if len(t) < minimum:
        message = f"{path} has {len(t)} rows; at least {minimum} are needed."
        raise RecordingError(message, culprit=str(path), value=len(t))
    wrong = np.flatnonzero(np.diff(t) <= 0)
    if len(wrong):
        row, before, after = wrong[0] + 2, t[wrong[0]], t[wrong[0] + 1]
        how = "runs backwards" if after < before else "stands still"
        span = f"({before:.9g} s to {after:.9g} s)"
        message = f"{path}: time {how} at row {row:,} {span}. Split the file there."
        raise RecordingError(message, culprit=str(path), value=float(after))


def _check_motion(path: Path, table: dict[str, np.ndarray], needed: tuple[str, ...]) -> None:
    for name in needed:
        if np.ptp(table[name]) == 0:
            value = table[name][0]
            message = f'{path}: column "{name}" is {value:.6g} in every row; a constant signal tells nothing.'
            raise RecordingError(message, culprit=str(path), value=float(value))
