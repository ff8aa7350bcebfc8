"""Predictive likelihood: the same evidence on recordings to which nothing was fitted.

No parameter is fitted there; only the nuisances are free (what friction laws cannot agree on, a wandering level, and
how far the base's own numbers are from those of training), with sizes and noise estimated as in training. So a gain
here is one of prediction, in the same unit, with nothing to be priced.

Friction and load are not the same on two days, and what training cannot tell of the base shows in another motion. Both
are common to a model with an effect and without it, and far larger than many an effect: they must not decide.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from cosim.diagnosis.decide.policy import Policy
from cosim.diagnosis.evidence.bands import Bands, OnBands, joined, reading_torque
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.discrepancy import Discrepancy, Shapes, discrepancy
from cosim.diagnosis.evidence.marginal import marginal
from cosim.diagnosis.evidence.structure import Structure, structure_of
from cosim.estimation.blocks import Blocks
from cosim.estimation.fit import Fit
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.problem import Problem
from cosim.estimation.residuals import gets_memory, inside, kept, removed_at_rest
from cosim.estimation.row_weights import least_speed, weights
from cosim.support.statistics import bootstrap_range
from pyfmi_models.mount import Mount

NOISY = 3.0
"""Growth of the error from the band of the analysis to the protocol's from which that says nothing of the model."""
BLOCK_SECONDS = 1.0
AMPLIFIED = 2.0
"""Growth of the protocol's energy from which a model amplifies noise, which it may only if it halves the error that is
no noise."""
BASE = "base"
"""Name of the nuisances that are the base's own numbers, the last ones."""
LEAST_BEYOND = 0.1
"""Share of an energy that is never put down to noise."""


class Weighed(NamedTuple):
    """Log-likelihood of a structure on held-out recordings, and what it leaves in each block of time, both in nats."""

    log_likelihood: float
    by_block: Array


@dataclass(frozen=True, eq=False)
class Predictive(OnBands):
    """Held-out recordings, prepared in the band of the analysis, and how they are weighed."""

    prepared: Prepared
    weight: Array
    bands: Bands
    nuisances: Discrepancy
    floor: Array
    halved: float
    protocol: Prepared
    """The same recordings in the band of the protocol, whose error is what is printed."""
    training: Problem
    base: tuple[str, ...]
    """Names of the base's fitted numbers."""

    @classmethod
    def of(cls, comparison: Comparison, prepared: Prepared, base: Fit, protocol: Prepared) -> "Predictive":
        """Weigh held-out rows as the training rows are."""
        weight = weights(base.mount.friction, prepared)
        scale = comparison.noise.at(prepared.stacked("v"))
        bands = Bands.of(prepared, weight, scale, comparison.policy)
        policy, problem = comparison.policy, comparison.problem
        floor = bands.least_noise(prepared, comparison.inertia, policy)
        nuisances = _moved(discrepancy(base.mount, prepared, policy), base, prepared, policy)
        return cls(prepared, weight, bands, nuisances, floor, policy.half, protocol, problem, base.free)

    def as_delivered(self) -> "Predictive":
        """The same with the base's numbers as they are: what is delivered as a model must predict with them."""
        rest = tuple(one for one in self.nuisances.groups if one.name != BASE)
        columns = self.nuisances.columns[:, : sum(len(one.columns) for one in rest)]
        return replace(self, nuisances=replace(self.nuisances, columns=columns, groups=rest))

    def residual(self, mount: Mount) -> Array:
        """Measured minus model torque at the kept rows."""
        return kept(self.prepared, mount)

    def slopes(self, found: Fit | Structure) -> Array:
        """Derivatives of the needed torque by the fitted numbers of a structure, at the kept rows."""
        return stacked(Inverse(found.mount, found.free), self.prepared.pieces, found.values)[1]

    def predicted(self, found: Fit) -> float:
        """Log-likelihood of a structure fitted to training, what that leaves open of its effects integrated out."""
        if found not in self._predicted:
            self._predicted[found] = self.weighed(structure_of(self.training, found)).log_likelihood
        return self._predicted[found]

    @cached_property
    def _predicted(self) -> WeakKeyDictionary[Fit, float]:
        return WeakKeyDictionary()

    def weighed(self, found: Structure) -> "Weighed":
        """Log-likelihood of a structure, what training leaves open of its effects integrated out, and its blocks."""
        own = [k for k, name in enumerate(found.free) if name not in self.base]
        return self._weighed(self.residual(found.mount), self.left_open(found, own))

    def left_open(self, found: Structure, which: Sequence[int]) -> Array:
        """Torque of what training leaves open of some fitted numbers: columns (rows, n) of amounts of one error."""
        return np.asarray(self.slopes(found)[:, which] @ found.directions(which))

    def moved(self, found: Fit) -> Array:
        """Torque of all that may be otherwise there: what training leaves open, and the base's numbers themselves."""
        base = next((group for group in self.nuisances.groups if group.name == BASE), None)
        own = self.nuisances.columns[:, base.columns] * base.prior if base else np.empty((len(self.weight), 0))
        return np.column_stack([self.left_open(structure_of(self.training, found), range(len(found.free))), own])

    def likelihood_of(self, mount: Mount) -> float:
        """Log-likelihood of a model as it is, nuisances integrated out."""
        residual = self.residual(mount)
        return self._weighed(residual, np.empty((len(residual), 0))).log_likelihood

    def _weighed(self, residual: Array, open_: Array) -> "Weighed":
        """`open_` are columns (rows, n) of which a standard normal amount may be in the residual at the kept rows."""
        columns = np.column_stack([residual, open_])
        target = self.bands.transform(columns)
        cross = self.bands.crossed(target, self._nuisances)
        grams = joined(self.bands.grams(target), cross, self._nuisance_grams)
        first = columns.shape[1] - 1
        groups, free = self.nuisances.groups_at(first), np.ones(grams.shape[1] - 1)
        found = marginal(grams, free, groups, self.bands.count, self.bands.effective, self.floor)
        left = target[:, 0] - target[:, 1:] @ found.beta[:first] - self._nuisances @ found.beta[first:]
        by_block = self.bands.energy_by_block(left, found.noise, Blocks.of(self.prepared))
        return Weighed(found.log_likelihood, by_block)

    def plain_gains(self, without: Mount, mount: Mount) -> tuple[float, float]:
        """Share of the plain residual energy that a model removes, in the bands of the analysis and of the protocol.

        The wider band comes last.

        What the noise of the reading gives to a model's torque is no error of it: a base whose inertia is nothing has
        none of that. Where the protocol's band still holds mostly noise, which the model does not amplify, it says
        nothing: then both are that of the analysis.
        """
        share = float(np.mean(self.weight**2))
        narrow = [
            _beyond(float(np.mean((self.weight * self.residual(one)) ** 2)), share * reading_noise(self.prepared, one))
            for one in (without, mount)
        ]
        wide = [_beyond(self._protocol_energy(one), reading_noise(self.protocol, one)) for one in (without, mount)]
        amplified = wide[1] > AMPLIFIED * wide[0] and narrow[1] > (1 - self.halved) * narrow[0]
        pairs = (narrow, narrow if is_noise(narrow, wide) and not amplified else wide)
        first, second = (1 - after / max(before, 1e-300) for before, after in pairs)
        return (first, second) if self.prepared.cutoff <= self.protocol.cutoff else (second, first)

    def in_motion(self, without: Mount, mount: Mount) -> float:
        """Share of the plain residual energy in clear motion that a model removes, in the band of the analysis."""
        v = self.prepared.stacked("v")
        clear = np.abs(v) > least_speed(v)
        before, after = (float(np.mean(self.residual(one)[clear] ** 2)) for one in (without, mount))
        return 1 - after / max(before, 1e-300)

    def at_rest(self, without: Mount, mount: Mount) -> float:
        """Share of the plain residual energy that a model with memory removes where one without is silent, else 0."""
        if not gets_memory(mount, without) or self.weight.all():
            return 0.0
        return removed_at_rest(self.weight, self.residual(mount), self.residual(without))

    def _protocol_energy(self, mount: Mount) -> float:
        return float(np.mean(inside(self.protocol, mount) ** 2))


