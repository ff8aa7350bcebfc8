"""A picture of a sweep's table: one parameter a curve, two on a grid a map, otherwise a panel for each pair.

Each row of panels is a statistic. Runs without a result are red marks at the foot of a panel, or red crosses in a map.
A ring marks the best run, whose first statistic is nearest to zero.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from cosim.plots.style import AFTER, GREY, STYLE, Array
from cosim.support.files import replacing
from cosim_sweeps.results import Results, read_results

LOST = "#B3261E"
MANY = 4_000
"""More dots than this in all panels are drawn as pixels, so that the file stays small."""
LARGEST_MAP = 200
"""Values a side; a finer grid is drawn as dots."""


def draw(table: Path, picture: Path) -> Path:
    """Draw a table written by a sweep as SVG or PNG; returns `picture`."""
    results = read_results(table)
    with matplotlib.rc_context(rc=STYLE), replacing(picture, force=True) as partial:
        clean = {"metadata": {"Date": None}} if picture.suffix == ".svg" else {"dpi": 110}
        figure_of(results).savefig(partial, format=picture.suffix[1:], **clean)
    return picture


def figure_of(results: Results) -> Figure:
    """Draw results as a matplotlib figure."""
    figure = _map_figure(results) if _is_map(results) else _panel_figure(results)
    figure.suptitle(results.title, x=0.01, ha="left", color=GREY)
    return figure


def _is_map(results: Results) -> bool:
    sides = [len(np.unique(values)) for values in results.varied.values()]
    return results.gridded and len(sides) == 2 and min(sides) > 1 and max(sides) <= LARGEST_MAP


def _map_figure(results: Results) -> Figure:
    """One map a statistic; the first parameter runs to the right, the second up."""
    count = len(results.statistics)
    across = min(count, 3)
    down = -(-count // across)
    figure = Figure(figsize=(1.2 + 4.3 * across, 0.5 + 3.4 * down), layout="constrained")
    for number, name in enumerate(results.statistics, 1):
        _map(figure, figure.add_subplot(down, across, number), results, name)
    return figure


def _map(figure: Figure, axes: Axes, results: Results, name: str) -> None:
    (first, x), (second, y) = results.varied.items()
    xs, ys = np.unique(x), np.unique(y)
    field = np.full((len(ys), len(xs)), np.nan)
    field[np.searchsorted(ys, y), np.searchsorted(xs, x)] = results.statistics[name]
    right, up = (_edges(side, one in results.logarithmic) for side, one in ((xs, first), (ys, second)))
    bar: Any = figure.colorbar(axes.pcolormesh(right, up, field), ax=axes)
    bar.outline.set_visible(False)
    axes.set_title(results.label(name), loc="left")
    lost = np.isnan(results.statistics[name])
    axes.plot(x[lost], y[lost], "x", color=LOST, ms=5)
    _mark(axes, results, x, y)
    _name(axes.xaxis, results, first)
    _name(axes.yaxis, results, second)


def _edges(values: Array, logarithmic: bool) -> Array:
    """Put the edges of cells midway between values."""
    line = np.log(values) if logarithmic else values
    inner = (line[1:] + line[:-1]) / 2
    edges = np.concatenate([[2 * line[0] - inner[0]], inner, [2 * line[-1] - inner[-1]]])
    return np.exp(edges) if logarithmic else edges


def _name(axis: Any, results: Results, name: str) -> None:
    """Name an axis after a parameter, and scale it as that is spread."""
    axis.set_label_text(results.label(name))
    if name in results.logarithmic:
        axis.axes.set(**{f"{axis.axis_name}scale": "log"})
        low, high = axis.get_view_interval()
        # With fewer than two ticks in sight Matplotlib takes linear ones, whose labels meet.
        axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high > 10 * low else (1, 1.5, 2, 3, 4, 6, 8)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_locator(NullLocator())


def _panel_figure(results: Results) -> Figure:
    """Statistics down, parameters across."""
    down, across = len(results.statistics), len(results.varied)
    figure = Figure(figsize=(1.2 + max(3.2 * across, 5.0), 0.6 + 2.4 * down), layout="constrained")
    panels = figure.subplots(down, across, squeeze=False, sharex="col", sharey="row")
    for row, name in zip(panels, results.statistics, strict=True):
        for axes, parameter in zip(row, results.varied, strict=True):
            _panel(axes, results, parameter, name)
        row[0].set_title(results.label(name), loc="left")
    for axes, parameter in zip(panels[-1], results.varied, strict=True):
        _name(axes.xaxis, results, parameter)
    return figure


def _panel(axes: Axes, results: Results, parameter: str, name: str) -> None:
    x, y = results.varied[parameter], results.statistics[name]
    good = np.isfinite(y)
    axes.grid(axis="y")
    size, weight = 8.0 if len(x) < 200 else 4.0, np.clip(60 / max(len(x), 1), 0.15, 0.9)
    many = len(x) * len(results.varied) * len(results.statistics) > MANY
    axes.plot(x[good], y[good], ".", color=AFTER, ms=size, mew=0, alpha=float(weight), rasterized=many)
    axes.plot(*_middle(x[good], y[good], exact=results.gridded and len(results.varied) == 1), color=AFTER)
    axes.plot(x[~good], np.zeros((~good).sum()), "|", color=LOST, ms=12, transform=axes.get_xaxis_transform())
    _mark(axes, results, x, y)


def _mark(axes: Axes, results: Results, x: Array, y: Array) -> None:
    """Put a ring round the best run."""
    if results.best is not None:
        axes.plot(x[results.best], y[results.best], "o", mfc="none", mec="black", ms=9, clip_on=False)


def _middle(x: Array, y: Array, exact: bool) -> tuple[Array, Array]:
    """Return medians of y over x: at each value of a grid, else in parts of at least 20 runs, nothing for a few."""
    values, parts = np.unique(x), min(len(x) // 20, 12)
    if exact or len(values) <= parts:
        return values, np.array([np.median(y[x == value]) for value in values])
    if parts < 3:
        return np.empty(0), np.empty(0)
    order: Sequence[Array] = np.array_split(np.argsort(x), parts)
    return np.array([np.median(x[part]) for part in order]), np.array([np.median(y[part]) for part in order])
