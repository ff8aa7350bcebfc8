"""When: missing torque and its band over time, RMS by the second, and the worst seconds as lines."""

from typing import TYPE_CHECKING

import numpy as np

from cosim.diagnosis.answer.result import Trace
from cosim.diagnosis.measure.breakdown import bars
from cosim.plots.style import AFTER, BAND, BEFORE, GREY, MEASURED, SHADE, Style, thin
from cosim.report.quantities import Scales
from cosim.report.sheet import COLUMN, Picture, Sheet, heading

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BUCKETS = 260
MOSTLY = 0.5
"""Share of a recording from which a mark of what is outside the band tells nothing any more: a number does."""
WIDE = 738
"""Two columns of a desk, the whole width of a printed page."""


def recording(index: int, trace: Trace, scales: Scales, most: tuple[float, float]) -> Picture:
    """Draw missing torque with its 95 % band, then RMS bars before and after; `most` scales all recordings alike."""
    sheet = Sheet(f"time{index}", 304)
    top, middle, low = (sheet.axes(top=a, bottom=b) for a, b in ((24, 166), (172, 92), (226, 42)))
    unit = scales.torque
    _missing(top, trace, unit.factor)
    top.set_ylim(-most[0] * unit.factor, most[0] * unit.factor)
    heading(top, f"missing, and the band of pure noise [{unit.unit}]")
    edges, before, after = bars(trace)
    for axes, values, colour in ((middle, before, BEFORE), (low, after, AFTER)):
        axes.stairs(np.nan_to_num(values) * unit.factor, edges, fill=True, color=colour, lw=0)
        axes.set_ylim(0, most[1] * unit.factor)
    width = edges[1] - edges[0]
    heading(middle, f"RMS by {'the second' if width == 1 else f'{width:g} s'}, before and after [{unit.unit}]")
    _times((top, middle, low), trace)
    _flags(top, trace)
    low.set_xlabel("time [s]")
    kind = "not used for fitting" if trace.heldout else "used for fitting"
    label = f"Error over time of {trace.name}, {kind}."
    return sheet.picture(label, f"{kind[0].upper()}{kind[1:]}. {_flagged(trace)}".strip(), trace.name)


def _missing(axes: "Axes", trace: Trace, factor: float) -> None:
    size = max(1, len(trace.t) // BUCKETS)
    rows = len(trace.t) // size
    t, band = (x[: rows * size].reshape(rows, size).mean(axis=1) for x in (trace.t, trace.band))
    axes.plot(*thin(trace.t, trace.missing * factor, BUCKETS), color=BEFORE, lw=0.8)
    axes.fill_between(t, -band * factor, band * factor, color=BAND, alpha=0.55, lw=0, zorder=3)


def _times(strips: "tuple[Axes, ...]", trace: Trace) -> None:
    for axes in strips:
        axes.set_xlim(trace.t[0], trace.t[-1])
        if trace.heldout:  # a background of its own would be left out where the page shines through
            axes.axvspan(trace.t[0], trace.t[-1], color=SHADE, lw=0, zorder=-1)
        axes.locator_params(axis="y", nbins=4 if axes is strips[0] else 1)
        axes.tick_params(labelbottom=axes is strips[-1])


def _flags(axes: "Axes", trace: Trace) -> None:
    bottom = axes.get_ylim()[0]
    if flagged_share(trace) > MOSTLY:
        return
    for low, high in trace.intervals:
        axes.plot([low, high], [bottom * 0.96] * 2, color=MEASURED, lw=4, solid_capstyle="butt")


def flagged_share(trace: Trace) -> float:
    """Return the share of a recording in which the missing torque is outside the noise band for long."""
    return sum(high - low for low, high in trace.intervals) / float(trace.t[-1] - trace.t[0])


def _flagged(trace: Trace) -> str:
    share = flagged_share(trace)
    if share > MOSTLY:
        return f"Above the noise for {100 * min(share, 1):.0f} % of the time, rests and short returns counted."
    return "Black line: above the noise for long." if share > 0 else ""


def overlay(trace: Trace, span: tuple[float, float], scales: Scales, width: int = COLUMN) -> Picture:
    """Draw measured, before and after over the worst seconds, and the errors below."""
    sheet = Sheet(f"overlay{width}", 356, width)
    top, low = sheet.axes(bottom=172, top=28), sheet.axes(top=226)
    unit = scales.torque
    cut = (trace.t >= span[0]) & (trace.t <= span[1])
    t, buckets = trace.t[cut], max(60, int((width - 54) * 0.4))
    models = (trace.before,) if np.array_equal(trace.before, trace.after) else (trace.before, trace.after)
    for y, style in zip((trace.tau, *models), _LINES, strict=False):
        top.plot(*thin(t, y[cut] * unit.factor, buckets), **style)
    for y, colour in zip((trace.tau - model for model in models), (BEFORE, AFTER), strict=False):
        low.plot(*thin(t, y[cut] * unit.factor, buckets), color=colour, lw=1.2)
    low.axhline(0, color=GREY, lw=0.8, zorder=1)
    heading(top, f"{scales.noun} [{unit.unit}]")
    heading(low, f"error: measured minus model [{unit.unit}]")
    for axes in (top, low):
        axes.set_xlim(*span)
        axes.locator_params(axis="y", nbins=5)
    top.tick_params(labelbottom=False)
    low.set_xlabel("time [s]")
    names = "model before and model after" if models[1:] else "model"
    words = f"Measured and {names}, {span[0]:.1f} to {span[1]:.1f} s of {trace.name}."
    return sheet.picture(words, words)


_LINES: tuple[Style, ...] = (
    {"color": MEASURED, "lw": 1.4},
    {"color": BEFORE, "lw": 1.6, "dashes": (4, 2)},
    {"color": AFTER, "lw": 1.6},
)
