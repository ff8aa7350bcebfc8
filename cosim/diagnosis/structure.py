"""Compare structures: what each explains of recordings it was not fitted to.

A structure is a fitted mount. `Bench` holds what all comparisons of one stage share: the recordings, the blocks, the
nuisances and the whitening. Energies are per block and cross-validated, so two structures are compared block by block.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cosim.diagnosis.bank import bank
from cosim.diagnosis.candidates import Candidate, candidates, columns_of
from cosim.diagnosis.evidence import Blocks, Grams, Score, Whitening
from cosim.diagnosis.fit import Fit
from cosim.diagnosis.inverse import Inverse, stacked
from cosim.diagnosis.prepare import Array, Prepared, derivative
from pyfmi_models.effects import PeriodicFriction
from pyfmi_models.mount import Mount

WANDER = 0.02
"""Prior: the friction level wanders by this share within a recording."""
WANDER_SHAPES = 4
SHAPE_PRIOR = 0.3
"""Prior: a nuisance friction shape has this share of the friction level."""
TIMING_SHARE = 0.2
"""Prior: time stamps of torque and position agree within this share of a sample (and 0.1 ms)."""


@dataclass(frozen=True)
class Nuisances:
    """Columns that are explained away before an effect may earn something, with the variance of their priors."""

    columns: Array
    prior: Array
    speed_shapes: tuple[int, ...]
    level: Array
    """Change of torque per relative change of the friction level, at the kept rows."""


@dataclass(frozen=True)
class Bench:
    """What the comparisons of one stage share."""

    prepared: Prepared
    blocks: Blocks
    nuisances: Nuisances
    whitening: Whitening

    def energy(self, fit: Fit, shapes: bool = True) -> Array:
        """Cross-validated energy of a fitted structure in each block."""
        grams, base = self._grams(fit, [], shapes)
        return grams.energy(base)

    def covariance(self, fit: Fit) -> Array:
        """Block-robust covariance of the fitted parameters, nuisances integrated out."""
        grams, base = self._grams(fit, [], True)
        count = len(fit.free)
        return grams.covariance(base)[:count, :count]

    def screen(self, fit: Fit, groups: Sequence[Array], excluded: Sequence[bool]) -> list[Score]:
        """Score groups of further columns, one at a time."""
        grams, _ = self._grams(fit, groups, True)
        count, width = len(fit.free), self.nuisances.columns.shape[1]
        first, scores = 1 + count + width, []
        for group, without_shapes in zip(groups, excluded, strict=True):
            base = self._base(count, not without_shapes)
            scores.append(grams.score(base, range(first, first + group.shape[1])))
            first += group.shape[1]
        return scores

    def _base(self, count: int, shapes: bool) -> list[int]:
        skipped = () if shapes else self.nuisances.speed_shapes
        extra = [k for k in range(self.nuisances.columns.shape[1]) if k not in skipped]
        return [*range(1, 1 + count), *(1 + count + k for k in extra)]

    def _grams(self, fit: Fit, groups: Sequence[Array], shapes: bool) -> tuple[Grams, list[int]]:
        columns = np.column_stack([fit.residual, fit.slopes, self.nuisances.columns, *groups])
        prior = np.full(columns.shape[1] - 1, np.inf)
        count = len(fit.free)
        prior[count : count + len(self.nuisances.prior)] = self.nuisances.prior
        white = self.whitening.apply(columns, self.blocks)
        return Grams(white, self._wander, self.blocks, prior), self._base(count, shapes)

    @cached_property
    def _wander(self) -> list[Array]:
        shapes = np.zeros((len(self.nuisances.level), WANDER_SHAPES))
        for rows in self.blocks.rows:
            s = np.linspace(0, 1, len(rows))[:, None]
            waves = np.hstack([np.cos(np.pi * k * s) / (1 + k) for k in range(WANDER_SHAPES)])
            shapes[rows] = WANDER * self.nuisances.level[rows][:, None] * waves
        return self.whitening.apply(shapes, self.blocks)


def nuisances(fit: Fit, prepared: Prepared, sample_time: float) -> Nuisances:
    """Make the nuisance columns of a fitted base: stop operators, speed shapes, a fraction of a sample of time."""
    level = friction_level(fit.mount, prepared)
    stops, speeds = bank(prepared)
    late = _time_slope(fit.mount, prepared)
    size = float(np.sqrt(np.mean(level**2)))
    friction = np.full(stops.shape[1] + speeds.shape[1], max((SHAPE_PRIOR * size) ** 2, 1e-30))
    timing = max(TIMING_SHARE * sample_time, 1e-4) ** 2
    shapes = tuple(range(stops.shape[1], stops.shape[1] + speeds.shape[1]))
    return Nuisances(np.column_stack([stops, speeds, late]), np.append(friction, timing), shapes, level)


def friction_level(mount: Mount, prepared: Prepared) -> Array:
    """Derivative of the needed torque by a relative change of the friction level, at the kept rows."""
    if mount.friction.key == "none":
        return np.zeros(len(prepared.recording_of))
    scaled = PeriodicFriction(cycles_per_rev=0.0, relative_amplitude=0.0, phase=0.0)
    extended = replace(mount, effects=(*mount.effects, scaled))
    name = f"{list(extended.components())[-1]}.relative_amplitude"
    return stacked(Inverse(extended, (name,)), prepared.pieces, np.zeros(1))[1][:, 0]


def _time_slope(mount: Mount, prepared: Prepared) -> Array:
    inverse, none = Inverse(mount, ()), np.zeros(0)
    parts = [(piece, inverse.torque(piece, none)[0]) for piece in prepared.pieces]
    return np.concatenate([derivative(torque, piece.dt)[piece.kept] for piece, torque in parts])


def projected(target: Array, columns: Array) -> Array:
    """Return what ordinary least squares on the columns leaves of a target."""
    scale = np.sqrt((columns**2).sum(0)) + 1e-300
    beta: Array = np.linalg.lstsq(columns / scale, target, rcond=1e-8)[0]
    return np.asarray(target - (columns / scale) @ beta)


@dataclass(frozen=True)
class Screening:
    """The best member of each effect, with its linear score, strongest first; and the bench they were scored on."""

    bench: Bench
    best: tuple[tuple[Candidate, Score], ...]


def screen(fit: Fit, prepared: Prepared, blocks: Blocks, nuisance: Nuisances) -> Screening:
    """Score every candidate beside a fitted structure.

    The whitening is estimated twice: the second time on what the structure plus the best member of *every* effect
    leaves, else the noise model would swallow slow effects.
    """
    known = np.column_stack([fit.slopes, nuisance.columns])
    rest = projected(fit.residual, known)
    tried = candidates(fit.mount, prepared, rest, np.abs(nuisance.level))
    groups = columns_of(fit.mount, tried, prepared, fit.values)
    excluded = [candidate.shapes_excluded for candidate in tried]
    bench = Bench(prepared, blocks, nuisance, Whitening.of(rest, blocks))
    first = _best(tried, bench.screen(fit, groups, excluded))
    everything = np.column_stack([known, *(groups[index] for index in first.values())])
    bench = replace(bench, whitening=Whitening.of(projected(fit.residual, everything), blocks))
    scores = bench.screen(fit, groups, excluded)
    best = sorted(_best(tried, scores).values(), key=lambda index: -scores[index].gain)
    return Screening(bench, tuple((tried[index], scores[index]) for index in best))


def _best(tried: Sequence[Candidate], scores: Sequence[Score]) -> dict[str, int]:
    best: dict[str, int] = {}
    for index, (candidate, score) in enumerate(zip(tried, scores, strict=True)):
        if candidate.effect not in best or score.gain > scores[best[candidate.effect]].gain:
            best[candidate.effect] = index
    return best
