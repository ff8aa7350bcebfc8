"""Figures laid out like the paper's Figs. 4-6: friction map, a plant that is not stationary, presliding steps.

matplotlib is imported on use only.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cosim.estimation.identify.friction_map import Samples
from cosim.plots.sheet import draw_all, figure
from cosim.plots.style import AFTER, BEFORE, GREY, LINE, MEASURED
from cosim_studies.paper.identification import CUT, PAPER_NOMINAL, PEAK, SIDES, Identification, curve, true_numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS = 500
SPEED = 0.05
"""Unit of the speed beside a torque [rad/s]."""
SHADES = ("#9DB8CC", "#5C8DB3", "#00558C", "#CC6A00", "#7A4000", "#1A1A1A")
"""Colours of successive periods."""


def identification_figures(found: Identification, folder: Path, force: bool = False) -> dict[Path, str]:
    """Draw all; return what each shows."""
    pictures = {
        "fig04_map": (
            draw_map,
            "friction over speed by direction and jointly, and over time, as in the paper's Fig. 4",
        ),
        "fig05_varying": (
            draw_varying,
            "break-away and friction map that vary from period to period, as in the paper's Fig. 5",
        ),
        "fig06_presliding": (
            draw_steps,
            "presliding steps of 1 N m by (16) and by the direct fit, as in the paper's Fig. 6",
        ),
    }
    return draw_all(found, folder, pictures, force)


def draw_map(found: Identification, path: Path, force: bool) -> None:
    """(a) forward, (b) backward, (c) both, (d) the joint model over time."""
    with figure(path, 2, 2, (9.0, 6.4), force) as (sheet, axes):
        sheet.suptitle("Friction over speed, as in Fig. 4 of the paper", x=0.01, ha="left", fontsize=11)
        for one, letter, side in zip(axes[0], "ab", SIDES, strict=True):
            sign = 1.0 if side == "positive" else -1.0
            chosen = found.every.v * sign > 0
            _cloud(one, Samples(found.every.v[chosen], found.every.friction[chosen]))
            _curves(one, found, side, sign)
            one.set_title(f"({letter}) omega {'>' if sign > 0 else '<'} 0", loc="left", color=GREY)
        folded = Samples(np.abs(found.every.v), np.sign(found.every.v) * found.every.friction)
        _cloud(axes[1, 0], folded)
        _curves(axes[1, 0], found, "both", 1.0)
        axes[1, 0].set_title("(c) both directions, folded", loc="left", color=GREY)
        _over_time(axes[1, 1], found)
        for one in (*axes[0], axes[1, 0]):
            one.set(xlabel="speed [rad/s]", ylabel="friction [N m]")
            one.legend(frameon=False, fontsize=8.5)
            one.grid(True)


def _cloud(axes: "Axes", samples: Samples) -> None:
    every = max(1, len(samples.v) // POINTS)
    axes.plot(samples.v[::every], samples.friction[::every], ".", color=LINE, markersize=2, label="torque - J q''")


def _curves(axes: "Axes", found: Identification, side: str, sign: float) -> None:
    v = np.linspace(CUT, 0.98 * PEAK, 200)
    torque, band = found.map.curve(side, v)
    known = true_numbers(side) if side in SIDES else PAPER_NOMINAL
    axes.fill_between(sign * v, sign * (torque - band), sign * (torque + band), color=AFTER, alpha=0.2, linewidth=0)
    axes.plot(sign * v, sign * torque, color=AFTER, label="fitted")
    axes.plot(sign * v, sign * curve(known, v), "--", color=BEFORE, label="Table 2 of the paper")


def _over_time(axes: "Axes", found: Identification) -> None:
    """Torque as commanded, and what the joint map expects at the desired speed."""
    every = max(1, len(found.slow) // POINTS)
    t, q_d = found.slow.t, found.slow["q_d"]
    v = np.gradient(q_d, t)
    fit = found.map.fits["both"]
    joint = np.sign(v) * curve(dict(zip(fit.names, fit.values, strict=True)), np.abs(v))
    axes.plot(t[::every], found.slow["tau"][::every], color=LINE, linewidth=1.2, label="torque")
    axes.plot(t[::every], joint[::every], color=AFTER, linewidth=1.2, label="joint map")
    axes.set(xlabel="t [s]", ylabel="[N m]")
    axes.set_title("(d) joint map and torque", loc="left", color=GREY)
    axes.legend(frameon=False, fontsize=8.5)
    axes.grid(True)


def draw_varying(found: Identification, path: Path, force: bool) -> None:
    """(a) speed under a periodic torque in open loop, break-away marked; (b) friction maps period by period."""
    with figure(path, 1, 2, (10.0, 3.8), force) as (sheet, (axes,)):
        sheet.suptitle("A plant that is not stationary, as in Fig. 5 of the paper", x=0.01, ha="left", fontsize=11)
        left, right = axes
        left.plot(found.push.t, found.push["tau"], color=LINE, label="torque [N m]")
        left.plot(found.push.t, found.push["v"] / SPEED, color=AFTER, linewidth=1.1, label=f"speed [{SPEED:g} rad/s]")
        marks = np.array(found.breakaways)
        left.plot(marks[:, 0], marks[:, 1], "o", color=BEFORE, markersize=5, label="break-away")
        left.set_title("(a) open loop", loc="left", color=GREY)
        left.set(xlabel="t [s]", ylim=(-8, 9))
        left.legend(frameon=False, fontsize=8.5, ncols=3, loc="upper center")
        for number, samples in enumerate(found.periods):
            every = max(1, len(samples.v) // POINTS)
            colour = SHADES[number % len(SHADES)]
            right.plot(samples.v[::every], samples.friction[::every], ".", color=colour, markersize=2)
            right.plot([], [], "o", color=colour, markersize=5, label=f"period {number + 1}")
        right.set_title("(b) closed loop", loc="left", color=GREY)
        right.set(xlabel="speed [rad/s]", ylabel="friction [N m]")
        right.legend(frameon=False, fontsize=8.5)
        for one in axes:
            one.grid(True)


def draw_steps(found: Identification, path: Path, force: bool) -> None:
    """Position after a torque step in each direction: recorded, by (16), by the direct fit."""
    steps = [step for step in found.steps if abs(step.torque) == 1.0 and step.directions == "one"]
    with figure(path, 1, len(steps), (9.0, 3.4), force) as (sheet, (axes,)):
        sheet.suptitle("Presliding steps of 1 N m, as in Fig. 6 of the paper", x=0.01, ha="left", fontsize=11)
        for one, letter, step in zip(axes, "ab", steps, strict=True):
            t, q = step.recording.t, step.recording["q"]
            every = max(1, len(t) // POINTS)
            one.plot(t[::every], 1e6 * q[::every], color=LINE, linewidth=3.5, label="recorded")
            for way, style, colour in (("linear", "--", BEFORE), ("direct", "-", AFTER)):
                fitted = step.fitted[way][::every]
                label = {"linear": "linear, (16)", "direct": "LuGre, direct"}[way]
                one.plot(t[::every][: len(fitted)], 1e6 * fitted, style, color=colour, linewidth=1.2, label=label)
            one.set_title(f"({letter}) omega {'>' if step.torque > 0 else '<'} 0", loc="left", color=MEASURED)
            one.set(xlabel="t [s]", ylabel="position [1e-6 rad]")
            one.legend(frameon=False, fontsize=8.5)
            one.grid(True)
