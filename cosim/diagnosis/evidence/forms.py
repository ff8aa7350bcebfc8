"""What the equations of named effects may miss, beside which a further effect must earn its name.

    y = ... + sum_j f_j (sum_k u_jk phi_k),    u_jk ~ N(0, s_j^2 / K),    s_j half-normal(`Policy.misfit`)

f_j is the torque of a named effect, phi_k the K lowest cosines over position, speed, time and recording, direction too
for what resists motion: a machine is 5 to 20 % off any equation, in its own slow way, and what is off repeats in
every stroke and on every day, so that neither rows nor held-out recordings tell it from another effect. Forms of the
others only, never of the effect that is weighed: that one stands by its word.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import pi, sqrt

import numpy as np

from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects import hypothesis_of
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.residuals import kept
from pyfmi_models.effects import Effect

WAVES = 2
"""Cosines over each quantity: one that bends it, one that bends it twice; finer ones are effects of their own."""


@dataclass(frozen=True, eq=False)
class Forms:
    """Columns (rows, n) in N m per unit of relative size, and which of them belong to one effect."""

    columns: Array
    groups: tuple[tuple[int, ...], ...]
    names: tuple[str, ...] = ()
    """The effect that each group belongs to."""

    def of(self, name: str) -> "Forms":
        """Those of one effect alone."""
        kept = self.groups[self.names.index(name)]
        return Forms(self.columns[:, kept], (tuple(range(len(kept))),), (name,))


def forms(found: Fit, own: int, prepared: Prepared) -> Forms | None:
    """The forms of the effects that a structure adds to its first `own` ones; None where it adds none."""
    mount = found.mount
    groups: dict[str, list[Effect]] = {}
    for effect in mount.effects[own:]:
        groups.setdefault(effect.name, []).append(effect)
    if not groups:
        return None
    columns, placed, first = [], [], 0
    with_all = kept(prepared, mount)
    for group in groups.values():
        rest = tuple(one for one in mount.effects if not any(one is other for other in group))
        torque = kept(prepared, replace(mount, effects=rest)) - with_all
        shapes = np.column_stack([*_shapes(group[0], torque, prepared)])
        columns.append(torque[:, None] * shapes / sqrt(shapes.shape[1]))
        placed.append(tuple(range(first, first + shapes.shape[1])))
        first += shapes.shape[1]
    return Forms(np.column_stack(columns), tuple(placed), tuple(groups))


def _shapes(effect: Effect, torque: Array, prepared: Prepared) -> Iterator[Array]:
    """The cosines of an effect of so much torque, each of unit RMS or so at the kept rows."""
    v = prepared.stacked("v")
    if prepared.has_position:
        yield from _cosines(prepared.stacked("q"))
    if not _is_load(effect):
        yield from _cosines(np.abs(v))
    owner = prepared.recording_of
    yield from _cosines(np.concatenate([_along(piece.t[piece.kept]) for piece in prepared.pieces]))
    for number in range(1, int(owner.max()) + 1):
        yield sqrt(2) * (owner == number)
    if effect.place == "Friction" or _resists(torque * v):
        yield np.sign(v)


def _resists(power: Array) -> bool:
    """Whether an effect takes power throughout, as drag does, but for what a filter smears of a turn."""
    return float(-power[power < 0].sum()) <= POLICY.negligible * float(np.abs(power).sum())


def _is_load(effect: Effect) -> bool:
    """Whether an effect is a torque of the position alone: how fast it is passed is nothing to it."""
    return "position" in hypothesis_of(effect).tables


def _along(t: Array) -> Array:
    """Time of each row within its piece, from 0 to 1."""
    return np.asarray((t - t[0]) / max(float(t[-1] - t[0]), 1e-9)) if len(t) else t


def _cosines(x: Array) -> Iterator[Array]:
    low, high = float(x.min()), float(x.max())
    share = (x - low) / max(high - low, 1e-300)
    yield from (sqrt(2) * np.cos(pi * k * share) for k in range(1, WAVES + 1))
