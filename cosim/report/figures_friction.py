"""Friction over speed: the curves F(v) of the refitted card and of the improved one, and what was measured of it.

A marker is the improved model's friction plus what that model leaves of the recording there: other effects, the inertia
and the loads are taken out, and what is left to see is friction (a partial residual; Larsen and McCleary, Technometrics
14 (1972) 781).
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from cosim.diagnosis.answer.result import Array, Diagnosis, Finding
from cosim.diagnosis.effects import named
from cosim.diagnosis.measure.breakdown import Curve, Samples
from cosim.plots.style import AFTER, BEFORE, MEASURED, Style
from cosim.report.figures_effect import blank, logarithmic, over_speed, speeds, steady
from cosim.report.quantities import Scales
from cosim.report.sheet import Picture, heading
from pyfmi_models.effects import CATALOGUE, Effect
from pyfmi_models.friction import LAWS, FrictionLaw
from pyfmi_models.model import Pair
from pyfmi_models.mount import Axis, Mount

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Force = Callable[[Array], Array]
"""Friction [N m, N] over signed speed [rad/s, m/s]."""
LEAST_ROWS, POINTS = 200, 240
REFITTED, IMPROVED = 1, 2
"""Places of the numbers in `Diagnosis.base_parameters`."""
APART = 0.01
"""Share of the friction by which the directions must differ to be drawn apart."""


@dataclass(frozen=True)
class Curves:
    """Friction of the refitted card, and of the improved one."""

    before: Force
    after: Force


def curves(diagnosis: Diagnosis) -> Curves | None:
    """Return both curves; None where the numbers of the base are not at hand, or its law has no steady sliding."""
    before = law_with(diagnosis, REFITTED)
    after = law_with(diagnosis)
    if before is None or after is None or before.key == "none":
        return None
    told = [one for one in diagnosis.in_model if named(one.effect).view == "keep turning"]
    effects = [effect for one in told if (effect := effect_of(one)) is not None]
    return Curves(_force(before, ()), _force(after, tuple(effects)))


def law_with(diagnosis: Diagnosis, which: int = IMPROVED) -> FrictionLaw | None:
    """Return the law of the base with the numbers at one stage; None where they are not at hand."""
    kind = LAWS.get(str(diagnosis.friction_law.get("base", "")))
    if kind is None:
        return None
    known: dict[str, float] = {}
    pairs: dict[str, dict[str, float]] = {}
    for name, values in diagnosis.base_parameters.items():
        owner, _, rest = name.partition(".")
        key, _, side = rest.partition(".")
        if owner == "friction" and side:
            pairs.setdefault(key, {})[side] = values[which]
        elif owner == "friction":
            known[key] = values[which]
    numbers = known | {key: Pair(**sides) for key, sides in pairs.items() if set(sides) == set(Pair._fields)}
    try:
        return kind(**numbers)
    except TypeError:
        return None


def effect_of(finding: Finding) -> Effect | None:
    """Return the effect with the numbers that were found; None where they do not fit its equation."""
    forms = CATALOGUE.get(finding.effect, ())
    for form in forms:
        if set(finding.parameters) <= {item.name for item in fields(form)}:
            try:
                return form(**finding.parameters)
            except TypeError:
                continue
    return None


def _force(law: FrictionLaw, effects: tuple[Effect, ...]) -> Force:
    """Friction in steady sliding, with effects that act on it."""
    mount = Mount(name="friction", axis=Axis(inertia=1.0), friction=law, effects=effects)

    def at(v: float) -> float:
        motion = mount.at(0.0, 0.0, v)
        this = mount.with_symbols({one.name: one.start for one in mount.parameters()}, v)
        level = float(this.level(this.accelerated(motion, 0.0))) * float(np.sign(v))
        return level + float(this.viscous(motion)) + float(this.loads(motion))

    return lambda speed: np.array([at(float(v)) for v in speed])


def friction(finding: Finding, diagnosis: Diagnosis, chosen: Samples, scales: Scales) -> Picture | None:
    """Draw friction over speed, either direction, with 95 % bars; None where it cannot be told apart from the rest."""
    both = curves(diagnosis)
    falls = float(finding.parameters.get("Vs", 0.0)) if finding.effect == "stribeck" else 0.0
    shown = chosen.where(steady(chosen, 0.1 * falls))
    if both is None or shown.v.size < LEAST_ROWS:
        return None
    edges = speeds(shown, falls)
    low = edges[0] if edges[0] > 0 else 1e-3 * edges[-1]
    grid = np.geomspace(low, edges[-1], POINTS) if falls else np.linspace(low, edges[-1], POINTS)
    sheet, axes = blank(finding)
    apart = _drawn(axes, both, grid, scales)
    for sign, mark, fill in ((1.0, "^", MEASURED), (-1.0, "v", "white")):
        _markers(axes, both.after, shown.where(shown.v * sign > 0), sign, (mark, fill), edges, scales)
    axes.set_xlim(edges[0] * scales.speed.factor, edges[-1] * scales.speed.factor)
    logarithmic(axes, falls * scales.speed.factor)
    heading(axes, f"friction [{scales.torque.unit}]", below=f"speed [{scales.speed.unit}]")
    caption = "▲ measured forward, ▽ backward, other effects taken out, bars 95 %. "
    caption += f"Orange: refitted card; blue: improved card{' (dotted: backward)' * apart}."
    caption += f" Dotted line: {scales.speed.text(falls)}, over which friction falls." if falls else ""
    return sheet.picture(f"{finding.title}. {caption}", caption)


def _drawn(axes: "Axes", both: Curves, grid: Array, scales: Scales) -> bool:
    """Draw the curves; return whether directions are drawn apart."""
    apart = False
    for force, colour, dashes in ((both.before, BEFORE, (4, 2)), (both.after, AFTER, (None, None))):
        ahead, back = force(grid), -force(-grid)
        x, factor = grid * scales.speed.factor, scales.torque.factor
        axes.plot(x, ahead * factor, color=colour, dashes=dashes, lw=1.8)
        if np.max(np.abs(ahead - back)) > APART * np.max(np.abs(ahead)):
            axes.plot(x, back * factor, color=colour, ls=(0, (1, 1.2)), lw=1.8)
            apart = True
    return apart


def _markers(
    axes: "Axes", force: Force, side: Samples, sign: float, mark: tuple[str, str], edges: Array, scales: Scales
) -> None:
    """Draw the mean of friction in bins of speed in one direction, with its 95 % bars."""
    if side.v.size < 10:
        return
    known = np.linspace(0.0, float(np.abs(side.v).max()), 4 * POINTS)[1:]
    own = np.interp(np.abs(side.v), known, sign * force(sign * known))
    measured: Curve = over_speed(np.abs(side.v), own + sign * side.after, edges)
    style: Style = {"ls": "", "marker": mark[0], "ms": 7, "mfc": mark[1], "color": MEASURED, "elinewidth": 1.4}
    factor = scales.torque.factor
    axes.errorbar(measured.x * scales.speed.factor, measured.mean * factor, measured.half * factor, zorder=4, **style)
