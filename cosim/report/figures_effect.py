"""One figure a finding: the view of the recordings in which that effect shows itself."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from cosim.diagnosis.answer.result import Array, Finding
from cosim.diagnosis.measure.breakdown import Curve, Mask, Samples, curve, slow
from cosim.plots.quantities import ANGLE, LENGTH, handy
from cosim.plots.style import AFTER, BEFORE, GREY, MEASURED, Style
from cosim.report.quantities import Scales
from cosim.report.sheet import Picture, Sheet, degrees, heading

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Draw = Callable[[Finding, Samples, Scales], Picture | None]
HEIGHT = 232


def blank(finding: Finding) -> tuple[Sheet, "Axes"]:
    """Return the empty figure of a finding."""
    sheet = Sheet(f"effect-{''.join(c for c in finding.name if c.isalnum())}", HEIGHT)
    return sheet, sheet.axes()


def error_over(
    finding: Finding, x: Array, y: tuple[Array, Array], edges: Array, axis: str, scales: Scales
) -> tuple[Sheet, "Axes"]:
    """Draw the mean error before and after over any coordinate, with 95 % bands."""
    sheet, axes = blank(finding)
    for residual, colour, dashes in zip(y, (BEFORE, AFTER), ((4, 2), (None, None)), strict=True):
        line(axes, curve(x, residual * scales.torque.factor, edges), colour, dashes)
    axes.axhline(0, color=GREY, lw=0.8, zorder=1)
    axes.locator_params(axis="y", nbins=5)
    heading(axes, f"mean error [{scales.torque.unit}]", below=axis)
    return sheet, axes


def line(axes: "Axes", mean: Curve, colour: str, dashes: tuple[float | None, float | None]) -> None:
    """Draw a binned mean and its band."""
    axes.fill_between(mean.x, mean.mean - mean.half, mean.mean + mean.half, color=colour, alpha=0.2, lw=0)
    axes.plot(mean.x, mean.mean, color=colour, dashes=dashes, lw=2)


def folded(finding: Finding, chosen: Samples, scales: Scales) -> Picture | None:
    """Fold the error onto one pitch: a ripple tied to position lines up, anything else averages out."""
    cycles = finding.parameters.get("cycles_per_rev", 0.0)
    if cycles <= 0:
        return position(finding, chosen, scales)
    length = scales.turn / cycles
    unit = handy(ANGLE if scales.turn != 1.0 else LENGTH, length)
    pitch = length * unit.factor
    x = np.mod(chosen.q * unit.factor, pitch)
    axis = f"position within one pitch [{unit.unit}]"
    sheet, axes = error_over(finding, x, (chosen.before, chosen.after), np.linspace(0, pitch, 41), axis, scales)
    dots(axes, x, chosen.before * scales.torque.factor)
    axes.set_xlim(0, pitch)
    shown = min(600, len(x))
    caption = (
        f"All recordings folded onto one pitch of {unit.text(length, 3)}. Lines: mean, dashed before, solid after. "
        f"Dots: {shown} of {len(x):,} samples before."
    )
    return sheet.picture(f"{finding.title}, error over one pitch. {caption}", caption)


def dots(axes: "Axes", x: Array, y: Array, most: int = 600) -> None:
    """Scatter evenly picked samples of the error before, and keep single ones from stretching the axis."""
    pick = np.linspace(0, len(x) - 1, min(most, len(x))).astype(int)
    apart = 0.001 * float(np.ptp(x))
    ends = ((x[pick], x[pick] + apart), (y[pick], y[pick]))
    broken = [np.column_stack([*pair, np.full(len(pick), np.nan)]).ravel() for pair in ends]
    axes.plot(*broken, lw=2.2, solid_capstyle="round", color=BEFORE, alpha=0.55, zorder=1)
    low, high = np.quantile(y, (0.005, 0.995))
    axes.set_ylim(low - 0.05 * (high - low), high + 0.05 * (high - low))


def keep_turning(finding: Finding, chosen: Samples, scales: Scales) -> Picture | None:
    """Draw the torque that keeps the machine moving over speed, both directions, with the model before and after.

    Where friction falls with speed, its own speeds are drawn: on a logarithmic axis, from a tenth of the speed over
    which it falls.
    """
    falls = float(finding.parameters.get("Vs", 0.0)) if finding.effect == "stribeck" else 0.0
    calm = chosen.where(steady(chosen, 0.1 * falls))
    if calm.v.size < 200:
        return None
    sheet, axes = blank(finding)
    edges = speeds(calm, falls) * scales.speed.factor
    for sign, mark, fill in ((1.0, "^", MEASURED), (-1.0, "v", "white")):
        _side(axes, calm.where(calm.v * sign > 0), sign, (mark, fill), edges, scales)
    axes.set_xlim(edges[0], edges[-1])
    logarithmic(axes, falls * scales.speed.factor)
    heading(axes, f"to keep moving [{scales.torque.unit}]", below=f"speed [{scales.speed.unit}]")
    caption = "▲ measured forward, ▽ backward, bars 95 %. Dashed: model before; solid: after. Steady motion only."
    caption += f" Dotted: {scales.speed.text(falls)}, over which friction falls." if falls else ""
    return sheet.picture(f"{finding.title}. {caption}", caption)


def speeds(calm: Samples, falls: float) -> Array:
    """Return edges of bins of speed [rad/s, m/s]; in equal ratios where friction falls over a small speed."""
    speed = np.abs(calm.v)
    top = float(np.quantile(speed, 0.995))
    if not falls:
        return np.linspace(0, top, 10)
    low = max(float(np.quantile(speed, 0.005)), 0.1 * falls)
    return np.geomspace(min(low, 0.5 * top), max(top, 3 * falls), 12)


def plain_decades(axes: "Axes") -> None:
    """Make the lower axis logarithmic, its numbers written out: 0.3, 1, 3."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 3)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


