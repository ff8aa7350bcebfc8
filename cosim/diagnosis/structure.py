"""Compare structures: what each explains of recordings it was not fitted to.

A structure is a fitted mount. `Bench` holds what all comparisons of one stage share: the recordings, the blocks, the
nuisances and the whitening. Energies are per block and cross-validated, so two structures are compared block by block.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import Any

import numpy as np

from cosim.diagnosis.bank import bank
from cosim.diagnosis.candidates import ROOM, Candidate, Room, columns_of
from cosim.diagnosis.evidence import Blocks, Score, Whitening
from cosim.diagnosis.families import candidates
from cosim.diagnosis.fit import BRISTLES, FIXED, Fit, fit
from cosim.diagnosis.grams import Grams
from cosim.diagnosis.inverse import Inverse, stacked
from cosim.diagnosis.prepare import Array, Prepared
from pyfmi_models.effects import Effect, FrictionEffect, PeriodicFriction
from pyfmi_models.mount import Mount

WANDER = 0.02
"""Prior: the friction level wanders by this share within a recording."""
WANDER_SHAPES = 4
LINEAR = (".Fc", ".sigma2", ".positive", ".negative")
"""Endings of the parameters of friction whose tangents hold however far they move."""
SHAPE_PRIOR = 0.3
"""Prior: a nuisance friction shape has this share of the friction level."""


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
    weight: Array
    """Weight of each kept row; rows of weight 0 do not count."""
    crossed: dict[int, tuple[Fit, Array]] = field(default_factory=dict, repr=False, compare=False)
    """Residuals of structures that were judged already, with the structure, so that its id stays its own."""

    def energy(self, found: Fit, room: Room = "") -> Array:
        """Cross-validated energy of a structure in each block: refitted without a fold, judged on it.

        What the nuisances can explain of a fold is taken off; those that are an effect in question make `room`.
        """
        grams = self._grams(replace(found, residual=self.left_out(found)), [])
        return grams.energy([], self._others(found, room))

    def left_out(self, found: Fit) -> Array:
        """Residual of each fold by the structure refitted without it; once for each structure."""
        if id(found) in self.crossed:
            return self.crossed[id(found)][1]
        residual = np.empty_like(found.residual)
        for rows, untold in zip(self.blocks.folds, self._untold(found), strict=True):
            without = self.weight.copy()
            without[rows] = 0.0
            # The bristles stay: a fold that never dwells would send them anywhere, and the judgement with them.
            fixed = (*FIXED, *BRISTLES, *untold)
            refit = fit(found.mount, self.prepared.pieces, without, evaluations=4, fixed=fixed)
            residual[rows] = refit.residual[rows]
        self.crossed[id(found)] = found, residual
        return residual

    def _untold(self, found: Fit) -> list[list[str]]:
        """Parameters of effects that the other folds do not tell, of each fold: they would go anywhere as well.

        Effects of friction must be foretold nevertheless: what an imprecise law leaves of rests and reversals may be in
        one recording alone as well, and looks like them.
        """
        parts = found.mount.components()
        names = [name for name in found.free if _is_no_friction(parts[name.split(".")[0]])]
        slopes = found.slopes[:, [found.free.index(name) for name in names]] * self.weight[:, None]
        return [[name for name, is_so in zip(names, row, strict=True) if is_so] for row in self.blocks.untold(slopes)]

    def foretold(self, found: Fit, without: Fit) -> float:
        """Share of the plain residual energy of a fold that a structure foretells, the least of all folds."""
        left, before = (self.weight * self.left_out(one) for one in (found, without))
        energies = [(left[rows] @ left[rows], before[rows] @ before[rows]) for rows in self.blocks.folds]
        return min(float(1 - after / (whole + 1e-300)) for after, whole in energies)

    @property
    def rows(self) -> Array:
        """Rows of each block that count."""
        return np.array([float(np.sum(self.weight[rows] > 0)) for rows in self.blocks.rows])

    def screen(
        self, found: Fit, candidates: Sequence[Candidate], groups: Sequence[Array], known: Collection[int] = ()
    ) -> list[tuple[Score, Array]]:
        """Score the columns of candidates, one group at a time; return scores and the coefficients of the group.

        Each fold is predicted from the others, but `known` ones, and those of which the others cannot tell, from all.
        """
        grams, base = self._grams(found, groups), range(1, 1 + len(found.free))
        first, scores = 1 + len(found.free) + self.nuisances.columns.shape[1], []
        before = cache(lambda room, untold: grams.energy(base, self._others(found, room), untold))
        for candidate, group in zip(candidates, groups, strict=True):
            room = ROOM.get(candidate.effect, "")
            chosen, used = [*base, *range(first, first + group.shape[1])], self._others(found, room)
            alone = self.blocks.untold(group * self.weight[:, None]).all(1) & _is_no_friction(candidate.instances[0])
            untold = (*known, *np.flatnonzero(alone).tolist())
            score = Score(before(room, untold), grams.energy(chosen, used, untold), grams.rows)
            scores.append((score, grams.fit(chosen, used)[len(base) :]))
            first += group.shape[1]
        return scores

    def _others(self, found: Fit, room: Room) -> list[int]:
        """Columns of the nuisances that stay when some make room."""
        width, first = self.nuisances.columns.shape[1], 1 + len(found.free)
        speeds = self.nuisances.speed_shapes
        gone = {"": (), "speeds": speeds, "stops": tuple(k for k in range(width) if k not in speeds)}[room]
        return [first + k for k in range(width) if k not in gone]

    def _grams(self, found: Fit, groups: Sequence[Array]) -> Grams:
        columns = np.column_stack([found.residual, found.slopes, self.nuisances.columns, *groups])
        prior, count = np.full(columns.shape[1] - 1, np.inf), len(found.free)
        prior[:count] = [_trust(name, value) ** 2 for name, value in zip(found.free, found.values, strict=True)]
        prior[count : count + len(self.nuisances.prior)] = self.nuisances.prior
        nuisance = range(1 + count, 1 + count + len(self.nuisances.prior))
        return Grams(self._white(columns), self._wander, self.blocks, prior, nuisance)

    @cached_property
    def _wander(self) -> list[Array]:
        shapes = np.zeros((len(self.nuisances.level), WANDER_SHAPES))
        for rows in self.blocks.rows:
            s = np.linspace(0, 1, len(rows))[:, None]
            waves = np.hstack([np.cos(np.pi * k * s) / (1 + k) for k in range(WANDER_SHAPES)])
            shapes[rows] = WANDER * self.nuisances.level[rows][:, None] * waves
        return self._white(shapes)

    def _white(self, columns: Array) -> list[Array]:
        white = self.whitening.apply(columns, self.blocks)
        return [one * self.weight[r, None] for one, r in zip(white, self.blocks.rows, strict=True)]


def _is_no_friction(part: Any) -> bool:
    return isinstance(part, Effect) and not isinstance(part, FrictionEffect)


def _trust(name: str, value: float) -> float:
    """How far a parameter may move from its fit before its tangent says nothing more (one standard deviation)."""
    if name.endswith("phase"):
        return 1.0
    return (0.1 if name.startswith("friction.") and not name.endswith(LINEAR) else 1.0) * max(abs(value), 1e-12)


def nuisances(found: Fit, prepared: Prepared) -> Nuisances:
    """Make the nuisance columns of a fitted base: stop operators and speed shapes."""
    level = friction_level(found.mount, prepared)
    stops, speeds = bank(prepared)
    # A shape is what a law lacks beyond its level: where motion never turns, stops are nothing but level.
    stops = stops - np.outer(level, level @ stops / max(float(level @ level), 1e-300))
    size = float(np.sqrt(np.mean(level**2)))
    friction = np.full(stops.shape[1] + speeds.shape[1], max((SHAPE_PRIOR * size) ** 2, 1e-30))
    shapes = tuple(range(stops.shape[1], stops.shape[1] + speeds.shape[1]))
    return Nuisances(np.column_stack([stops, speeds]), friction, shapes, level)


def friction_level(mount: Mount, prepared: Prepared) -> Array:
    """Derivative of the needed torque by a relative change of the friction level, at the kept rows."""
    if mount.friction.key == "none":
        return np.zeros(len(prepared.recording_of))
    scaled = PeriodicFriction(cycles_per_rev=0.0, relative_amplitude=0.0, phase=0.0)
    extended = replace(mount, effects=(*mount.effects, scaled))
    name = f"{list(extended.components())[-1]}.relative_amplitude"
    return stacked(Inverse(extended, (name,)), prepared.pieces, np.zeros(1))[1][:, 0]


def projected(target: Array, columns: Array) -> Array:
    """Return what ordinary least squares on the columns leaves of a target."""
    scale = np.sqrt((columns**2).sum(0))
    unit = columns / np.where(scale > 0, scale, 1.0)
    normal = unit.T @ unit + 1e-9 * np.eye(len(scale))
    return np.asarray(target - unit @ np.linalg.solve(normal, unit.T @ target))


Scored = tuple[tuple[Candidate, Score, Array], ...]


@dataclass(frozen=True)
class Screening:
    """The best member of each form of an effect, with its linear score, strongest first; and their bench."""

    bench: Bench
    best: Scored
    tried: Sequence[Candidate] = ()
    groups: Sequence[Array] = ()

    def explaining(self, found: Fit) -> Scored:
        """The same by what they explain of the very recordings that they are fitted to."""
        everywhere = range(len(self.bench.blocks.folds))
        return _ranked(self.tried, self.bench.screen(found, self.tried, self.groups, everywhere))


def screen(found: Fit, prepared: Prepared, blocks: Blocks, nuisance: Nuisances, weight: Array) -> Screening:
    """Score every candidate beside a fitted structure.

    The whitening is estimated twice: the second time on what the structure plus the best member of *every* effect
    leaves, else the noise model would swallow slow effects.
    """
    known, speed = np.column_stack([found.slopes, nuisance.columns]), prepared.stacked("v")
    counted = weight[:, None] > 0
    residual = found.residual * counted[:, 0]
    rest = projected(residual, known * counted)
    tried = candidates(found.mount, prepared, rest, np.abs(nuisance.level))
    groups = columns_of(found.mount, tried, prepared, found.values)
    bench = Bench(prepared, blocks, nuisance, Whitening.of(rest, blocks, speed), weight)
    first = _best(tried, bench.screen(found, tried, groups))
    everything = np.column_stack([known, *(groups[index] for index in first.values())])
    bench = replace(bench, whitening=Whitening.of(projected(residual, everything * counted), blocks, speed))
    return Screening(bench, _ranked(tried, bench.screen(found, tried, groups)), tried, groups)


def _ranked(tried: Sequence[Candidate], scores: Sequence[tuple[Score, Array]]) -> Scored:
    best = sorted(_best(tried, scores).values(), key=lambda index: -scores[index][0].gain)
    return tuple((tried[index], *scores[index]) for index in best)


def _best(tried: Sequence[Candidate], scores: Sequence[tuple[Score, Array]]) -> dict[type[Effect], int]:
    """The best member of each form: a wave and one spot are the same effect, and yet no wave leads to a spot."""
    best: dict[type[Effect], int] = {}
    for index, (candidate, (score, _)) in enumerate(zip(tried, scores, strict=True)):
        form = type(candidate.instances[0])
        if form not in best or score.gain > scores[best[form]][0].gain:
            best[form] = index
    return best
