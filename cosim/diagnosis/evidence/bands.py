"""Rows of recordings as cosine coefficients in frequency bands, each band with its own noise.

    Y = C (w / scale) r,     C: cosine transform of each contiguous piece (orthonormal)

What is slow and what is fast are then different rows of one regression: a wandering friction level does not hide a
resonance, and the many rows of encoder noise do not hide a weight out of balance.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.fft import dct, idct

from cosim.diagnosis.decide.policy import Policy
from cosim.diagnosis.evidence.discrepancy import Discrepancy
from cosim.estimation.blocks import Blocks
from cosim.estimation.prepare import Array, Prepared
from cosim.support.statistics import rms

SPEED_BINS = 8
LEAST_SCALE = 0.2
"""Least noise at any speed, relative to the median over speeds."""


@dataclass(frozen=True, eq=False)
class Bands:
    """Where each band lies in the transformed rows, and how many independent rows each holds."""

    slices: tuple[slice, ...]
    """Rows of each contiguous piece."""
    band: Any
    """Band of each transformed row."""
    fast: Any
    """Whether a transformed row is of fast motion."""
    gain: Array
    """Weight over noise scale at each row."""
    effective: Array
    """Independent rows of each band, coarsened."""
    count: Array
    """Transformed rows of each band that weighted rows fill."""
    of_forms: Array
    """Independent ways of each band in which an equation may be wrong, see `Policy.form_ways`."""

    @classmethod
    def of(cls, prepared: Prepared, weight: Array, scale: Array, policy: Policy) -> "Bands":
        """Set up bands.

        Means of steady recordings have a band of their own: rows at one speed say the same of a friction law, so what
        it misses there is between recordings, not between rows.
        """
        slices, band, fast, first = [], [], [], 0
        for piece in prepared.pieces:
            rows = len(piece.kept)
            slices.append(slice(first, first + rows))
            hertz = np.arange(rows) / (2 * max(rows, 1) * piece.dt * piece.stride)
            own = np.where(hertz < prepared.cutoff, 1 + np.searchsorted(policy.bands_hz, hertz, "right"), -1)
            own[:1] = 0 if piece.is_steady else own[:1]
            band.append(own)
            fast.append(hertz >= policy.fast_hz)
            first += rows
        owner = np.concatenate(band)
        names, index = np.unique(owner[owner >= 0], return_inverse=True)
        owner[owner >= 0] = index
        count = np.bincount(index, minlength=len(names)) * float(np.mean(weight > 0))
        effective, of_forms = (count / (1 + count / limit) for limit in (policy.coarsening, policy.form_ways))
        parts = (np.asarray(one, float) for one in (weight / scale, effective, count, of_forms))
        return cls(tuple(slices), owner, np.concatenate(fast), *parts)

    def transform(self, columns: Array, start: int = 0) -> Array:
        """Scale and transform columns (rows, n) of pieces, the first of which begins at row `start`.

        One piece after the other: of long recordings columns are what takes the memory.
        """
        out = np.empty(columns.shape)
        for part in self.slices:
            if start <= part.start and part.stop <= start + len(columns):
                own, gain = slice(part.start - start, part.stop - start), self.gain[part, None]
                out[own] = dct(columns[own] * gain, axis=0, norm="ortho", overwrite_x=True)
        return out

    def energy_by_block(self, transformed: Array, noise: Array, blocks: Blocks) -> Array:
        """Energy of one transformed column in each block of time, in nats: half its square over the noise, coarsened.

        Args:
            transformed: the column (rows,), as `transform` makes it.
            noise: noise variance of each band.
            blocks: of the rows before they were transformed.
        """
        weight = np.append(self.effective / np.maximum(self.count, 1e-300) / noise, 0.0)  # the last: above all bands
        scaled = transformed * np.sqrt(weight[self.band])
        over_time = np.concatenate([idct(scaled[part], norm="ortho") for part in self.slices])
        return np.array([float(over_time[rows] @ over_time[rows]) / 2 for rows in blocks.rows])

    def least_noise(self, prepared: Prepared, inertia: float, policy: Policy) -> Array:
        """Least noise variance of each band: the accuracy of any model of this torque, and the reading's noise."""
        torque = self.grams(self.transform(prepared.stacked("tau")[:, None]))[:, 0, 0]
        whole = float(torque.sum() / self.count.sum())
        accuracy = policy.accuracy**2 * np.maximum(torque / self.count, 1e-4 * whole)
        return np.asarray(accuracy + self.reading_noise(prepared, inertia))

    def reading_noise(self, prepared: Prepared, inertia: float) -> Array:
        """Variance that the reading's noise, differentiated twice, has in each band: nothing below it can be told.

        A density D of white noise is a torque of J w^2 g^2 D per root hertz after both passes g of the filter.
        """
        variance = np.zeros(len(self.band))
        for piece, part in zip(prepared.pieces, self.slices, strict=True):
            step, rows = piece.dt * piece.stride, part.stop - part.start
            hertz = np.arange(rows) / (2 * max(rows, 1) * step)
            density = reading_torque(hertz, prepared, inertia) * piece.reading_noise
            variance[part] = density**2 / step * float(np.mean(self.gain[part] ** 2))
        return np.array([float(np.mean(variance[rows])) for rows in self._order])

    @cached_property
    def _order(self) -> list[Any]:
        return [np.flatnonzero(self.band == number) for number in range(len(self.count))]

    def grams(self, transformed: Array) -> Array:
        """Gram matrix of each band, (bands, n, n)."""
        parts = (transformed[rows] for rows in self._order)
        return np.array([part.T @ part for part in parts])

    def crossed(self, one: Array, other: Array) -> Array:
        """Products of two sets of columns in each band, (bands, n, m)."""
        return np.array([one[rows].T @ other[rows] for rows in self._order])


