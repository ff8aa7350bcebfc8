"""What recordings say about one learned term: the rest that a model leaves without it, over what the term goes over.

    left = tau - needed(without the term) = f g,   g = needed(with a term of one) - needed(without)

f is the term's value, a torque or a relative change of the friction level; of the latter g is the friction itself.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cosim.diagnosis.answer.entries import BinsEntry
from cosim.diagnosis.terms.dictionary import followed
from cosim.estimation.blocks import Blocks
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Array, Prepared
from cosim.support.statistics import Z95
from pyfmi_models.effects import Effect
from pyfmi_models.effects.learned_base import FOLLOWED, LearnedEffect
from pyfmi_models.mount import Mount
from pyfmi_models.waves import INPUT

BINS, COARSE = 24, (12, 5)
"""Bins over one quantity, and over two."""
FEWEST = 8
"""Rows below which a bin says nothing."""


@dataclass(frozen=True, eq=False)
class Partial:
    """Kept rows of one term, one value a row."""

    effect: LearnedEffect
    over: Array
    """The quantity; of a term that remembers, the torque that it says."""
    by: Array | None
    left: Array
    unit: Array
    """g of the module."""
    weight: Array
    blocks: Blocks

    def data(self) -> BinsEntry:
        """Return the mean of f over bins with its 95 % band; None where a bin holds too few rows."""
        over = (self.over,) if self.by is None else (self.over, self.by)
        counts = (BINS,) if self.by is None else COARSE
        edges, places = [_edges(one, count) for one, count in zip(over, counts, strict=True)], []
        for one, edge in zip(over, edges, strict=True):
            places.append(np.clip(np.searchsorted(edge, one, "right") - 1, 0, len(edge) - 2))
        mean, half = self._means(np.ravel_multi_index(places, counts), int(np.prod(counts)))
        value, band = (_listed(one.reshape(counts)) for one in (mean, half))
        at, *by_at = [((edge[1:] + edge[:-1]) / 2).tolist() for edge in edges]
        entry: BinsEntry = {"at": at, "value": value, "band": band}
        return {**entry, "by_at": by_at[0]} if by_at else entry

    def _means(self, cell: Any, many: int) -> tuple[Array, Array]:
        """Weighted mean of each cell, and its half band from what blocks of rows differ by."""
        weight = self.weight**2
        power, rows = np.bincount(cell, weight * self.unit**2, many), np.bincount(cell, minlength=many)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = np.bincount(cell, weight * self.unit * self.left, many) / power
            mean[(rows < FEWEST) | (power <= 1e-9 * power.max())] = np.nan
        score = weight * self.unit * (self.left - self.unit * np.nan_to_num(mean)[cell])
        sums = np.array([np.bincount(cell[own], score[own], many) for own in self.blocks.rows])
        return mean, np.asarray(Z95 * np.sqrt((sums**2).sum(0)) / np.maximum(power, 1e-300))


def partial(mount: Mount, effect: LearnedEffect, prepared: Prepared, weight: Array) -> Partial:
    """Rows of one learned effect of a mount, beside all its others."""
    bare, one = without(mount, effect), effect.of_one()
    base = needed(bare, prepared)
    added = needed(replace(bare, effects=(*bare.effects, one or effect)), prepared) - base
    over, *by = [_quantity(name, mount, prepared) for name in effect.quantities()] or [added]
    unit = added if one else np.ones_like(added)
    left, blocks = prepared.stacked("tau") - base, Blocks.of(prepared)
    return Partial(effect, over, by[0] if by else None, left, unit, weight, blocks)


def without(mount: Mount, effect: Effect) -> Mount:
    """The mount without one of its effects."""
    return replace(mount, effects=tuple(one for one in mount.effects if one is not effect))


def needed(mount: Mount, prepared: Prepared) -> Array:
    """Torque that a mount needs at the kept rows."""
    return stacked(Inverse(mount, ()), prepared.pieces, np.zeros(0))[0]


def _quantity(name: str, mount: Mount, prepared: Prepared) -> Array:
    """A quantity at the kept rows.

    The command is that which the model needs: over the recorded one, which holds what is left, anything goes a little.
    """
    if name == "command":
        return needed(mount, prepared)
    own = {"position": "q", "speed": "v", "turn": "q"}
    if name in own:
        found = prepared.stacked(own[name])
        return np.mod(found + np.pi, 2 * np.pi) - np.pi if name == "turn" else found
    if name in FOLLOWED:
        return np.concatenate([followed(name, piece)[piece.kept] for piece in prepared.pieces])
    return np.concatenate([piece.extras[name.removeprefix(INPUT)][piece.kept] for piece in prepared.pieces])


def _edges(values: Array, count: int) -> Array:
    low, high = float(values.min()), float(values.max())
    return np.linspace(low, high if high > low else low + 1.0, count + 1)


def _listed(values: Array) -> list[Any]:
    """Numbers of JSON, which has no NaN; a band of nothing stays a number nobody reads."""
    return [_listed(one) if one.ndim else (float(one) if np.isfinite(one) else None) for one in values]
