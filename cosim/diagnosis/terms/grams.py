"""Residual, tangents, nuisances and columns of candidate terms as Gram matrices of each band and recording.

    y = X d + C beta + Z u + e,    d ~ N(0, T^2),  beta ~ N(0, s^2 prior^2),  u, e as in `marginal.py`

Every choice of terms and of recordings is then a sum of parts of these matrices: a fit takes milliseconds.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.marginal import Group, Marginal, marginal
from cosim.diagnosis.terms.candidate_terms import CandidateTerm
from cosim.estimation.fit import Fit
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.priors import trust
from cosim.support.statistics import rms
from pyfmi_models.mount import Mount

PASSES = 3
"""How often the noise of least squares is renewed."""
SIZE = 0.5
"""What a term may be, relative to the friction level or to all torque where there is none (half-normal). Unit: 1."""


def columns_of(mount: Mount, term: CandidateTerm, prepared: Prepared, beside: Sequence[CandidateTerm] = ()) -> Array:
    """Torque that a unit of each coefficient adds at the kept rows, (rows, count), at the present coefficients.

    `beside` are the terms that the mount has then, the term among them.
    """
    terms = beside or [term]
    whole, names = with_terms(mount, terms)
    first = sum(one.count for one in terms[: [one is term for one in terms].index(True)])
    inverse = Inverse(whole, names[first : first + term.count])
    return stacked(inverse, prepared.pieces, inverse.present)[1]


def with_terms(mount: Mount, added: Sequence[CandidateTerm]) -> tuple[Mount, tuple[str, ...]]:
    """A mount with terms, and the names of their coefficients, one term after the other."""
    whole = replace(mount, effects=(*mount.effects, *(one.effect for one in added)))
    prefixes = list(whole.components())[-len(added) :] if added else []
    pairs = zip(prefixes, added, strict=True)
    return whole, tuple(f"{prefix}.c{k}" for prefix, one in pairs for k in range(one.count))


@dataclass(frozen=True, eq=False)
class Grams:
    """Gram matrices (recordings, bands, 1 + n, 1 + n) of [residual, tangents, nuisances, columns of the terms]."""

    parts: Array
    plain: Array
    """The same of weighted rows, all bands together: what least squares sees."""
    count: Array
    """Rows of each recording and band that count."""
    coarsening: float
    floor: Array
    trust: Array
    """Prior size of each tangent's parameter."""
    nuisances: tuple[Group, ...]
    columns: tuple[slice, ...]
    """Where the columns of each term are, among the n."""
    unit: Array
    """What a coefficient of size one stands for, of each column of the terms."""

    @property
    def recordings(self) -> int:
        """How many recordings."""
        return len(self.parts)

    @property
    def many(self) -> int:
        """How many tangents and nuisances."""
        return int(self.columns[0].start) if self.columns else int(self.parts.shape[-1]) - 1

    def marginal(self, chosen: Sequence[int], which: Sequence[int]) -> Marginal:
        """Marginal likelihood of tangents, nuisances and the chosen terms on some recordings, with their sizes."""
        kept = [0, *(1 + k for k in range(self.many)), *(1 + k for k in self._places(chosen))]
        grams = self._summed(which, kept)
        groups, first = list(self.nuisances), self.many
        for one in chosen:
            last = first + len(self._places([one]))
            groups.append(Group(np.arange(first, last), SIZE))
            first = last
        free = np.ones(len(kept) - 1)
        free[: len(self.trust)] = self.trust
        return marginal(grams, free, groups, *self._rows(which), self.floor)

    def fitted(self, chosen: Sequence[int], which: Sequence[int]) -> Array:
        """Numbers of the tangents and the chosen terms: least squares, with the sizes of the marginal likelihood.

        Least squares as the base was fitted: weights by bands would move the base for reasons of their own.
        """
        sizes = self.marginal(chosen, which).sizes[len(self.nuisances) :]
        kept = [0, *(1 + k for k in range(len(self.trust))), *(1 + k for k in self._places(chosen))]
        gram = self.plain[np.ix_(which, kept, kept)].sum(0)
        spread = [np.full(len(self._places([one])), max(size, 1e-6)) for one, size in zip(chosen, sizes, strict=True)]
        precision = 1 / np.concatenate([self.trust, *spread]) ** 2
        effective = float(self._rows(which)[1].sum())
        beta = np.zeros(len(kept) - 1)
        for _ in range(PASSES):
            left = gram[0, 0] - 2 * gram[0, 1:] @ beta + beta @ gram[1:, 1:] @ beta
            noise = max(left, 1e-12 * gram[0, 0]) / effective + 1e-300
            normal = gram[1:, 1:] / noise + np.diag(precision)
            scale = 1 / np.sqrt(np.diag(normal))
            beta = scale * np.linalg.solve(normal * np.outer(scale, scale), scale * gram[1:, 0] / noise)
        return beta

    def _places(self, chosen: Sequence[int]) -> list[int]:
        return [k for one in chosen for k in range(self.columns[one].start, self.columns[one].stop)]

    def _summed(self, which: Sequence[int], kept: Sequence[int]) -> Array:
        """Matrices of some columns, all of some recordings together; the others are not touched, which may be many."""
        bands = range(self.parts.shape[1])
        return np.asarray(self.parts[np.ix_(which, bands, kept, kept)].sum(0))

    def _rows(self, which: Sequence[int]) -> tuple[Array, Array]:
        count = self.count[which].sum(0) + 1e-9
        return count, count / (1 + count / self.coarsening)

    def predicted(self, chosen: Sequence[int], beta: Array, which: Sequence[int]) -> float:
        """Log-likelihood of what fitted numbers leave of other recordings; only the nuisances are free there."""
        tangents, far = len(self.trust), self.many
        places = [0, *(1 + k for k in range(tangents)), *(1 + k for k in self._places(chosen))]
        kept = [*places, *range(1 + tangents, 1 + far)]
        own = np.zeros((len(kept), 1 + far - tangents))
        own[: len(places), 0] = [1.0, *-beta]
        own[len(places) :, 1:] = np.eye(far - tangents)
        grams = own.T @ self._summed(which, kept) @ own
        groups = [Group(np.asarray(one.columns) - tangents, one.prior) for one in self.nuisances]
        free = np.ones(far - tangents)
        return marginal(grams, free, groups, *self._rows(which), self.floor).log_likelihood


