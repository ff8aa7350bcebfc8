"""Where: missing torque over position, speed, direction; and over angle and speed together."""

from typing import TYPE_CHECKING

import numpy as np

from cosim.diagnosis.answer.result import Array, Region
from cosim.diagnosis.measure.breakdown import Samples, grid, slow
from cosim.plots.quantities import labelled
from cosim.plots.style import AFTER, BEFORE, GREY, LINE, MEASURED, Style
from cosim.report.quantities import Scales
from cosim.report.sheet import Picture, Sheet, degrees, heading

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAMES = {
    "position": "position",
    "speed": "speed",
    "direction": "direction of motion",
    "temperature": "temperature",
    "time": "time",
    "acceleration": "acceleration",
}
SIDES = {-1: "backward", 0: "standing", 1: "forward"}
CELLS = (14, 6)


def region(before: Region, after: Region | None, scales: Scales) -> Picture:
    """Draw the mean missing torque over one coordinate, before and after, with bands; hatched = never visited."""
    sheet = Sheet(f"where-{''.join(filter(str.isalnum, before.axis)) or 'axis'}", 230)
    axes = sheet.axes()
    name = NAMES.get(before.axis, before.axis)
    if before.axis == "direction":
        _sides(axes, before, after, scales)
        caption = "Mean and 95 % band by direction."
    else:
        caption = _along(axes, before, after, scales, name)
    axes.axhline(0, color=GREY, lw=0.8, zorder=1)
    heading(axes, f"{before.measure} {scales.noun} [{scales.torque.unit}]")
    axes.locator_params(axis="y", nbins=5)
    return sheet.picture(f"Missing over {name}, before and after. {caption}", caption, f"Over {name}")


def _along(axes: "Axes", before: Region, after: Region | None, scales: Scales, name: str) -> str:
    unit = scales.of_unit(before.unit)
    x = before.centres * unit.factor
    for side, colour, style in ((before, BEFORE, (4, 2)), (after, AFTER, (None, None))):
        if side is None:
            continue
        mean, band = side.mean * scales.torque.factor, side.band * scales.torque.factor
        axes.fill_between(side.centres * unit.factor, mean - band, mean + band, color=colour, alpha=0.22, lw=0)
        axes.plot(side.centres * unit.factor, mean, color=colour, dashes=style)
    unseen = never(axes, x, np.isfinite(before.mean))
    degrees(axes, unit.unit)
    axes.set_xlabel(labelled(name, unit.unit))
    return "Mean with its 95 % band." + (" Hatched: the machine never went there." if unseen else "")


def never(axes: "Axes", x: Array, visited: Array) -> bool:
    """Hatch the bins that no sample visited; say whether there are any."""
    if len(x) < 2:
        return False
    half = 0.5 * float(np.median(np.diff(x)))
    for low, high in runs(~visited.astype(bool)):
        axes.axvspan(x[low] - half, x[high] + half, fc="none", ec="#A9B0B6", hatch="////", lw=0, zorder=0)
    axes.set_xlim(x[0] - half, x[-1] + half)
    return bool(np.any(~visited.astype(bool)))


def runs(mask: Array) -> list[tuple[int, int]]:
    """Return first and last index of every run of True."""
    edges = np.flatnonzero(np.diff(np.r_[0, mask.astype(int), 0]))
    return [(int(low), int(high) - 1) for low, high in zip(edges[::2], edges[1::2], strict=True)]


def _sides(axes: "Axes", before: Region, after: Region | None, scales: Scales) -> None:
    factor = scales.torque.factor
    for side, shift, colour, mark in ((before, -0.12, BEFORE, "s"), (after, 0.12, AFTER, "o")):
        if side is None:
            continue
        fill = "white" if mark == "s" else colour
        style: Style = {"ms": 8, "mfc": fill, "mec": colour, "ecolor": colour, "elinewidth": 1.6, "lw": 0, "mew": 1.8}
        place = np.arange(len(side.mean)) + shift
        axes.errorbar(place, side.mean * factor, yerr=side.band * factor, marker=mark, **style)
    axes.set_xticks(range(len(before.centres)), [SIDES[int(np.sign(value))] for value in before.centres])
    axes.set_xlim(-0.6, len(before.centres) - 0.4)


def plane(name: str, chosen: Samples, residual: Array, scales: Scales, most: float | None = None) -> Picture:
    """Draw the signed mean error over angle and speed, + and - printed, hatched where the machine never went."""
    before = name == "before"
    q, v, mean = _gridded(chosen, residual)
    sheet = Sheet(f"plane-{name}", 220, plate=True)
    axes = sheet.axes()
    top = most or float(np.nanmax(np.abs(mean)))
    colour = BEFORE if before else AFTER
    cells(axes, mean / top, q * scales.position.factor, v * scales.speed.factor, colour, 0.2)
    degrees(axes, scales.position.unit)
    heading(axes, f"speed [{scales.speed.unit}]", below=f"position [{scales.position.unit}]")
    never = "Hatched: never visited." if np.isnan(mean).any() else ""
    caption = f"Mean error, marked + and −; darkest {scales.torque.text(top)}. {never}".strip()
    title = "Before, over position and speed" if before else "After, over position and speed"
    return sheet.picture(f"{title}. {caption}", caption, title)


def _gridded(chosen: Samples, residual: Array) -> tuple[Array, Array, Array]:
    """Edges of cells of position and speed, and the mean in each."""
    q = np.linspace(float(chosen.q.min()), float(chosen.q.max()) + 1e-12, CELLS[0] + 1)
    v = np.linspace(slow(chosen.v), float(np.quantile(np.abs(chosen.v), 0.999)) + 1e-12, CELLS[1] + 1)
    return q, v, grid(chosen, residual, q, v)


def strongest(chosen: Samples) -> float:
    """Return the largest mean error of the grid before, the common scale of both grids."""
    *_, mean = _gridded(chosen, chosen.before)
    return float(np.nanmax(np.abs(mean))) if np.isfinite(mean).any() else 0.0


def cells(axes: "Axes", mean: Array, x: Array, y: Array, colour: str, loud: float) -> None:
    """Draw cells between edges, as dark as their mean is of 1, with its sign from `loud` on, hatched where none is."""
    from matplotlib.colors import LinearSegmentedColormap

    ramp = LinearSegmentedColormap.from_list("ramp", ["white", colour])
    axes.axhspan(y[0], y[-1], fc="white", ec=LINE, hatch="////", lw=0, zorder=0)
    shade = np.ma.masked_invalid(np.abs(mean) * 0.92)
    axes.pcolormesh(x, y, shade, cmap=ramp, vmin=0, vmax=1, ec="white", lw=1)
    for row, column in np.argwhere(np.abs(np.nan_to_num(mean)) > loud):
        at = 0.5 * (x[column] + x[column + 1]), 0.5 * (y[row] + y[row + 1])
        dark = shade[row, column] > 0.55
        sign = "+" if mean[row, column] > 0 else "−"
        axes.annotate(sign, at, (0, -4), textcoords="offset points", ha="center", color="white" if dark else MEASURED)
    axes.grid(visible=False)
