"""What came out of a sweep, read from its table, which says itself what was varied and what was kept."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pyarrow import parquet

from cosim.data.columns import ORIGIN_KEY, UNIT_KEY
from cosim.plots.style import Array


@dataclass(frozen=True)
class Results:
    """A table, sorted into what was varied and what came out; units by column, "" for none; whether it is a grid."""

    varied: Mapping[str, Array]
    statistics: Mapping[str, Array]
    units: Mapping[str, str]
    logarithmic: frozenset[str]
    gridded: bool
    title: str

    @property
    def best(self) -> int | None:
        """The run whose first statistic is nearest to zero; None where no run has a result."""
        size = np.abs(next(iter(self.statistics.values())))
        return int(np.nanargmin(size)) if np.isfinite(size).any() else None

    def best_row(self) -> dict[str, float]:
        """What the best run varied, and its statistics; {} where there is none."""
        best, columns = self.best, {**self.varied, **self.statistics}
        return {} if best is None else {"run": best, **{name: float(one[best]) for name, one in columns.items()}}

    @property
    def best_words(self) -> str:
        """Which run is the best, and at which numbers; "" where none has a result."""
        if not (row := self.best_row()):
            return ""
        said = {name: f"{row[name]:.4g} {self.units[name]}".rstrip() for name in (*self.varied, *self.statistics)}
        first, at = next(iter(self.statistics)), ", ".join(f"{name} = {said[name]}" for name in self.varied)
        return f"best by {first}: run {row['run']:.0f} with {said[first]} at {at}"

    def label(self, name: str) -> str:
        """Return a column with its unit."""
        return f"{name} [{unit}]" if (unit := self.units[name]) else name


def read_results(table: Path) -> Results:
    """Read a table with what it says about itself."""
    read = parquet.read_table(table)
    origin = json.loads(read.schema.metadata[ORIGIN_KEY])
    sweep = json.loads(origin["sweep"])
    columns = {
        name: np.array(read[name].to_pylist(), dtype=np.float64) for name in (*sweep["vary"], *sweep["statistics"])
    }
    units = {field.name: (field.metadata or {}).get(UNIT_KEY, b"").decode() for field in read.schema}
    good = sum(status == "ok" for status in read["status"].to_pylist())
    told = "" if good == read.num_rows else f", {read.num_rows - good:,} of them without result"
    scales = {name: given.get("scale") for name, given in sweep["vary"].items() if isinstance(given, dict)}
    return Results(
        varied={name: columns[name] for name in sweep["vary"]},
        statistics={name: columns[name] for name in sweep["statistics"]},
        units={name: "" if unit == "1" else unit for name, unit in units.items()},
        logarithmic=frozenset(name for name, scale in scales.items() if scale == "log"),
        gridded=sweep["method"] == "grid",
        title=f"{sweep['scenario']}: {read.num_rows:,} runs{told}",
    )
