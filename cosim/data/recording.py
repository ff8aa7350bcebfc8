"""Recordings: samples with units and origin, judged when they are read and never repaired.

Names: `t` [s], `tau` [N.m, or N on a linear axis], `q` [rad or m] or a measured speed `v`, `q_d` (set point),
`temperature` [degC]; any further column is kept. SI inside. Messages count rows from 1, the header not counted.
"""

from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.data import held
from cosim.data.assign import assign
from cosim.data.assumed import assumed
from cosim.data.checks import check_motion, check_names, check_sampling, check_time, chosen, numbers
from cosim.data.columns import Columns, Request, as_columns, sha256_of
from cosim.data.one_run import rows_of_one, timed
from cosim.data.parts import read_run
from cosim.data.registers import at_an_end, continued
from cosim.data.runs import named
from cosim.data.speeds import with_speed
from cosim.data.times import clock_of
from cosim.support.errors import OutputError, RecordingError
from cosim.support.files import replacing
from cosim.support.html import table as html_table
from cosim.support.pictures import picture
from cosim.support.plain import JsonObject
from cosim.support.statistics import rms
from cosim.support.units import unit

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


@dataclass(frozen=True, repr=False)
class Recording:
    """Samples by column, float64 and of equal length, with units, origin and notes on what was left out.

    `others` are columns that are no doubles: text and binaries as objects, integers of 64 bits that are exact.
    """

    name: str
    table: dict[str, np.ndarray]
    units: dict[str, str] = field(default_factory=dict)
    origin: JsonObject = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    others: dict[str, np.ndarray] = field(default_factory=dict)
    masked: tuple[tuple[float, float], ...] = ()
    """Spans of time [s] whose samples were no readings and are bridged: nothing is judged there."""

    @classmethod
    def read(
        cls,
        path: Path | str,
        columns: Mapping[str, str] | None = None,
        units: Mapping[str, str] | None = None,
        required: tuple[str, ...] = REQUIRED,
        layout: Mapping[str, str] | None = None,
    ) -> "Recording":
        """Read and judge a recording.

        Args:
            path: text of any layout (also .gz), Parquet, MAT, HDF5, MDF4, MCAP file or bag of ROS 2; of a file
                of many recordings one, "many.parquet:run=3" by a column or "many.csv:#3" by number.
            columns: our name to the file's name, {"tau": "force"}; `#3` is the third column.
            units: our name to the unit in the file, {"q": "arcsec"}; values become SI. `q_d` is in the unit of `q`
                unless it is given its own.
            required: columns that must be there, move, and be finite; () for any table with a time.
            layout: how a text is written, where it is not to be found out: separator, decimal, header, encoding;
                `period`, the distance of rows without a time; `nan` ("gap") and `repeated` ("first", "last"), what
                becomes of rows without a value and of rows of one time; `limit`, the factor by which limits are raised.

        Raises:
            RecordingError: one sentence that names file, column, row and value.
            UnitError: a unit is unknown.
        """
        path, layout = Path(path), dict(layout or {})
        request, found, own = read_run(Request(path, columns or {}, units or {}, layout, required))
        one = cls.judged(request, named(path), rows_of_one(request, found), own)
        return replace(one, origin=one.origin | {"period": layout["period"]}) if "period" in layout else one

    @classmethod
    def of(
        cls,
        table: Mapping[str, npt.ArrayLike],
        name: str = "table",
        columns: Mapping[str, str] | None = None,
        units: Mapping[str, str] | None = None,
        required: tuple[str, ...] = REQUIRED,
    ) -> "Recording":
        """Judge a table in memory, arrays of shape (rows,) by column, as `read` judges a file; `name` is its own.

        Raises:
            RecordingError: as `read`; or a column has another shape than the first.
            UnitError: a unit is unknown.
        """
        values = as_columns(name, table)
        request = Request(Path(name), columns or {}, units or {}, required=required)
        return cls.judged(request, name, timed(request, Columns(values)), sha256_of(values))

    @classmethod
    def judged(cls, request: Request, name: str, found: Columns, sha256: str) -> "Recording":
        """Judge columns that were read, as `read` does; `sha256` is their hash."""
        path, required, served = request.path, request.required, assign(request, found)
        served = with_speed(path, found, served, request.units) if required else served
        values, stated = served.values, served.units
        stated |= {"q_d": stated["q"]} if "q" in stated and "q_d" in values and "q_d" not in stated else {}
        check_names(path, values, required, stated)
        clock = clock_of(path, served, bool(required))
        values, stated = values | {"t": clock.values}, stated | ({"t": clock.unit} if clock.unit else {})
        others = {key: column for key, column in values.items() if column.dtype == object}
        told = others if "components" in found.origin else {}  # a run of ours has text on purpose
        numeric = {key: column for key, column in values.items() if key not in told}
        table, notes = numbers(path, numeric, ("t", *chosen(values, required)))
        table, joined = continued(path.stem, table, stated)
        end, stays = at_an_end(table["q"], stated.get("q", "")) if "q" in table else (0.0, np.empty((0, 2), int))
        silent = assumed(path, table, served.sources, stated)
        si = {column: unit(text) for column, text in stated.items() if column in table}
        table = {key: si[key].to_si(column) if key in si else column for key, column in table.items()}
        check_time(path, table["t"], MINIMUM_ROWS if required else 2, found.values)
        check_motion(path, table, chosen(values, required))
        if required:
            check_sampling(path, table["t"])
            joined = (*joined, *held.notes(name, table))
        rows: JsonObject = {"rows": found.rows} if found.rows else {}
        origin = found.origin | {"file": {"name": path.name, "sha256": sha256} | rows}
        origin |= {"start": found.start or clock.start} if found.start or clock.start else {}
        masked = tuple((float(table["t"][first]), float(table["t"][last - 1])) for first, last in stays.tolist())
        if masked:
            said = f'"q" stays at {end:.6g}, the end of what the drive sends, in {int(np.diff(stays).sum()):,} rows'
            joined = (*joined, f"{path.stem}: {said} from row {stays[0, 0] + 1:,} on; nothing is judged there.")
        notes = (*found.notes, *served.notes, *silent, *clock.notes, *notes, *joined)
        return cls(name, table, {"t": "s"} | {key: one.si for key, one in si.items()}, origin, notes, others, masked)

    def write(self, path: Path | str, force: bool = False) -> Path:
        """Write .parquet (with units and origin), .csv or .csv.gz; the file is complete or absent.

        Raises:
            OutputError: the file exists and `force` is not set, or its suffix is none of these.
        """
        from cosim.data.writer import WRITERS

        path = Path(path)
        writer = next((write for suffix, write in WRITERS.items() if path.name.endswith(suffix)), None)
        if writer is None:
            raise OutputError(
                f"{path} cannot be written; a recording becomes: {', '.join(WRITERS)}.", culprit=str(path)
            )
        with replacing(path, force) as partial:
            writer(partial, self.table | self.others, self.units, self.origin)
        return path

    def changes(self, column: str) -> list[tuple[float, Any]]:
        """Return when a column took another value, and which, beginning with its first; for text and whole numbers."""
        values = self.others.get(column, self.table.get(column))
        assert values is not None, column
        rows = [0, *(np.flatnonzero(values[1:] != values[:-1]) + 1).tolist()] if len(values) else []
        return [(float(self.t[row]), values[row]) for row in rows]

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
        file = self.origin.get("file")
        return str(file.get("sha256", "")) if isinstance(file, Mapping) else ""

    @property
    def identity(self) -> tuple[str, str]:
        """What no two recordings share: the hash of the file, and the rows of it where it holds many."""
        file = self.origin.get("file")
        return self.sha256, str(file.get("rows", "")) if isinstance(file, Mapping) else ""

    @property
    def duration(self) -> float:
        """Time from the first to the last sample in s."""
        return float(self.t[-1] - self.t[0])

    @cached_property
    def known_numbers(self) -> dict[Hashable, float]:
        """Numbers that somebody found in its rows and will ask for again, by what they are."""
        return {}

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
        return rms(regular / self.sample_time - 1)

    def is_masked(self, t: np.ndarray, margin: float) -> np.ndarray:
        """Which times lie in a masked span or less than `margin` s beside one, (rows,) of bool."""
        found = np.zeros(len(t), bool)
        for start, end in self.masked:
            found[np.searchsorted(t, start - margin) : np.searchsorted(t, end + margin, "right")] = True
        return found

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

    def plot(self, *columns: str) -> Any:
        """Return a matplotlib figure of the columns over time (all where none is named)."""
        for name in columns:
            if name not in self.table:
                text = f'{self.name} has no column "{name}"; columns are: {", ".join(self)}.'
                raise RecordingError(text, culprit=name, choices=tuple(self))
        return picture("recording", self, columns)

    def __repr__(self) -> str:
        return f"Recording({self.name!r}, {len(self):,} rows, {self.duration:.4g} s, {', '.join(self)})"

    def __str__(self) -> str:
        columns = ", ".join(f"{name} [{self.units.get(name, '?')}]" for name in self)
        return f"{self.name}: {len(self):,} rows at {1 / self.sample_time:.6g} Hz, {self.duration:.6g} s; {columns}"

    def _repr_html_(self) -> str:
        rows = [
            {"column": name, "unit": self.units.get(name, "?"), "least": f"{x.min():.6g}", "greatest": f"{x.max():.6g}"}
            for name, x in self.table.items()
        ]
        return html_table(str(self).partition(";")[0], rows)