def logarithmic(axes: "Axes", falls: float) -> None:
    """Make the axis of speed logarithmic, with a mark at the speed over which friction falls; nothing where it is 0."""
    if falls:
        plain_decades(axes)
        axes.axvline(falls, color=GREY, lw=1, ls=(0, (1, 2)))


def steady(chosen: Samples, least: float) -> Mask:
    """Return where the machine moves and hardly accelerates; gaps between recordings count as acceleration.

    `least`, where given, is the speed from which it counts as moving.
    """
    step = np.gradient(chosen.t) if chosen.t.size > 2 else np.ones_like(chosen.t)
    with np.errstate(invalid="ignore", divide="ignore"):
        acceleration = np.abs(np.gradient(chosen.v) / step) if chosen.t.size > 2 else np.ones_like(chosen.t)
    slowest = min(least, slow(chosen.v)) or slow(chosen.v)
    moving = (np.abs(chosen.v) > slowest) & np.isfinite(acceleration) & (step > 0)
    limit = np.quantile(acceleration[moving], 0.6) if moving.any() else 0.0
    return moving & (acceleration <= limit)


def _side(axes: "Axes", side: Samples, sign: float, mark: tuple[str, str], edges: Array, scales: Scales) -> None:
    speed, unit = np.abs(side.v) * scales.speed.factor, scales.torque.factor * sign
    style: Style = {"ls": "", "marker": mark[0], "ms": 8, "mfc": mark[1], "color": MEASURED, "elinewidth": 1.4}
    measured = over_speed(speed, side.tau * unit, edges)
    axes.errorbar(measured.x, measured.mean, yerr=measured.half, zorder=4, **style)
    for error, colour, dashes in ((side.before, BEFORE, (4, 2)), (side.after, AFTER, (None, None))):
        model = over_speed(speed, (side.tau - error) * unit, edges)
        axes.plot(model.x, model.mean, color=colour, dashes=dashes, lw=1.5)


