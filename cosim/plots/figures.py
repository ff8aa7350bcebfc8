"""Figures for `.plot()`: each returns a matplotlib figure, which a notebook shows and `savefig` writes."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cosim.plots.quantities import scale_of
from cosim.plots.style import AFTER, GREY, STYLE, thin

if TYPE_CHECKING:
    from cosim.data.recording import Recording

ORDER = ("tau", "q", "q_d", "v", "temperature")
"""Columns that are drawn first."""
MOST, POINTS = 12, 1000
"""Panels of a figure, and buckets in which a line is thinned."""


def recording(one: "Recording", names: Sequence[str] = ()) -> Any:
    """Draw columns over time, a panel each; a set point is drawn into the panel of the position.

    Args:
        one: what was recorded.
        names: columns; all but the time, ours first, where not given.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    shown = _panels(one, names)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9, 1.0 + 1.5 * len(shown)), layout="constrained")
        panels = figure.subplots(max(len(shown), 1), 1, squeeze=False, sharex=True)[:, 0]
        for axes, name in zip(panels, shown, strict=False):
            _panel(axes, one, name)
        panels[-1].set_xlabel("time [s]")
        figure.suptitle(one.name, x=0.01, ha="left", color=GREY)
    return figure


def _panels(one: "Recording", names: Sequence[str]) -> list[str]:
    every = [name for name in one if name != "t"]
    if names:
        return list(names)
    asked_beside = {"q_d"} if "q" in every and one.units.get("q") == one.units.get("q_d") else set()
    ranked = sorted(every, key=lambda name: ORDER.index(name) if name in ORDER else len(ORDER))
    return [name for name in ranked if name not in asked_beside][:MOST]


def _panel(axes: Any, one: "Recording", name: str) -> None:
    scale = scale_of(one.units.get(name, ""), float(np.abs(one[name]).max()))
    t = one.t - one.t[0]
    if name == "q" and "q_d" in one and one.units.get("q_d") == one.units.get("q"):
        axes.plot(*thin(t, one["q_d"] * scale.factor, POINTS), color=GREY, lw=1, ls="--", label="set point")
    axes.plot(*thin(t, one[name] * scale.factor, POINTS), color=AFTER, label=name)
    axes.set_title(name, loc="left")
    axes.set_ylabel(scale.unit or "no unit")
    axes.grid(visible=True, axis="y")
    if len(axes.lines) > 1:
        axes.legend(frameon=False, fontsize=9, loc="upper right")
