"""The torque of one effect over position: the effect as the improved model holds it, and what was measured of it.

Measured is the effect's own torque plus what the improved model leaves there: inertia, friction and all other effects
are taken out (a partial residual; Larsen and McCleary, Technometrics 14 (1972) 781). What the refitted card leaves
holds the other effects too, and crosses itself where these differ between passes.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from cosim.diagnosis.answer.result import Array, Diagnosis, Finding
from cosim.diagnosis.effects import named
from cosim.diagnosis.measure.breakdown import Samples, curve, slow
from cosim.plots.quantities import ANGLE, LENGTH, handy
from cosim.plots.style import AFTER, GREY, MEASURED
from cosim.report.figures_effect import blank
from cosim.report.figures_friction import effect_of, law_with
from cosim.report.quantities import Scales
from cosim.report.sheet import Picture, degrees, heading
from cosim.report.words import lowered
from pyfmi_models.friction import Frictionless
from pyfmi_models.mount import Axis, Mount

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Torque = Callable[[Array, Array], Array]
"""Torque [N m, N] over position [rad, m] and speed [rad/s, m/s], each of shape (rows,)."""
MOST_ROWS, LEAST_ROWS, BINS = 20_000, 200, 30
VIEWS = ("position", "one pitch", "slow and fast")


def own_torque(finding: Finding, diagnosis: Diagnosis) -> Torque | None:
    """Return the torque of a finding with the numbers found; None where it is no function of position and speed."""
    first = effect_of(finding)
    if first is None or first.inputs() or first.states() or first.feels_inertia:
        return None
    effects = (first, *(replace(first, **harmonic) for harmonic in finding.harmonics))
    q, v = ca.SX.sym("q"), ca.SX.sym("v")
    law = law_with(diagnosis) or Frictionless()
    plain = Mount(name="own", motion=diagnosis.motion, axis=Axis(inertia=1.0), friction=law)
    without, whole = (_torque(mount, q, v) for mount in (plain, replace(plain, effects=effects)))
    if ca.is_equal(without, whole, 8):
        return None
    torque = ca.Function("own", [q, v], [whole - without])
    return lambda at, speed: np.asarray(torque.map(at.size)(at[None], speed[None])).ravel()


def _torque(mount: Mount, q: ca.SX, v: ca.SX) -> ca.SX:
    """Loads and steady friction of a mount."""
    motion = mount.at(0.0, q, v)
    this = mount.with_symbols({one.name: one.start for one in mount.parameters()}, v)
    return ca.SX(this.loads(motion) + this.level(motion) * ca.sign(v) + this.viscous(motion))


def own(finding: Finding, diagnosis: Diagnosis, chosen: Samples, scales: Scales) -> Picture | None:
    """Draw it; None where the model does not hold the effect, or it does not show over position."""
    if finding not in diagnosis.in_model or named(finding.effect).view not in VIEWS:
        return None
    torque, shown = own_torque(finding, diagnosis), chosen.where(np.abs(chosen.v) > slow(chosen.v))
    if torque is None or shown.q.size < LEAST_ROWS:
        return None
    pick = np.linspace(0, shown.q.size - 1, min(MOST_ROWS, shown.q.size)).astype(int)
    shown = Samples(*(getattr(shown, name)[pick] for name in Samples.__dataclass_fields__))
    ahead = torque(shown.q, np.abs(shown.v))
    resists = not np.allclose(torque(shown.q, -np.abs(shown.v)), ahead)
    side = np.sign(shown.v) if resists else np.ones_like(shown.v)
    model = side * torque(shown.q, shown.v) * scales.torque.factor
    measured = model + side * shown.after * scales.torque.factor
    x, edges, axis, folds = _places(finding, shown, scales)
    sheet, axes = blank(finding)
    for sign, mark, fill in ((1.0, "^", MEASURED), (-1.0, "v", "white")):
        _markers(axes, x[shown.v * sign > 0], measured[shown.v * sign > 0], edges, (mark, fill))
    line = curve(x, model, edges)
    axes.plot(line.x, line.mean, color=AFTER, lw=1.8, zorder=5)
    axes.axhline(0, color=GREY, lw=0.8, zorder=1)
    axes.locator_params(axis="y", nbins=5)
    if not folds:
        degrees(axes, scales.position.unit)
    heading(axes, f"{lowered(finding.title)} [{scales.torque.unit}]", below=axis)
    caption = f"{folds}▲ measured forward, ▽ backward, other effects taken out, bars 95 %. Line: improved model."
    return sheet.picture(f"{finding.title}, over position. {caption}", caption)


def _places(finding: Finding, shown: Samples, scales: Scales) -> tuple[Array, Array, str, str]:
    """Where the rows lie, in bins of position or, where more than one pitch was visited, within one pitch."""
    cycles = finding.parameters.get("cycles_per_rev", 0.0)
    length = scales.turn / cycles if cycles > 0 else 0.0
    if 0 < length < 0.9 * float(np.ptp(shown.q)):
        unit = handy(ANGLE if scales.turn != 1.0 else LENGTH, length)
        pitch = length * unit.factor
        axis = f"position within one pitch [{unit.unit}]"
        folds = f"All recordings folded onto one pitch of {unit.text(length, 3)}. "
        return np.mod(shown.q * unit.factor, pitch), np.linspace(0, pitch, BINS + 1), axis, folds
    x = shown.q * scales.position.factor
    return x, np.linspace(x.min(), x.max(), BINS + 1), f"position [{scales.position.unit}]", ""


def _markers(axes: "Axes", x: Array, y: Array, edges: Array, mark: tuple[str, str]) -> None:
    """Draw means in bins with their 95 % bars."""
    if x.size < LEAST_ROWS // 4:
        return
    mean = curve(x, y, edges)
    axes.errorbar(mean.x, mean.mean, yerr=mean.half, ls="", marker=mark[0], ms=5, mfc=mark[1], color=MEASURED,
                  elinewidth=1.0, mew=0.8, zorder=4)  # fmt: skip
