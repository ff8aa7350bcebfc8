"""The comparison as a picture: error of z over the largest speed of the paper's sine, one panel a step."""

from collections.abc import Mapping, Sequence
from math import degrees, radians
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cosim.plots.sheet import figure, plain_logs
from cosim.plots.style import AFTER, BEFORE, Style
from cosim_studies.stiffness.comparison import FMU, Limit, Row
from cosim_studies.stiffness.errata import FOUND
from cosim_studies.stiffness.methods import METHODS
from cosim_studies.stiffness.motion import REGIMES
from pyfmi_models.export.codegen import TOLERANCE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SPEEDS = np.geomspace(radians(0.02), 3.0, 25)
"""Largest speeds of the sine [rad/s]: from the sky's to twice that of any slew."""
_START, _MIDDLE, _EULER, _RUNGE = METHODS
LOOK: dict[str, Style] = {
    _START: {"color": BEFORE},
    _MIDDLE: {"color": BEFORE, "linestyle": "--"},
    _EULER: {"color": "#8A5AA8"},
    _RUNGE: {"color": "#3A8A5C"},
    FMU: {"color": AFTER, "linewidth": 2.4},
}
LOWEST, HIGHEST = 3e-15, 3.0


def draw(sweeps: Mapping[float, Sequence[Row]], limits: Sequence[Limit], path: Path, force: bool = False) -> Path:
    """Draw the errors at `SPEEDS`, one panel for each step, and write an SVG; return its path."""
    with figure(path, 1, len(sweeps), (10, 4.8), force) as (sheet, (panels,)):
        for axes, (step, rows) in zip(panels, sweeps.items(), strict=True):
            _panel(axes, step, rows, [one for one in limits if one.step == step])
        panels[0].set_ylabel("largest error of z, relative to the largest |z|")
        _known(panels[0])
        sheet.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
        plain_logs(*panels)
    return path


def _panel(axes: "Axes", step: float, rows: Sequence[Row], limits: Sequence[Limit]) -> None:
    speeds = np.degrees(SPEEDS)
    for method, look in LOOK.items():
        errors = np.array([row.z_error for row in rows if row.method == method])
        finite = np.isfinite(errors)
        axes.plot(speeds[finite], np.maximum(errors[finite], LOWEST), label=method, **look)
    axes.axhline(TOLERANCE, color=LOOK[FMU]["color"], linewidth=0.9, linestyle=":", label="tolerance of the FMU")
    for limit in limits:
        _limit(axes, limit, 0.97 if limit.method == _EULER else 0.03)
    axes.set(xscale="log", yscale="log", ylim=(LOWEST, HIGHEST), xlim=(0.7 * speeds[0], 1.1 * speeds[-1]))
    axes.set(title=f"steps of {1e3 * step:g} ms", xlabel="largest speed of a sine of 0.2 Hz [deg/s]")
    axes.grid(True)


def _limit(axes: "Axes", limit: Limit, height: float) -> None:
    """Mark the steady speed above which a method is unstable."""
    color = LOOK[limit.method]["color"]
    axes.axvline(limit.degrees, color=color, linewidth=0.9, linestyle=":")
    text = f"{limit.method}\nunstable above {limit.degrees:.3g}°/s"
    up = height > 0.5
    axes.annotate(
        text, (limit.degrees, height), xycoords=("data", "axes fraction"), xytext=(-4, 0), textcoords="offset points",
        color=color, fontsize=8.5, ha="right", va="top" if up else "bottom",
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1},
    )  # fmt: skip


def _known(axes: "Axes") -> None:
    label: str | None = "errata of the paper (its ω > 0)"
    speeds = {regime.name: degrees(regime.peak) for regime in REGIMES}
    for (regime, method), (error, _) in FOUND.items():
        color = LOOK[method]["color"]
        axes.plot(speeds[regime], error, "o", mfc="white", color=color, markersize=6, label=label)
        label = None