def grams_of(comparison: Comparison, found: Fit, columns: Sequence[Array], added: Sequence[CandidateTerm]) -> Grams:
    """Gram matrices of the training recordings, beside a structure."""
    level = rms(comparison.nuisances.level) or float(np.std(comparison.problem.prepared.stacked("tau")))
    unit = [one.prior * (level if one.in_torque else 1.0) for one in added]
    widths = [found.slopes.shape[1], comparison.nuisances.columns.shape[1], *(int((one > 0).sum()) for one in unit)]
    edges = np.cumsum([0, *widths])
    own = [found.residual[:, None], found.slopes, comparison.nuisances.columns]
    parts, plain, count = _by_recording(comparison, [*own, *columns], [*(np.ones(one.shape[1]) for one in own), *unit])
    groups = tuple(comparison.nuisances.groups_at(int(edges[1])))
    sizes, coarsening = trust(found, comparison.problem.prepared.reach), comparison.policy.coarsening
    places = tuple(slice(int(first), int(last)) for first, last in pairwise(edges[2:]))
    units = np.concatenate([size[size > 0] for size in unit]) if unit else np.zeros(0)
    return Grams(parts, plain, count, coarsening, comparison.floor, sizes, groups, places, units)


def _by_recording(
    comparison: Comparison, columns: Sequence[Array], units: Sequence[Array]
) -> tuple[Array, Array, Array]:
    """Matrices of each recording and band, of its weighted rows as they are, and rows that count."""
    owner = comparison.problem.prepared.recording_of  # in order
    edges = np.searchsorted(owner, np.arange(int(owner[-1]) + 2)).tolist()
    found = [_of_rows(comparison, columns, units, slice(*ends)) for ends in pairwise(edges)]
    parts, plain, count = (np.array(several) for several in zip(*found, strict=True))
    return parts, plain, count


def _of_rows(
    comparison: Comparison, columns: Sequence[Array], units: Sequence[Array], rows: slice
) -> tuple[Array, Array, Array]:
    """The same of one recording: of all of them laid out at once 600 s at 10 kHz took a third more memory."""
    bands, weight = comparison.bands, comparison.problem.weight[rows]
    pairs = zip(columns, units, strict=True)
    whole = np.column_stack([one[rows, size > 0] * size[size > 0] for one, size in pairs])
    transformed, inside = bands.transform(whole, rows.start), [bands.band[rows] == k for k in range(len(bands.count))]
    parts = np.array([_gram(transformed[one]) for one in inside])
    counted = float(np.mean(weight > 0)) if len(weight) else 0.0
    whole *= weight[:, None]
    return parts, _gram(whole), np.array([counted * int(one.sum()) for one in inside])


def _gram(rows: Array) -> Array:
    return np.asarray(rows.T @ rows)
