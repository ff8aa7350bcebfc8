"""Is the rest noise? If not, what does it depend on? No name is attached.

Two questions, two measures of what the chosen structure leaves in clear motion:

- Is it large? Its slow part (means over `CELL` seconds), relative to the friction torque. Friction that is not quite
  the law's, a level that wanders, coloured noise: all that stays small. Nothing is compared between recordings, so a
  push that comes once is seen as well as one that always comes. The held-out recording is asked the same: what grew
  only there, as a warm-up can, is missing as well.
- What does it follow? A dictionary of recorded quantities predicts it on recordings that were not used for the fit.
  What follows none of them comes and goes with time, as a push or as a friction level.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.diagnosis.claim import least_speed
from cosim.diagnosis.dictionary import Term, dictionary
from cosim.diagnosis.evidence import Index
from cosim.diagnosis.fit import Fit
from cosim.diagnosis.prepare import Array, Prepared
from cosim.diagnosis.protocol import residuals
from cosim.diagnosis.structure import Bench, projected

LARGE = 0.07
"""Share of the friction torque above which the rest is unexplained.

From generated cases: 40 nulls (a level that wanders by up to 4 %, coloured noise of up to 3 %, slip blocks) left at
most 0.044, in the middle 0.019; 40 cases with an effect outside the list 0.093 and more, in the middle 0.25.
"""
LARGE_THERE = 0.1
"""The same on the held-out recording, to which no number was fitted.

