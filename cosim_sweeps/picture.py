"""A picture of a sweep's table: one parameter a curve, two on a grid a map, otherwise a panel for each pair.

Each row of panels is a statistic. Runs without a result are red marks at the foot of a panel, or red crosses in a map.
A ring marks the best run, whose first statistic is nearest to zero.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cosim.plots.style import AFTER, GREY, STYLE, Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LOST = "#B3261E"
MANY = 4_000
"""More dots than this in all panels are drawn as pixels, so that the file stays small."""
LARGEST_MAP = 200
"""Values a side; a finer grid is drawn as dots."""


@dataclass(frozen=True)
class Results:
    """A table, sorted into what was varied and what came out; units by column; `gridded` if the points are a grid."""

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

    def label(self, name: str) -> str:
        """Return a column with its unit."""
        unit = self.units.get(name, "")
        return f"{name} [{unit}]" if unit not in ("", "1") else name


def draw(table: Path, picture: Path) -> Path:
    """Draw a table written by a sweep as SVG or PNG; returns `picture`."""
    import matplotlib

    from cosim.support.files import replacing

    results = read_results(table)
    with matplotlib.rc_context(rc=STYLE), replacing(picture, force=True) as partial:
        clean = {"metadata": {"Date": None}} if picture.suffix == ".svg" else {"dpi": 110}
        figure_of(results).savefig(partial, format=picture.suffix[1:], **clean)
    return picture


def figure_of(results: Results) -> Any:
    """Draw results as a matplotlib figure."""
    from matplotlib.figure import Figure

    figure = _map_figure(Figure, results) if _is_map(results) else _panel_figure(Figure, results)
    figure.suptitle(results.title, x=0.01, ha="left", color=GREY)
    return figure


def read_results(table: Path) -> Results:
    """Read a table with what it says about itself."""
    import json

    from pyarrow import parquet

    from cosim.data.columns import ORIGIN_KEY, UNIT_KEY

    read = parquet.read_table(table)
    origin = json.loads(read.schema.metadata[ORIGIN_KEY])
    sweep = json.loads(origin["sweep"])
    columns = {
        name: np.array(read[name].to_pylist(), dtype=np.float64) for name in (*sweep["vary"], *sweep["statistics"])
    }
    good = sum(status == "ok" for status in read["status"].to_pylist())
    told = "" if good == read.num_rows else f", {read.num_rows - good:,} of them without result"
    scales = {name: given.get("scale") for name, given in sweep["vary"].items() if isinstance(given, dict)}
    return Results(
        varied={name: columns[name] for name in sweep["vary"]},
        statistics={name: columns[name] for name in sweep["statistics"]},
        units={field.name: (field.metadata or {}).get(UNIT_KEY, b"").decode() for field in read.schema},
        logarithmic=frozenset(name for name, scale in scales.items() if scale == "log"),
        gridded=sweep["method"] == "grid",
        title=f"{sweep['scenario']}: {read.num_rows:,} runs{told}",
    )


def _is_map(results: Results) -> bool:
    sides = [len(np.unique(values)) for values in results.varied.values()]
    return results.gridded and len(sides) == 2 and min(sides) > 1 and max(sides) <= LARGEST_MAP


def _map_figure(figure_class: Any, results: Results) -> Any:
    """One map a statistic; the first parameter runs to the right, the second up."""
    count = len(results.statistics)
    across = min(count, 3)
    down = -(-count // across)
    figure = figure_class(figsize=(1.2 + 4.3 * across, 0.5 + 3.4 * down), layout="constrained")
    for number, name in enumerate(results.statistics):
        axes = figure.add_subplot(down, across, number + 1)
        _map(axes, results, name)
    return figure


def _map(axes: "Axes", results: Results, name: str) -> None:
    (first, x), (second, y) = results.varied.items()
    xs, ys = np.unique(x), np.unique(y)
    field = np.full((len(ys), len(xs)), np.nan)
    field[np.searchsorted(ys, y), np.searchsorted(xs, x)] = results.statistics[name]
    right, up = (_edges(side, one in results.logarithmic) for side, one in ((xs, first), (ys, second)))
    colours = axes.pcolormesh(right, up, field)
    _bar(axes, colours, results.label(name))
    lost = np.isnan(results.statistics[name])
    axes.plot(x[lost], y[lost], "x", color=LOST, ms=5)
    _mark(axes, results, x, y)
    _scales(axes, results, first, second)


def _bar(axes: "Axes", colours: Any, label: str) -> None:
    bar = axes.get_figure().colorbar(colours, ax=axes)  # type: ignore[union-attr]
    bar.outline.set_visible(False)  # type: ignore[operator]
    axes.set_title(label, loc="left")


def _edges(values: Array, logarithmic: bool) -> Array:
    """Put the edges of cells midway between values."""
    line = np.log(values) if logarithmic else values
    inner = (line[1:] + line[:-1]) / 2
    edges = np.concatenate([[2 * line[0] - inner[0]], inner, [2 * line[-1] - inner[-1]]])
    return np.exp(edges) if logarithmic else edges


def _scales(axes: "Axes", results: Results, x: str, y: str = "") -> None:
    axes.set_xlabel(results.label(x))
    _scale(axes.xaxis, x in results.logarithmic)
    if y:
        axes.set_ylabel(results.label(y))
        _scale(axes.yaxis, y in results.logarithmic)


def _scale(axis: Any, logarithmic: bool) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    if logarithmic:
        axis.axes.set(**{f"{axis.axis_name}scale": "log"})
        low, high = axis.get_view_interval()
        # With fewer than two ticks in sight Matplotlib takes linear ones, whose labels meet.
        axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high > 10 * low else (1, 1.5, 2, 3, 4, 6, 8)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_locator(NullLocator())


def _panel_figure(figure_class: Any, results: Results) -> Any:
    """Statistics down, parameters across."""
    down, across = len(results.statistics), len(results.varied)
    figure = figure_class(figsize=(1.2 + max(3.2 * across, 5.0), 0.6 + 2.4 * down), layout="constrained")
    panels = figure.subplots(down, across, squeeze=False, sharex="col", sharey="row")
    for row, name in zip(panels, results.statistics, strict=True):
        for axes, parameter in zip(row, results.varied, strict=True):
            _panel(axes, results, parameter, name)
        row[0].set_title(results.label(name), loc="left")
    for axes, parameter in zip(panels[-1], results.varied, strict=True):
        _scales(axes, results, parameter)
    return figure


def _panel(axes: "Axes", results: Results, parameter: str, name: str) -> None:
    x, y = results.varied[parameter], results.statistics[name]
    good = np.isfinite(y)
    alone = len(results.varied) == 1
    axes.grid(axis="y")
    size = 4.0 if len(x) < 200 else 2.0
    many = len(x) * len(results.varied) * len(results.statistics) > MANY
    axes.plot(x[good], y[good], ".", color=AFTER, ms=2 * size, mew=0, alpha=_weight(len(x)), rasterized=many)
    axes.plot(*_middle(x[good], y[good], exact=alone and results.gridded), color=AFTER)
    axes.plot(x[~good], np.zeros((~good).sum()), "|", color=LOST, ms=12, transform=axes.get_xaxis_transform())
    _mark(axes, results, x, y)


def _mark(axes: "Axes", results: Results, x: Array, y: Array) -> None:
    """Put a ring round the best run."""
    if results.best is not None:
        axes.plot(x[results.best], y[results.best], "o", mfc="none", mec="black", ms=9, clip_on=False)


def _weight(count: int) -> float:
    return float(np.clip(60 / max(count, 1), 0.15, 0.9))


def _middle(x: Array, y: Array, exact: bool) -> tuple[Array, Array]:
    """Return medians of y over x: at each value of a grid, else in parts of at least 20 runs, nothing for a few."""
    values, parts = np.unique(x), min(len(x) // 20, 12)
    if exact or len(values) <= parts:
        return values, np.array([np.median(y[x == value]) for value in values])
    if parts < 3:
        return np.empty(0), np.empty(0)
    order: Sequence[Array] = np.array_split(np.argsort(x), parts)
    return np.array([np.median(x[part]) for part in order]), np.array([np.median(y[part]) for part in order])