def over_speed(speed: Array, y: Array, edges: Array) -> Curve:
    """Bin over speed, in equal steps or, where the first edge is above zero, in equal ratios."""
    if edges[0] <= 0:
        return curve(speed, y, edges)
    binned = curve(np.log(np.maximum(speed, 1e-300)), y, np.log(edges))
    return Curve(np.exp(binned.x), binned.mean, binned.half)


def position(finding: Finding, chosen: Samples, scales: Scales) -> Picture | None:
    """Draw the error over position, forward and backward apart: alike = torque, opposite = friction."""
    moving = np.abs(chosen.v) > slow(chosen.v)
    groups: tuple[tuple[str, Mask, Any], ...] = (
        ("forward", chosen.v > 0, "-"),
        ("backward", chosen.v < 0, (0, (1, 1))),
    )
    return _split(finding, chosen, scales, [(label, mask & moving, style) for label, mask, style in groups])


def rest_and_motion(finding: Finding, chosen: Samples, scales: Scales) -> Picture | None:
    """Draw the error over position in slow and fast motion: a load does not care, a false reading grows with v^2."""
    edge = float(np.median(np.abs(chosen.v)))
    groups: list[tuple[str, Mask, Any]] = [
        ("slow", np.abs(chosen.v) <= edge, "-"),
        ("fast", np.abs(chosen.v) > edge, (0, (1, 1))),
    ]
    return _split(finding, chosen, scales, groups)


def _split(finding: Finding, chosen: Samples, scales: Scales, groups: list[tuple[str, Mask, Any]]) -> Picture | None:
    sheet, axes = blank(finding)
    x = chosen.q * scales.position.factor
    edges = np.linspace(x.min(), x.max(), 33)
    added = not np.array_equal(chosen.before, chosen.after)
    for _, mask, style in groups:
        for residual, colour in ((chosen.before, BEFORE), (chosen.after, AFTER))[: 1 + added]:
            mean = curve(x[mask], residual[mask] * scales.torque.factor, edges)
            axes.plot(mean.x, mean.mean, color=colour, ls=style, lw=1.8)
    axes.axhline(0, color=GREY, lw=0.8, zorder=1)
    degrees(axes, scales.position.unit)
    axes.locator_params(axis="y", nbins=5)
    heading(axes, f"mean error [{scales.torque.unit}]", below=f"position [{scales.position.unit}]")
    models = "Orange before, blue after." if added else "The refitted model."
    caption = f"{models} Solid: {groups[0][0]}; dotted: {groups[1][0]}."
    return sheet.picture(f"{finding.title}, error over position. {caption}", caption)


def load(finding: Finding, chosen: Samples, scales: Scales) -> Picture | None:
    """Draw the error over the torque itself: a drive that gives less, or friction that grows, bends this line."""
    x = chosen.tau * scales.torque.factor
    edges = np.linspace(float(np.quantile(x, 0.002)), float(np.quantile(x, 0.998)), 31)
    axis = f"measured, filtered [{scales.torque.unit}]"
    sheet, _ = error_over(finding, x, (chosen.before, chosen.after), edges, axis, scales)
    return sheet.picture(f"{finding.title}, error over load.", "Mean error over the commanded load, 95 % band.")


def elapsed(finding: Finding, chosen: Samples, scales: Scales) -> Picture | None:
    """Draw the error along the motion over elapsed time: friction that drifts while the machine warms up."""
    moving = np.abs(chosen.v) > slow(chosen.v)
    sign = np.sign(chosen.v[moving])
    t, y = chosen.t[moving], (chosen.before[moving] * sign, chosen.after[moving] * sign)
    edges = np.linspace(t.min(), t.max(), 21) if t.size else np.array([0.0, 1.0])
    sheet, _ = error_over(finding, t, y, edges, "time in the recording [s]", scales)
    return sheet.picture(
        f"{finding.title}, friction error over time.", "Error along the motion: above 0, the machine drags more."
    )