24 nulls left at most 0.043, 40 right structures 0.076, five warm-ups that training hardly showed 0.195 and more.
"""
CELL = 0.25
"""Seconds over which the rest is averaged: noise and presliding go, what lasts stays."""
LEAST_FRICTION = 0.1
"""Where friction is less than this share of the torque, that share of the torque stands for it."""
FOLLOWS = 0.3
"""Share of the rest that a quantity must predict on recordings it was not fitted to ..."""
BESIDE = 0.7
"""... and beside the best one: this share of what that predicts."""
KNOT = 1.0
"""Seconds between the knots of a torque, or a friction level, that is free over time."""


@dataclass(frozen=True)
class Rest:
    """What a structure leaves: its size, how much of it follows each quantity, and how it goes over time."""

    share: float
    """Slow part of the rest in clear motion, relative to the friction torque (RMS)."""
    follows: dict[str, float]
    """Share of the rest that each quantity predicts on recordings it was not fitted to."""
    over_time: str
    """"time" (a push) or "friction level over time": what explains it better where nothing else does."""
    large: float = LARGE
    """Share above which something is missing."""

    @property
    def unexplained(self) -> bool:
        """Whether something is missing."""
        return self.share > self.large

    @property
    def follows_something(self) -> bool:
        """Whether what is missing follows a quantity from recording to recording."""
        return self.unexplained and max(self.follows.values(), default=0.0) > FOLLOWS

    @property
    def depends_on(self) -> tuple[str, ...]:
        """What an unexplained rest goes with, strongest first; () if there is nothing to explain."""
        if not self.unexplained:
            return ()
        least = max(FOLLOWS, BESIDE * max(self.follows.values(), default=0.0))
        named = [name for name, share in self.follows.items() if share > least]
        return tuple(sorted(named, key=lambda name: -self.follows[name])) or (self.over_time,)


def rest_of(chosen: Fit, prepared: Prepared, bench: Bench) -> Rest:
    """Measure the residual of a structure, and on what it depends."""
    clear = bench.weight * _clear(prepared)
    share = _share(chosen, clear, prepared, bench)
    if not share > LARGE:
        return Rest(share, {}, "time")
    folds = bench.blocks.folds
    follows = {name: _predicted(chosen, term, clear, folds) for name, term in dictionary(prepared).items()}
    return Rest(share, follows, _over_time(chosen.residual * clear, bench.nuisances.level * clear, prepared))


def rest_there(chosen: Fit, prepared: Prepared, bench: Bench, there: Prepared) -> Rest:
    """Measure what a structure leaves of recordings that it was not fitted to, by the friction of those it was."""
    left = zip(residuals(there, chosen.mount), there.pieces, strict=True)
    rest, clear = np.concatenate([one[piece.kept] for one, piece in left]), _clear(there)
    share = _slow(rest, clear, there) / _friction(bench, bench.weight * _clear(prepared), prepared)
    return Rest(share, {}, _over_time(rest * clear, np.sign(there.stacked("v")) * clear, there), LARGE_THERE)


def share_left(chosen: Fit, prepared: Prepared, bench: Bench) -> float:
    """Slow part of what a structure leaves in clear motion, relative to the friction torque (RMS)."""
    return _share(chosen, bench.weight * _clear(prepared), prepared, bench)


def _share(chosen: Fit, clear: Array, prepared: Prepared, bench: Bench) -> float:
    return _slow(chosen.residual, clear, prepared) / _friction(bench, clear, prepared)


def _clear(prepared: Prepared) -> Array:
    v = prepared.stacked("v")
    return np.asarray(np.abs(v) > least_speed(v), float)


def _friction(bench: Bench, clear: Array, prepared: Prepared) -> float:
    """RMS of the friction torque in clear motion."""
    level, torque = (_rms(one, clear) for one in (bench.nuisances.level, prepared.stacked("tau")))
    return max(level, LEAST_FRICTION * torque, 1e-300)


def _rms(values: Array, weight: Array) -> float:
    return float(np.sqrt((weight @ values**2) / max(weight.sum(), 1e-300)))


def _slow(values: Array, weight: Array, prepared: Prepared) -> float:
    """RMS of the means over cells of `CELL` seconds."""
    number = np.concatenate([np.full(len(piece.kept), k) for k, piece in enumerate(prepared.pieces)])
    time = np.floor(prepared.stacked("t") / CELL)
    _, cell = np.unique(np.column_stack([number, time]), axis=0, return_inverse=True)
    count, total = (np.bincount(cell.ravel(), one) for one in (weight, weight * values))
    return _rms(total / np.maximum(count, 1e-300), np.asarray(count, float))


def _predicted(chosen: Fit, term: Term, weight: Array, folds: Sequence[Index]) -> float:
    """Share of the rest of each fold that a term fitted to the others predicts, beside what is free in each fold.

    Free are the structure's own parameters, and what the term must go beyond.
    """
    known = np.column_stack([chosen.slopes, term.beyond])
    base, added, rest = (one * weight[:, None] for one in (known, term.columns, chosen.residual[:, None]))
    before, after = 0.0, 0.0
    for own in folds:
        others = np.setdiff1d(np.arange(len(rest)), own)
        free = projected(np.column_stack([rest, added])[others], base[others])
        beta = np.linalg.lstsq(free[:, 1:], free[:, 0], rcond=1e-6)[0]
        left = projected(np.column_stack([rest[own, 0], rest[own, 0] - added[own] @ beta]), base[own])
        before, after = before + float(left[:, 0] @ left[:, 0]), after + float(left[:, 1] @ left[:, 1])
    return 1 - after / max(before, 1e-300)


def _over_time(rest: Array, level: Array, prepared: Prepared) -> str:
    """Which explains more: a torque that is free over time, or a friction level that is."""
    left = {"time": 0.0, "friction level over time": 0.0}
    first = 0
    for piece in prepared.pieces:
        rows = slice(first, first + len(piece.kept))
        hats, first = _hats(piece.t[piece.kept]), rows.stop
        for name, factor in zip(left, (np.abs(level), level), strict=True):
            left[name] += float(np.sum(projected(rest[rows], hats * factor[rows, None]) ** 2))
    return min(left, key=lambda name: left[name])


def _hats(t: Array) -> Array:
    """Straight lines between knots every `KNOT` seconds: (rows, knots)."""
    count = max(2, round(float(t[-1] - t[0]) / KNOT))
    place = (t - t[0]) / (t[-1] - t[0]) * count
    return np.asarray(np.maximum(0.0, 1 - np.abs(place[:, None] - np.arange(count + 1))))
