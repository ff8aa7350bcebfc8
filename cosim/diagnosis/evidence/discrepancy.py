"""What equations may miss of a machine, with the sizes that are expected: of friction laws, and of named effects.

Bristles that slip at other distances, a level that varies with speed in another way, a level that wanders in time: on
that friction laws cannot agree. These nuisances of every comparison are explained away before an effect may earn
something; how large they are is estimated from the recordings. Beside named effects a further one must earn its name:

    y = ... + sum_j f_j (sum_k u_jk phi_k),    u_jk ~ N(0, s_j^2 / K),    s_j half-normal(`Policy.misfit`)

f_j is the torque of a named effect, phi_k the K lowest cosines over position, speed, time and recording, direction too
for what resists motion: a machine is 5 to 20 % off any equation, in its own slow way, and what is off repeats in
every stroke and on every day, so that neither rows nor held-out recordings tell it from another effect. Forms of the
others only, never of the effect that is weighed: that one stands by its word.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from math import pi, sqrt

import numpy as np

from cosim.diagnosis.decide.policy import POLICY, Policy
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.evidence.marginal import Group
from cosim.estimation.discrepancy_basis import discrepancy_basis, friction_level
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.residuals import kept
from cosim.support.statistics import rms
from pyfmi_models.effects import Effect
from pyfmi_models.mount import Mount

WAVES = 5
"""Cosines over a recording that a wandering level is made of; more for few long recordings would change little."""
BENDS = 2
"""Cosines over each quantity of a named effect: one that bends it, one that bends it twice; finer ones are effects of
their own."""


@dataclass(frozen=True)
class Shapes:
    """Columns that share a size, by number, its prior, and their name."""

    columns: tuple[int, ...]
    prior: float
    name: str


@dataclass(frozen=True)
class Discrepancy:
    """Columns (rows, n) in N m per unit of relative size, their groups, and the friction level at each row."""

    columns: Array
    groups: tuple[Shapes, ...]
    level: Array

    def groups_at(self, first: int, aside: Collection[str] = ()) -> list[Group]:
        """Groups that do not stand aside, their columns one after the other from number `first` on."""
        placed = []
        for one in (group for group in self.groups if group.name not in aside):
            placed.append(Group(np.arange(first, first + len(one.columns)), one.prior))
            first += len(one.columns)
        return placed


def discrepancy(mount: Mount, prepared: Prepared, policy: Policy) -> Discrepancy:
    """Make the nuisance columns beside a base."""
    level = friction_level(mount, prepared)
    size = rms(level)
    stops, speeds = discrepancy_basis(prepared)
    # Where motion never turns, stops are nothing but level.
    stops = stops - np.outer(level, level @ stops / max(float(level @ level), 1e-300))
    wander = _wander(level, prepared, policy)
    columns = np.column_stack([size * stops, size * speeds, wander])
    if size <= 0:  # without friction there is nothing that laws could disagree on
        return Discrepancy(columns[:, :0], (), level)
    edges = np.cumsum([0, stops.shape[1], speeds.shape[1], wander.shape[1]])
    priors = (policy.misfit, policy.misfit, policy.wander)
    names = ("stops", "speeds", "wander")
    groups = [
        Shapes(tuple(range(first, last)), prior, name)
        for first, last, prior, name in zip(edges, edges[1:], priors, names, strict=False)
    ]
    return Discrepancy(columns, tuple(groups), level)


def _wander(level: Array, prepared: Prepared, policy: Policy) -> Array:
    """Level times cos(pi k t / T) in each recording, variance as of a first-order process."""
    columns, t = [], prepared.stacked("t")
    for one in np.unique(prepared.recording_of):
        rows = prepared.recording_of == one
        passed = t[rows] - t[rows][0]
        seconds = max(float(passed[-1]), 1e-9)
        for k in range(WAVES):
            column = np.zeros(len(level))
            spread = 1 / np.sqrt(1 + (np.pi * k / seconds * policy.wander_seconds) ** 2)
            column[rows] = level[rows] * np.cos(np.pi * k * passed / seconds) * spread
            columns.append(column)
    return np.column_stack(columns)


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
    if "position" not in hypothesis_of(effect).tables:  # of such a load it is nothing how fast it is passed
        yield from _cosines(np.abs(v))
    owner = prepared.recording_of
    yield from _cosines(np.concatenate([_along(piece.t[piece.kept]) for piece in prepared.pieces]))
    for number in range(1, int(owner.max()) + 1):
        yield sqrt(2) * (owner == number)
    power = torque * v  # drag takes it throughout, but for what a filter smears of a turn
    resists = float(-power[power < 0].sum()) <= POLICY.negligible * float(np.abs(power).sum())
    if effect.place == "Friction" or resists:
        yield np.sign(v)


def _along(t: Array) -> Array:
    """Time of each row within its piece, from 0 to 1."""
    return np.asarray((t - t[0]) / max(float(t[-1] - t[0]), 1e-9)) if len(t) else t


def _cosines(x: Array) -> Iterator[Array]:
    low, high = float(x.min()), float(x.max())
    share = (x - low) / max(high - low, 1e-300)
    yield from (sqrt(2) * np.cos(pi * k * share) for k in range(1, BENDS + 1))