class OnBands:
    """What is compared on bands beside nuisances: these transformed, once."""

    bands: Bands
    nuisances: Discrepancy

    @cached_property
    def _nuisances(self) -> Array:
        return self.bands.transform(self.nuisances.columns)

    @cached_property
    def _nuisance_grams(self) -> Array:
        return self.bands.grams(self._nuisances)


def joined(first: Array, cross: Array, last: Array) -> Array:
    """Gram matrices of two sets of columns together, from those of each and the products of the two."""
    upper = np.concatenate([first, cross], axis=2)
    return np.concatenate([upper, np.concatenate([np.swapaxes(cross, 1, 2), last], axis=2)], axis=1)


def passed(hertz: Array, cutoff: float) -> Array:
    """What one pass of the filter, to and fro, leaves of a tone: 1 / (1 + (f / f_c)^8)."""
    return np.asarray(1 / (1 + (hertz / cutoff) ** 8))


def reading_torque(hertz: Array, prepared: Prepared, inertia: float) -> Array:
    """Torque [N m, N] that a tone of unit amplitude in the reading makes behind both passes g: J w^2 g^2, or J w g^2.

    The latter is of a speed, where only that was read.
    """
    power = 2 if prepared.has_position else 1
    return np.asarray(inertia * (2 * np.pi * hertz) ** power * passed(hertz, prepared.cutoff) ** 2)


@dataclass(frozen=True)
class NoiseOverSpeed:
    """RMS of what no model explains, at some speeds; straight lines between them."""

    speed: Array
    size: Array

    def at(self, v: Array) -> Array:
        """RMS at the speeds v."""
        return np.asarray(np.interp(np.abs(v), self.speed, self.size))


def noise_over_speed(
    residual: Array, v: Array, size: Callable[[Array], float] = rms, most: float = np.inf
) -> NoiseOverSpeed:
    """Size of a residual in bins of speed of equal count, from `LEAST_SCALE` to `most` of the median over speeds."""
    speed = np.abs(v)
    parts = [part for part in np.array_split(np.argsort(speed), SPEED_BINS) if len(part)]
    centre = np.array([float(np.median(speed[part])) for part in parts])
    sizes = np.array([size(residual[part]) for part in parts])
    typical = float(np.median(sizes)) + 1e-300
    return NoiseOverSpeed(centre, np.clip(sizes, LEAST_SCALE * typical, most * typical))
