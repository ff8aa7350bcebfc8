"""Fits and cross-validation as algebra on the Gram matrices of blocks; nothing goes back to the rows."""

from collections.abc import Collection, Sequence

import numpy as np

from cosim.diagnosis.evidence import Blocks, Index, Mask
from cosim.diagnosis.prepare import Array


class Grams:
    """Gram matrices of whitened columns, one a block; column 0 is the target.

    Args:
        columns: whitened columns of each block, (rows, n) with the target first.
        wander: whitened columns of each block whose coefficients are random per block (friction level wander), with
            unit prior variance; they are integrated out.
        blocks: the blocks.
        prior: prior variance of the coefficient of each column but the target (inf: free), in whitened units.
        nuisance: columns whose coefficients are random per fold: what they can explain of a fold counts neither for
            nor against a structure.
    """

    def __init__(
        self,
        columns: Sequence[Array],
        wander: Sequence[Array],
        blocks: Blocks,
        prior: Array,
        nuisance: Sequence[int],
    ) -> None:
        self.fold, self.prior, self.nuisance = blocks.fold, prior, np.asarray(nuisance, int)
        self.gram = np.array([_marginal(x, w) for x, w in zip(columns, wander, strict=True)])
        self.rows = np.array([float(len(x)) for x in columns])
        self.folds = [self.fold == fold for fold in np.unique(self.fold)]

    def energy(
        self, chosen: Sequence[int], nuisance: Sequence[int] | None = None, untold: Collection[int] = ()
    ) -> Array:
        """Cross-validated energy of the target in each block, each fold predicted from the others.

        Folds that are `untold` by the others tell themselves too.
        """
        energy = np.zeros(len(self.gram))
        used = self.nuisance if nuisance is None else np.asarray(nuisance, int)
        totals = [self.gram[fold].sum(0) for fold in self.folds]
        reduced = [self._reduced(total, chosen, used) for total in totals]
        for number, fold in enumerate(self.folds):
            others = [one for other, one in enumerate(reduced) if other != number or number in untold] or reduced
            beta = self._solved(np.sum(others, axis=0), np.asarray(chosen, int))
            energy[fold] = self._rest(fold, totals[number], chosen, used, beta)
        return energy

    def fit(self, chosen: Sequence[int], nuisance: Sequence[int] | None = None) -> Array:
        """Coefficients of the chosen columns from all blocks, nuisances fitted per fold."""
        used = self.nuisance if nuisance is None else np.asarray(nuisance, int)
        reduced = np.sum([self._reduced(self.gram[fold].sum(0), chosen, used) for fold in self.folds], axis=0)
        return self._solved(reduced, np.asarray(chosen, int))

    def _reduced(self, total: Array, chosen: Sequence[int], used: Index) -> Array:
        """Gram matrix of target and chosen columns with the nuisances of one fold integrated out."""
        index = np.concatenate([[0], np.asarray(chosen, int)]).astype(int)
        kept = total[np.ix_(index, index)]
        if not len(used):
            return np.asarray(kept)
        cross = total[np.ix_(used, index)]
        return np.asarray(kept - cross.T @ self._solve(total[np.ix_(used, used)], used, cross))

    def _solved(self, reduced: Array, index: Index) -> Array:
        return self._solve(reduced[1:, 1:], index, reduced[1:, 0])

    def _solve(self, normal: Array, index: Index, target: Array) -> Array:
        normal = normal + np.diag(1 / self.prior[index - 1])
        scale = 1 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
        scaled = normal * np.outer(scale, scale) + 1e-9 * np.eye(len(index))
        right = (target.T * scale).T
        return np.asarray((np.linalg.solve(scaled, right).T * scale).T)

    def _rest(self, fold: Mask, total: Array, chosen: Sequence[int], used: Index, beta: Array) -> Array:
        """Energy that is left in the blocks of a fold, its nuisances fitted to what beta leaves."""
        full = np.zeros(total.shape[0])
        full[0], full[np.asarray(chosen, int)] = 1.0, -beta
        penalty = 0.0
        if len(used):
            gamma = self._solve(total[np.ix_(used, used)], used, total[used] @ full)
            full[used] -= gamma
            penalty = float(gamma**2 @ (1 / self.prior[used - 1])) / fold.sum()
        return np.asarray(np.einsum("i,bij,j->b", full, self.gram[fold], full) + penalty)


def _marginal(x: Array, w: Array) -> Array:
    """Gram matrix of x under the covariance I + w w'."""
    if not w.shape[1]:
        return np.asarray(x.T @ x)
    cross = w.T @ x
    inner = np.eye(w.shape[1]) + w.T @ w
    return np.asarray(x.T @ x - cross.T @ np.linalg.solve(inner, cross))
