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

from cosim.checks import check_motion, check_names, check_time, chosen, numbers, renamed, renamed_units
from cosim.errors import OutputError
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
        values = renamed(path, found.values, columns or {})
        stated = renamed_units(found.units, columns or {}) | dict(units or {})
        stated |= {"q_d": stated["q"]} if "q" in stated and "q_d" in values and "q_d" not in stated else {}
        check_names(path, values, required, stated)
        table, notes = numbers(path, values, ("t", *chosen(values, required)))
        si = {name: unit(text) for name, text in stated.items() if name in table}
        table = {name: si[name].to_si(column) if name in si else column for name, column in table.items()}
        check_time(path, table["t"], MINIMUM_ROWS if required else 2)
        check_motion(path, table, chosen(values, required))
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
