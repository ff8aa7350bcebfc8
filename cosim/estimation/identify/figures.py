"""Pictures of an identification: the map with its bands, the presliding step, what output error leaves."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cosim.data.recording import Recording
from cosim.estimation.identify.estimate import Estimate
from cosim.estimation.identify.friction_map import FrictionMap
from cosim.estimation.identify.identify import Identified, is_step
from cosim.estimation.identify.machine import Machine
from cosim.estimation.identify.output_error import closed_loop, output_model, replay_of
from cosim.estimation.identify.presliding import simulated
from cosim.plots.sheet import SIZES, figure, plain_logs
from cosim.plots.style import AFTER, BEFORE, GREY, LINE, MEASURED, STYLE
from pyfmi_models.card import Card

POINTS = 700
UNITS = {"rotary": ("rad/s", "N m", "rad"), "linear": ("m/s", "N", "m")}


def draw_map(found: Identified, recordings: Sequence[Recording], card: Card, path: Path) -> None:
    """Friction over speed by direction, both folded onto positive numbers: samples, fits and their 95 % bands."""
    if found.map is None:
        return
    sides = [name for name in ("positive", "negative") if name in found.map.fits]
    speed, force, _ = UNITS[card.mount.motion]
    with figure(path, 1, len(sides), (4.6 * len(sides), 3.6), True) as (sheet, (axes,)):
        sheet.suptitle("Friction over speed, with 95 % bands", x=0.01, ha="left", fontsize=11)
        for one, name in zip(axes, sides, strict=True):
            _side(one, found.map, name)
            one.set(xlabel=f"speed [{speed}]", ylabel=f"friction [{force}]")
        top = max(one.get_ylim()[1] for one in axes)
        for one in axes:
            one.set_ylim(min(other.get_ylim()[0] for other in axes), top)


def map_figure(found: Identified, card: Card) -> Any:
    """Return the figure of the friction map; without a map, of the numbers before and after."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context({**STYLE, **SIZES}):
        if found.map is None:
            return _numbers_figure(found, card)
        sides = [name for name in ("positive", "negative") if name in found.map.fits]
        speed, force, _ = UNITS[card.mount.motion]
        sheet = Figure(figsize=(4.6 * len(sides), 3.6), layout="constrained")
        for one, name in zip(sheet.subplots(1, len(sides), squeeze=False, sharey=True)[0], sides, strict=True):
            _side(one, found.map, name)
            one.set(xlabel=f"speed [{speed}]", ylabel=f"friction [{force}]")
    return sheet


def _numbers_figure(found: Identified, card: Card) -> Any:
    """Each number that was identified relative to the given card's."""
    from matplotlib.figure import Figure

    before = {one.name: one.start for one in card.plant().parameters()}
    after = {one.name: one.start for one in found.card.plant().parameters() if before.get(one.name)}
    ratios = {name: value / before[name] for name, value in after.items() if value != before[name]}
    sheet = Figure(figsize=(6, 1 + 0.35 * max(len(ratios), 1)), layout="constrained")
    axes = sheet.subplots()
    axes.barh(list(ratios), [ratio - 1 for ratio in ratios.values()], left=1, color=AFTER)
    axes.axvline(1, color=GREY, lw=0.8)
    axes.set_xlabel("identified number over the given one [1]")
    return sheet


