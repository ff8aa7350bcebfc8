"""Pictures of an identification: the map with its bands, the presliding step, what output error leaves."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cosim.files import replacing
from cosim.identify.identify import Identified, is_step
from cosim.identify.output_error import closed_loop, output_model
from cosim.identify.presliding import simulated
from cosim.recording import Recording
from pyfmi_models.card import Card

COLOURS = {"positive": "#c2571a", "negative": "#1f6fb2", "both": "#555555"}
MOST_POINTS = 4000


def _axes(rows: int, height: float) -> tuple[Any, Any]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, height), layout="constrained")
    return figure, np.atleast_1d(figure.subplots(rows, 1))


def _save(figure: Any, path: Path) -> None:
    with replacing(path, True) as partial:
        figure.savefig(partial, format="svg", metadata={"Date": None})


def _thin(values: Any) -> slice:
    return slice(None, None, max(1, len(values) // MOST_POINTS))


def draw_map(found: Identified, recordings: Sequence[Recording], card: Card, path: Path) -> None:
    """Friction torque over speed, samples and fitted curves with 95 % bands."""
    if found.map is None:
        return
    figure, (axes,) = _axes(1, 4.2)
    v, friction = found.map.samples
    axes.plot(v[_thin(v)], friction[_thin(v)], ".", ms=1.5, color="#bbbbbb", label="recorded, J q'' removed")
    speeds = np.linspace(found.map.cut, float(np.abs(v).max()), 200)
    for name, sign in (("positive", 1), ("negative", -1)):
        if name in found.map.fits:
            torque, band = found.map.curve(name, speeds)
            axes.plot(sign * speeds, sign * torque, color=COLOURS[name], label=name)
            axes.fill_between(
                sign * speeds, sign * (torque - band), sign * (torque + band), color=COLOURS[name], alpha=0.25
            )
    if "both" in found.map.fits:
        joint = found.map.curve("both", speeds)[0]
        axes.plot(
            np.r_[-speeds[::-1], np.nan, speeds],
            np.r_[-joint[::-1], np.nan, joint],
            "--",
            color=COLOURS["both"],
            label="both",
        )
    linear = card.mount.motion == "linear"
    axes.set(xlabel=f"speed [{'m/s' if linear else 'rad/s'}]", ylabel=f"friction [{'N' if linear else 'N m'}]")
    axes.legend(frameon=False)
    _save(figure, path)


def draw_presliding(found: Identified, recordings: Sequence[Recording], card: Card, path: Path) -> None:
    """Position after a torque step: recorded, the linear and the direct model."""
    steps = [one for one in recordings if is_step(one, card) and one.name in found.presliding]
    if not steps:
        return
    figure, all_axes = _axes(len(steps), 3.2 * len(steps))
    for axes, step in zip(all_axes, steps, strict=True):
        ways = simulated(card, step, found.presliding[step.name])
        axes.plot(step.t, 1e6 * (step["q"] - step["q"][0]), color="#bbbbbb", lw=3, label="recorded")
        for (name, q), style in zip(ways.items(), ("--", "-"), strict=True):
            axes.plot(step.t[: len(q)], 1e6 * q, style, label=name)
        axes.set(title=step.name, xlabel="time [s]", ylabel="position [1e-6 rad or m]")
        axes.legend(frameon=False)
    _save(figure, path)


def draw_output_error(found: Identified, recordings: Sequence[Recording], card: Card, path: Path) -> None:
    """What the simulation leaves of position and torque, and the correlation of the estimates."""
    if found.best is None:
        return
    machine = closed_loop(found.card, found.best.names)
    driven = [one for one in recordings if "q_d" in one and "q" in one]
    rest = output_model(machine, driven)(found.best.values).residual
    figure, (position, torque, picture) = _axes(3, 9)
    for axes, column, name in ((position, 0, "position"), (torque, 1, "torque")):
        axes.plot(rest[:, column][_thin(rest)], lw=0.6, color=COLOURS["positive"])
        axes.set(ylabel=f"{name}: recorded - simulated", xlabel=f"row, one in {_thin(rest).step}")
    image = picture.imshow(found.best.correlation, vmin=-1, vmax=1, cmap="RdBu_r")
    short = [name.split(".", 1)[1] for name in found.best.names]
    picture.set_xticks(range(len(short)), short, rotation=45, ha="right")
    picture.set_yticks(range(len(short)), short)
    picture.set_title("correlation of the estimates")
    figure.colorbar(image, ax=picture)
    _save(figure, path)


Draw = Callable[[Identified, Sequence[Recording], Card, Path], None]
FIGURES: dict[str, Draw] = {
    "friction_map.svg": draw_map,
    "presliding.svg": draw_presliding,
    "output_error.svg": draw_output_error,
}
