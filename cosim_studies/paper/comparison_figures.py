"""Pictures of the comparison: gain against margin, the loops, what each controller survives.

matplotlib is imported on use only.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cosim.plots.sheet import draw_all, figure, plain_logs
from cosim.plots.style import AFTER, BEFORE, GREY, LINE, MEASURED, SHADE
from cosim_studies.paper.comparison import A, B, Comparison, Row
from cosim_studies.paper.conditions import condition
from cosim_studies.paper.experiment import ARCSEC
from cosim_studies.paper.frontier import GAIN, PHASE, Design, frontier
from cosim_studies.paper.margins import Complexes, Floats, Linear
from cosim_studies.paper.price import loops

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DRAWN = ("C3a", "C2a", "fourth_120", "fourth_220", "chosen")
"""Controllers whose loops are drawn."""
COLOURS = dict(zip(DRAWN, (MEASURED, "#8A949E", "#E0A566", BEFORE, AFTER), strict=True))
MARKERS = {3: "o", 4: "s"}
APART = 0.055
"""Least distance of two labels, as a share of the axis."""


def comparison_figures(found: Comparison, folder: Path, force: bool = False) -> dict[Path, str]:
    """Draw all; return what each shows."""
    pictures = {
        "gain_against_margin": (draw_gain, "ISE against phase and delay margin, with the frontier"),
        "loops": (draw_loops, "Nyquist curves, sensitivity and error per torque of five loops"),
        "robustness": (draw_robustness, "what each controller survives: flexible mode, delay, noise"),
    }
    return draw_all(found, folder, pictures, force)


def draw_gain(found: Comparison, path: Path, force: bool) -> None:
    """ISE over that of C3a against phase margin and against delay margin, condition A."""
    with figure(path, 1, 2, (10.5, 5.6), force) as (sheet, axes):
        sheet.suptitle("Gain against margin, condition A", x=0.01, ha="left", fontsize=11)
        for one, price, factor, label in zip(
            axes[0], ("phase", "delay"), (1, 1e3), ("phase margin [deg]", "delay margin [ms]"), strict=True
        ):
            _designs(one, found.designs, price, factor)
            _named(one, [row for row in found.of(A) if not row.option.key.startswith("order")], price, factor)
            one.set(yscale="log", xlabel=label)
            one.grid(True)
        axes[0, 0].set_ylabel("ISE / ISE of C3a")
        axes[0, 0].axvspan(PHASE, axes[0, 0].get_xlim()[1], 0, _height(axes[0, 0], GAIN), color=SHADE, zorder=0)
        sheet.legend(
            *axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=5, frameon=False, fontsize=9
        )
        plain_logs(*axes[0])


def _height(axes: "Axes", value: float) -> float:
    return float(axes.transAxes.inverted().transform(axes.transData.transform((1.0, value)))[1])


def _designs(axes: "Axes", designs: Sequence[Design], price: str, factor: float) -> None:
    for order, marker in MARKERS.items():
        for known, filled in (("nominal", True), ("plant", False)):
            mine = [one for one in designs if one.option.changes["observer_order"] == order]
            mine = [one for one in mine if one.option.knows == known]
            x, y = [factor * getattr(one.price, price) for one in mine], [one.ratio for one in mine]
            label = f"tried: order {order}" + ("" if filled else ", friction refitted")
            face = LINE if filled else "none"
            axes.plot(x, y, marker, color=LINE, markerfacecolor=face, markersize=4.5, linewidth=0, label=label)
    best = frontier([one for one in designs if one.option.knows == "nominal"], price)
    x, y = [factor * getattr(one.price, price) for one in best], [one.ratio for one in best]
    axes.plot(x, y, color=GREY, linewidth=1.2, drawstyle="steps-post", label="frontier (design seeds)")


def _named(axes: "Axes", rows: Sequence[Row], price: str, factor: float) -> None:
    """Named controllers on test seeds; labels to the right, pushed apart where they would overlap."""
    points = sorted((row.ratio, factor * getattr(row.price, price), row.option.key) for row in rows)
    for ratio, x, key in points:
        chosen = key == "chosen"
        axes.plot(x, ratio, "*" if chosen else "o", color=BEFORE if chosen else AFTER, markersize=11 if chosen else 5)
    axes.set_yscale("log")
    low, high = np.log10(axes.get_ylim())
    right = axes.get_xlim()[1]
    axes.set_xlim(axes.get_xlim()[0], right + 0.28 * (right - axes.get_xlim()[0]))
    place = -np.inf
    for ratio, x, key in points:
        place = max(float(np.log10(ratio)), place + APART * (high - low))
        style: Any = {"arrowstyle": "-", "color": LINE, "linewidth": 0.7, "shrinkA": 0, "shrinkB": 3}
        axes.annotate(
            key, (x, ratio), (right, 10**place), fontsize=8.5, va="center", arrowprops=style, annotation_clip=False
        )


def draw_loops(found: Comparison, path: Path, force: bool) -> None:
    """Nyquist curves with the circle of Ms = 2, sensitivity, and error per torque, condition B."""
    chosen = {one.option.key: one.option for one in found.of(B)}
    omega = np.geomspace(1, 3000, 1500)
    with figure(path, 1, 3, (11.5, 4.2), force) as (sheet, (axes,)):
        sheet.suptitle("Loops in condition B, at rest", x=0.01, ha="left", fontsize=11)
        for key in (one for one in DRAWN if one in chosen):
            plant, controller = loops(chosen[key].under(condition(B)))["at rest"]
            around = _loop(plant, controller, omega)
            sensitivity = 1 / np.abs(1 + around)
            axes[0].plot(around.real, around.imag, color=COLOURS[key], label=key)
            axes[1].plot(omega, sensitivity, color=COLOURS[key])
            axes[2].plot(omega, np.abs(plant.response(omega)) * sensitivity / ARCSEC, color=COLOURS[key])
        _nyquist_paper(axes[0])
        axes[1].set(xscale="log", yscale="log", ylim=(1e-3, 4), xlabel="angular frequency [rad/s]")
        axes[2].set(xscale="log", yscale="log", xlabel="angular frequency [rad/s]")
        titles = ("Nyquist; dashed Ms = 2, dotted 45 deg", "sensitivity |S|", "error per torque [arcsec per N m]")
        for one, title in zip(axes, titles, strict=True):
            one.set_title(title, loc="left", color=GREY)
            one.grid(True)
        plain_logs(*axes)


def _loop(plant: Linear, controller: Linear, omega: Floats) -> Complexes:
    around = plant.response(omega) * controller.response(omega) * np.exp(-1j * omega * plant.period)
    return np.asarray(around)


def _nyquist_paper(axes: "Axes") -> None:
    turn = np.linspace(0, 2 * np.pi, 200)
    axes.plot(np.cos(turn), np.sin(turn), color=LINE, linewidth=1)
    axes.plot(-1 + 0.5 * np.cos(turn), 0.5 * np.sin(turn), "--", color=LINE, linewidth=1)
    ray = np.radians(180 + PHASE)
    axes.plot([0, 2 * np.cos(ray)], [0, 2 * np.sin(ray)], ":", color=GREY, linewidth=1)
    axes.plot(-1, 0, "+", color=MEASURED, markersize=8)
    axes.set(xlim=(-2.5, 1), ylim=(-2, 1.5), aspect="equal")
    axes.legend(frameon=False, loc="lower right", fontsize=8.5)


def draw_robustness(found: Comparison, path: Path, force: bool) -> None:
    """Controllers by stresses, coloured by ISE over that of C3a as designed; crosses where the loop is unstable."""
    from matplotlib.colors import LogNorm

    keys = list(dict.fromkeys(one.option.key for one in found.survivals))
    stresses = list(dict.fromkeys(one.stress.key for one in found.survivals))
    grid = np.full((len(keys), len(stresses)), np.nan)
    with figure(path, 1, 1, (1.6 + 0.58 * len(stresses), 1.9 + 0.34 * len(keys)), force) as (sheet, axes):
        one = axes[0, 0]
        for item in found.survivals:
            row, column = keys.index(item.option.key), stresses.index(item.stress.key)
            grid[row, column] = item.ratio
            text = _cell(item.ratio) + ("" if item.stable else " ×")
            dark = item.ratio > 20 or item.ratio < 0.03
            one.text(column, row, text, ha="center", va="center", fontsize=7.5, color="white" if dark else MEASURED)
        one.imshow(np.clip(grid, 1e-2, 1e2), cmap="RdYlBu_r", norm=LogNorm(1e-2, 1e2), aspect="auto")
        one.set_xticks(range(len(stresses)), stresses, rotation=50, ha="right")
        one.set_yticks(range(len(keys)), keys)
        title = "ISE over that of C3a as designed, condition B, first test seed; × the linear loop is unstable"
        sheet.suptitle(title, x=0.01, ha="left", fontsize=10.5)


def _cell(value: float) -> str:
    return f"{value:.0e}".replace("e+0", "e") if value >= 100 else f"{value:.2g}"
