"""Where: missing torque over position, speed, direction; and over angle and speed together."""

from typing import TYPE_CHECKING

import numpy as np

from cosim.diagnosis.answer.result import Array, Region
from cosim.diagnosis.measure.breakdown import Samples, grid, slow
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
CELLS = (14, 6)


def region(before: Region, after: Region | None, scales: Scales) -> Picture:
    """Draw the mean missing torque over one coordinate, before and after, with bands; hatched = never visited."""
    sheet = Sheet(f"where-{_plain(before.axis)}", 230)
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
    axes.set_xlabel(f"{name} [{unit.unit}]" if unit.unit else name)
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
        style: Style = {
            "ms": 8,
            "mfc": fill,
            "mec": colour,
            "ecolor": colour,
            "elinewidth": 1.6,
            "lw": 0,
            "mew": 1.8,
        }
        place = np.arange(len(side.mean)) + shift
        axes.errorbar(place, side.mean * factor, yerr=side.band * factor, marker=mark, **style)
    axes.set_xticks(range(len(before.centres)), [_direction(value) for value in before.centres])
    axes.set_xlim(-0.6, len(before.centres) - 0.4)


def _direction(value: float) -> str:
    return "backward" if value < 0 else "forward" if value > 0 else "standing"


def plane(name: str, chosen: Samples, residual: Array, scales: Scales, most: float | None = None) -> Picture:
    """Draw the signed mean error over angle and speed, + and - printed, hatched where the machine never went."""
    before = name == "before"
    q = np.linspace(float(chosen.q.min()), float(chosen.q.max()) + 1e-12, CELLS[0] + 1)
    v = np.linspace(slow(chosen.v), float(np.quantile(np.abs(chosen.v), 0.999)) + 1e-12, CELLS[1] + 1)
    mean = grid(chosen, residual, q, v)
    sheet = Sheet(f"plane-{name}", 220, plate=True)
    axes = sheet.axes()
    top = most or float(np.nanmax(np.abs(mean)))
    _cells(axes, mean, q * scales.position.factor, v * scales.speed.factor, top, BEFORE if before else AFTER)
    axes.grid(visible=False)
    degrees(axes, scales.position.unit)
    axes.set_xlabel(f"position [{scales.position.unit}]")
    heading(axes, f"speed [{scales.speed.unit}]")
    caption = f"Mean error, marked + and −; darkest {scales.torque.text(top)}. {_never(mean)}".strip()
    title = "Before, over position and speed" if before else "After, over position and speed"
    return sheet.picture(f"{title}. {caption}", caption, title)


def _never(mean: Array) -> str:
    return "Hatched: never visited." if np.isnan(mean).any() else ""


def strongest(chosen: Samples) -> float:
    """Return the largest mean error of the grid before, the common scale of both grids."""
    q = np.linspace(float(chosen.q.min()), float(chosen.q.max()) + 1e-12, CELLS[0] + 1)
    v = np.linspace(slow(chosen.v), float(np.quantile(np.abs(chosen.v), 0.999)) + 1e-12, CELLS[1] + 1)
    mean = grid(chosen, chosen.before, q, v)
    return float(np.nanmax(np.abs(mean))) if np.isfinite(mean).any() else 0.0


def _cells(axes: "Axes", mean: Array, q: Array, v: Array, top: float, colour: str) -> None:
    from matplotlib.colors import LinearSegmentedColormap

    ramp = LinearSegmentedColormap.from_list("ramp", ["white", colour])
    axes.axhspan(v[0], v[-1], fc="white", ec=LINE, hatch="////", lw=0, zorder=0)
    shade = np.ma.masked_invalid(np.abs(mean) / top * 0.92)
    axes.pcolormesh(q, v, shade, cmap=ramp, vmin=0, vmax=1, ec="white", lw=1)
    marks = np.argwhere(np.abs(np.nan_to_num(mean)) > 0.2 * top)
    for row, column in marks:
        at = 0.5 * (q[column] + q[column + 1]), 0.5 * (v[row] + v[row + 1])
        dark = shade[row, column] > 0.55
        sign = "+" if mean[row, column] > 0 else "−"
        axes.annotate(sign, at, (0, -4), textcoords="offset points", ha="center", color="white" if dark else MEASURED)


def _plain(text: str) -> str:
    return "".join(letter for letter in text if letter.isalnum()) or "axis"