def _moved(others: Discrepancy, base: Fit, prepared: Prepared, policy: Policy) -> Discrepancy:
    """Nuisances with the base's numbers beside the others, each in units of its own size."""
    own = stacked(Inverse(base.mount, base.free), prepared.pieces, base.values)[1] * base.values
    own = own[:, np.abs(own).max(axis=0, initial=0.0) > 0]
    first = others.columns.shape[1]
    moved = Shapes(tuple(range(first, first + own.shape[1])), policy.misfit, BASE)
    groups = (*others.groups, moved) if own.shape[1] else others.groups
    return replace(others, columns=np.column_stack([others.columns, own]), groups=groups)


def reading_noise(prepared: Prepared, mount: Mount) -> float:
    """Mean square that white noise of the reading, differentiated, has in the torque that a mount needs [N2 m2].

    Of a density D it is the integral of 2 (J w^2 g^2 D)^2 over frequency, g the gain of one pass of the filter.
    """
    total, rows, inertia = 0.0, 0, float(mount.axis.inertia)
    for piece in prepared.pieces:
        hertz = np.linspace(0.0, 0.5 / piece.dt, 500)
        density = reading_torque(hertz, prepared, inertia) * piece.reading_noise
        total += len(piece.t) * float(np.trapezoid(2 * density**2, hertz))
        rows += len(piece.t)
    return total / max(rows, 1)


def _beyond(energy: float, noise: float) -> float:
    """What is left of an energy beside noise, which is only assumed to be white."""
    return max(float(energy) - noise, LEAST_BEYOND * float(energy))


def is_noise(narrow: Sequence[float], wide: Sequence[float]) -> bool:
    """Whether of any model's error energy most lies above the band of the analysis: noise of the reading, a late clock.

    Args:
        narrow: mean squares in the band of the analysis, one a model.
        wide: the same in the protocol's band.
    """
    return any(after > NOISY**2 * before for before, after in zip(narrow, wide, strict=True))


def interval_of(before: Array, after: Array, dt: float) -> tuple[float, float]:
    """95 % range of the difference of RMS values, from a bootstrap of blocks of `BLOCK_SECONDS`."""
    count = max(2, int(len(before) * dt / BLOCK_SECONDS))
    squares = np.array([[np.mean(x**2) for x in np.array_split(one, count)] for one in (before, after)])
    return bootstrap_range(
        lambda drawn: np.asarray(np.sqrt(squares[0][drawn].mean(1)) - np.sqrt(squares[1][drawn].mean(1))),
        count,
    )
