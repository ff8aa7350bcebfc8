"""A recording in small: what its pictures need, taken from the file piece by piece, so that its length costs no memory.

Columns with the usual names (see `ROLES`), with or without a prefix ("azimuth_q_d"), make up axes; the error of an axis
is its set point minus its position, or minus its reading where no position is recorded.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cosim.data.columns import UNIT_KEY
from cosim.plots.quantities import number, scale_of
from cosim.plots.style import Array
from cosim.support.statistics import hann

ROLES = ("q_d", "q", "position", "v", "tau", "friction", "error")
ERROR = "error"
BUCKETS = 560
"""Pieces of time in a line, each with its smallest and largest value."""
DOTS = 3_000
WORDS = {"″": "arcsec", "′": "arcmin", "°": "deg"}
"""Units in words: beside a line of digits a stroke is no unit."""
SEGMENT = 1 << 19
"""Samples of the longest piece whose spectrum is taken at once."""

Piece = Mapping[str, Array]


def in_words(unit: str) -> str:
    """Write the sign of an angle at the beginning of a unit as a word."""
    return WORDS.get(unit[:1], unit[:1]) + unit[1:]


@dataclass(frozen=True)
class Axis:
    """The columns of one axis by their role; `name` is the prefix they share."""

    name: str
    columns: Mapping[str, str]

    @property
    def error(self) -> str:
        """The column of its error, recorded or made here; empty if there is none."""
        measured = self.measured
        return self.columns.get(ERROR) or (f"{self.prefix}{ERROR}" if "q_d" in self.columns and measured else "")

    @property
    def measured(self) -> str:
        """The column that says where the axis is."""
        return self.columns.get("position") or self.columns.get("q", "")

    @property
    def prefix(self) -> str:
        """What its columns begin with."""
        return f"{self.name}_" if self.name else ""


@dataclass
class Line:
    """One column: extremes by piece of time, sums over all rows, and a dot now and then."""

    unit: str
    low: Array
    high: Array
    dots: Array
    total: float = 0.0
    squares: float = 0.0

    @property
    def span(self) -> tuple[float, float]:
        """Smallest and largest value."""
        return float(np.nanmin(self.low)), float(np.nanmax(self.high))


@dataclass
class Digest:
    """All columns in small; `spectra` are amplitude densities [unit/sqrt(Hz)] over `frequency` [Hz], by column."""

    rows: int
    start: float
    end: float
    axes: tuple[Axis, ...]
    lines: dict[str, Line]
    spectra: dict[str, tuple[Array, Array]] = field(default_factory=dict)

    @property
    def others(self) -> tuple[str, ...]:
        """Columns that belong to no axis."""
        known = {column for axis in self.axes for column in (*axis.columns.values(), axis.error)}
        return tuple(name for name in self.lines if name not in known)


def digest(path: Path) -> Digest:
    """Read a recording written by `cosim run`."""
    from pyarrow import parquet

    # pre_buffer, on by default, keeps every piece that was read until the file is closed: the whole recording.
    with parquet.ParquetFile(path, pre_buffer=False) as file:
        fields = {one.name: (one.metadata or {}).get(UNIT_KEY, b"").decode() for one in file.schema_arrow}
        batches = file.iter_batches(batch_size=1 << 16)
        pieces = ({name: _values(batch.column(name)) for name in batch.schema.names} for batch in batches)
        return condense(pieces, fields, file.metadata.num_rows)


def condense(pieces: Iterable[Piece], units: Mapping[str, str], rows: int) -> Digest:
    """Make a digest of pieces of a table, each with the columns of `units`, which has `t`."""
    axes = axes_of(units)
    derived = {axis.error: axis for axis in axes if axis.error and axis.error not in units}
    named = {name: unit for name, unit in units.items() if name != "t"}
    named |= {name: units[axis.columns["q_d"]] for name, axis in derived.items()}
    buckets, every = max(min(BUCKETS, rows), 1), max(-(-rows // DOTS), 1)
    lines = {
        name: Line(unit, np.full(buckets, np.inf), np.full(buckets, -np.inf), np.empty(-(-rows // every)))
        for name, unit in named.items()
    }
    made = Digest(rows, 0.0, 0.0, axes, lines)
    spectra = {axis.error: Spectrum(min(rows, SEGMENT)) for axis in axes if axis.error}
    done = 0
    for piece in pieces:
        errors = {name: piece[axis.columns["q_d"]] - piece[axis.measured] for name, axis in derived.items()}
        table = {**piece, **errors}
        made.start, made.end = (float(table["t"][0]) if not done else made.start), float(table["t"][-1])
        for name, line in lines.items():
            _add(line, table[name], done, rows, every)
        for name, spectrum in spectra.items():
            spectrum.add(table[name])
        done += len(table["t"])
    step = (made.end - made.start) / max(rows - 1, 1)
    made.spectra = {name: found for name, one in spectra.items() if (found := one.density(step)) is not None}
    return made


@dataclass(frozen=True)
class Tracking:
    """How well an axis followed its set point: RMS and largest error, in the SI unit of its set point."""

    axis: str
    unit: str
    rms: float
    largest: float

    def __str__(self) -> str:
        scale = scale_of(self.unit, self.largest)
        rms, largest = (number(scale.factor * value, 3) for value in (self.rms, self.largest))
        name = f"{self.axis}: " if self.axis else ""
        return f"{name}RMS tracking error {rms} {in_words(scale.unit)} (largest {largest})"


def tracking(path: Path) -> tuple[Tracking, ...]:
    """How well each axis of a recording written by `cosim run` followed its set point; axes without one are left out.

    The file is read piece by piece, and only the columns that are needed.
    """
    from pyarrow import parquet

    with parquet.ParquetFile(path, pre_buffer=False) as file:
        units = {one.name: (one.metadata or {}).get(UNIT_KEY, b"").decode() for one in file.schema_arrow}
        axes = [axis for axis in axes_of(units) if axis.error and axis.error not in units]
        wanted = list(dict.fromkeys(name for axis in axes for name in (axis.columns["q_d"], axis.measured)))
        squares, largest = np.zeros(len(axes)), np.zeros(len(axes))
        for batch in file.iter_batches(batch_size=1 << 16, columns=wanted) if axes else ():
            for k, axis in enumerate(axes):
                error = _values(batch.column(axis.columns["q_d"])) - _values(batch.column(axis.measured))
                squares[k] += error @ error
                largest[k] = max(largest[k], np.abs(error).max(initial=0.0))
        rms = np.sqrt(squares / max(file.metadata.num_rows, 1))
    found = zip(axes, rms.tolist(), largest.tolist(), strict=True)
    return tuple(Tracking(axis.name, units[axis.columns["q_d"]], one, most) for axis, one, most in found)


def axes_of(columns: Iterable[str]) -> tuple[Axis, ...]:
    """Sort columns into axes, those without a prefix first."""
    found: dict[str, dict[str, str]] = {}
    for column in columns:
        role = next((one for one in ROLES if column == one or column.endswith(f"_{one}")), "")
        if role:
            found.setdefault(column.removesuffix(role).removesuffix("_"), {})[role] = column
    return tuple(Axis(name, roles) for name, roles in sorted(found.items(), key=lambda one: one[0] != ""))


class Spectrum:
    """Amplitude density by averaged periodograms under a Hann window, over pieces of `length` samples.

    Reference: Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70.
    """

    def __init__(self, length: int) -> None:
        self._length, self._filled, self._count = length, 0, 0
        self._buffer, self._power = np.empty(length), np.zeros(length // 2 + 1)
        self._window = hann(length)

    def add(self, values: Array) -> None:
        """Take the next samples."""
        while len(values):
            part = values[: self._length - self._filled]
            self._buffer[self._filled : self._filled + len(part)] = part
            self._filled, values = self._filled + len(part), values[len(part) :]
            if self._filled == self._length:
                self._power += np.abs(np.fft.rfft((self._buffer - self._buffer.mean()) * self._window)) ** 2
                self._count, self._filled = self._count + 1, 0

    def density(self, step: float, per_decade: int = 60) -> tuple[Array, Array] | None:
        """Return frequency and density, averaged over equal parts of a decade; None for too few samples."""
        if self._length < 64 or not self._count or step <= 0:
            return None
        energy = float(np.sum(self._window**2))
        power = 2 * step * self._power[1:] / (energy * self._count)
        frequency = np.arange(1, len(self._power)) / (self._length * step)
        part = np.floor(per_decade * np.log10(frequency / frequency[0]))
        first = np.flatnonzero(np.diff(part, prepend=-1.0))
        size = np.diff(first, append=len(part))
        mean = np.add.reduceat(power, first) / size
        return np.add.reduceat(frequency, first) / size, np.sqrt(mean)


def _values(column: Any) -> Array:
    """Look at a column without a copy; pyarrow's own `to_numpy` would import pandas, half a second of a run."""
    return np.frombuffer(column.buffers()[1], np.float64, len(column), 8 * column.offset)


def _add(line: Line, values: Array, done: int, rows: int, every: int) -> None:
    """Take rows `done` .. of a column of `rows` rows."""
    buckets = len(line.low)
    edges = -(-np.arange(buckets + 1) * rows // buckets) - done
    first, last = np.searchsorted(edges, [0, len(values) - 1], side="right") - 1
    inside = slice(int(first), int(last) + 1)
    starts = np.maximum(edges[inside], 0)
    line.low[inside] = np.minimum(line.low[inside], np.minimum.reduceat(values, starts))
    line.high[inside] = np.maximum(line.high[inside], np.maximum.reduceat(values, starts))
    taken = np.arange(-done % every, len(values), every)
    line.dots[(taken + done) // every] = values[taken]
    line.total += float(values.sum())
    line.squares += float((values * values).sum())