def _side(axes: Any, found: FrictionMap, name: str) -> None:
    sign = 1.0 if name == "positive" else -1.0
    mine = found.samples.v * sign > 0
    v, friction = sign * found.samples.v[mine], sign * found.samples.friction[mine]
    every = max(1, len(v) // POINTS)
    removed = "torque - J q''" if found.keep_inertia else "torque"
    axes.plot(v[::every], friction[::every], ".", color=LINE, markersize=2.5, label=removed)
    speeds = np.linspace(found.cut, float(v.max()), 200)
    for fit, style, colour in ((name, "-", AFTER), ("both", "--", BEFORE)):
        if fit in found.fits:
            torque, band = found.curve(fit, speeds)
            axes.fill_between(speeds, torque - band, torque + band, color=colour, alpha=0.2, linewidth=0)
            axes.plot(speeds, torque, style, color=colour, label={"both": "both directions"}.get(fit, "this direction"))
    axes.set_title(f"{name} direction", loc="left", color=GREY)
    axes.legend(frameon=False, fontsize=8.5)
    axes.grid(True)


def draw_presliding(found: Identified, recordings: Sequence[Recording], card: Card, path: Path) -> None:
    """Position after a torque step: recorded, the linear and the direct model."""
    steps = [one for one in recordings if is_step(one, card) and one.name in found.presliding]
    if not steps:
        return
    force, length = UNITS[card.mount.motion][1:]
    with figure(path, len(steps), 1, (6.5, 3.2 * len(steps)), True) as (_, axes):
        for one, step in zip(axes[:, 0], steps, strict=True):
            result = found.presliding[step.name]
            ways = simulated(card, step, result)
            before = np.abs(step["tau"]) <= 1e-3 * result.torque
            start = step["q"][: max(1, int(np.argmin(before)))].mean()
            every = max(1, len(step) // POINTS)
            one.plot(step.t[::every], 1e6 * (step["q"] - start)[::every], color=LINE, linewidth=3.5, label="recorded")
            for (name, q), style, colour in zip(ways.items(), ("--", "-"), (BEFORE, AFTER), strict=True):
                t = step.t[: len(q)]
                one.plot(t[::every], 1e6 * q[::every], style, color=colour, linewidth=1.2, label=_WAYS[name])
            one.set_title(f"{step.name}: {result.torque:.3g} {force}", loc="left", color=GREY)
            one.set(xlabel="t [s]", ylabel=f"position [1e-6 {length}]")
            one.legend(frameon=False, fontsize=8.5)
            one.grid(True)


_WAYS = {"linear": "linear, equation (16)", "direct": "LuGre, direct"}


def draw_output_error(found: Identified, recordings: Sequence[Recording], card: Card, path: Path) -> None:
    """What the simulation leaves of position and torque, how sure each number is, and how they depend on each other."""
    if found.best is None:
        return
    machine = closed_loop(found.card, found.best.names)
    driven = [one for one in recordings if "q_d" in one and "q" in one]
    rest = output_model(machine, driven)(found.best.values).residual
    force, length = UNITS[card.mount.motion][1:]
    with figure(path, 2, 2, (10.0, 6.2), True) as (sheet, axes):
        sheet.suptitle("Output error in closed loop", x=0.01, ha="left", fontsize=11)
        t = _times(machine, driven)
        for one, column, label in zip(
            axes[:, 0], (0, 1), (f"position [1e-6 {length}]", f"torque [{force}]"), strict=True
        ):
            every, factor = max(1, len(t) // (2 * POINTS)), 1e6 if column == 0 else 1.0
            one.plot(t[::every], factor * rest[::every, column], ".", markersize=1.5, color=MEASURED)
            one.set(ylabel=label, xlabel="t [s], recordings one after the other")
            one.set_title(f"recorded - simulated, RMS {found.best.rms[column]:.2g}", loc="left", color=GREY)
            one.grid(True)
        _errors(axes[0, 1], found.best)
        _correlation(axes[1, 1], found.best)


def _times(machine: Machine, driven: Sequence[Recording]) -> Any:
    """Time of each row that is compared, recordings one after the other."""
    parts, end = [], 0.0
    for one in driven:
        parts.append(end + replay_of(machine, one).times)
        end = float(parts[-1][-1])
    return np.concatenate(parts)


def _errors(axes: Any, best: Estimate) -> None:
    share = 100 * best.standard_errors / np.abs(best.values)
    places = np.arange(len(share))
    axes.barh(places, share, color=AFTER, height=0.55)
    for place, value in zip(places, share, strict=True):
        axes.text(value, place, f" {value:.2g} %", va="center", fontsize=8.5, color=GREY)
    axes.set_yticks(places, _short(best.names))
    axes.invert_yaxis()
    axes.set(xscale="log", xlim=(share.min() / 3, share.max() * 4), xlabel="standard error [% of the number]")
    plain_logs(axes)


def _correlation(axes: Any, best: Estimate) -> None:
    shades = axes.imshow(best.correlation, vmin=-1, vmax=1, cmap="RdBu_r", aspect="auto")
    bar = axes.figure.colorbar(shades, ax=axes, ticks=(-1, 0, 1))
    bar.ax.set_yticklabels(["opposite", "none", "alike"])
    names = _short(best.names)
    for row in range(len(names)):
        for column in range(row):
            value = best.correlation[row, column]
            colour = "white" if abs(value) > 0.6 else MEASURED
            axes.text(column, row, f"{value:+.2f}", ha="center", va="center", fontsize=7.5, color=colour)
    axes.set_xticks(range(len(names)), names, rotation=45, ha="right")
    axes.set_yticks(range(len(names)), names)
    axes.set_title("correlation of the estimates", loc="left", color=GREY)


def _short(names: Sequence[str]) -> list[str]:
    return [name.split(".", 1)[1] for name in names]


Draw = Callable[[Identified, Sequence[Recording], Card, Path], None]
FIGURES: dict[str, Draw] = {
    "friction_map.svg": draw_map,
    "presliding.svg": draw_presliding,
    "output_error.svg": draw_output_error,
}
