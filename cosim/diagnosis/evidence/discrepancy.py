"""What friction laws cannot agree on, with the sizes that are expected: nuisances of every comparison.

Bristles that slip at other distances, a level that varies with speed in another way, a level that wanders in time. They
are explained away before an effect may earn something; how large they are is estimated from the recordings.
"""

from dataclasses import dataclass

import numpy as np

from cosim.diagnosis.decide.policy import Policy
from cosim.estimation.discrepancy_basis import discrepancy_basis, friction_level
from cosim.estimation.prepare import Array, Prepared
from cosim.support.statistics import rms
from pyfmi_models.mount import Mount

WAVES = 5
"""Cosines over a recording that a wandering level is made of; more for few long recordings would change little."""


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
