"""Least squares on simulated outputs: numbers with standard errors, and what the data cannot tell apart.

    min over p of  sum_k [(q_k - q_k(p)) / s_q]^2 + [(tau_k - tau_k(p)) / s_tau]^2

`s_q` and `s_tau` are the RMS of the residuals themselves, found in a second round. Parameters are searched as
logarithms, so that none changes its sign. Standard errors are those of dependent residuals (`BLOCKS` stretches of rows
are taken as independent): Liang and Zeger, Biometrika 73 (1986) 13.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

Array = npt.NDArray[np.float64]
BLOCKS = 50
ALIKE = 0.98
"""Two parameters whose estimates correlate more than this are told to be inseparable."""
UNCERTAIN = 0.5
"""A parameter whose standard error exceeds this share of it is told to be unknown."""
WIDEST = 1e3
"""A parameter may differ from its start by this factor."""


@dataclass(frozen=True)
class Outputs:
    """Residuals of one candidate, shape (rows, outputs), with derivatives (rows, outputs, parameters)."""

    residual: Array
    slopes: Array


Model = Callable[[Array], Outputs]
"""From parameters (free,) to residuals = measured - simulated."""


@dataclass(frozen=True)
class Estimate:
    """Numbers with standard errors, and the RMS of each output's residual."""

    names: tuple[str, ...]
    start: Array
    values: Array
    covariance: Array
    rms: Array
    evaluations: int

    @property
    def standard_errors(self) -> Array:
        """Standard deviation of each estimate."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Array:
        """Correlation of the estimates."""
        size = np.maximum(self.standard_errors, 1e-300)
        return np.asarray(self.covariance / np.outer(size, size))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Parameters, or pairs of them, that these recordings cannot tell."""
        share = self.standard_errors / np.abs(self.values)
        lost = [
            f"{name} is not identifiable here: its standard error is {error:.0%} of it."
            for name, error in zip(self.names, share, strict=True)
            if error > UNCERTAIN
        ]
        pairs = [
            f"{a} and {self.names[j]} cannot be told apart here: they correlate by {self.correlation[i, j]:+.3f}."
            for i, a in enumerate(self.names)
            for j in range(i)
            if abs(self.correlation[i, j]) > ALIKE
        ]
        return (*lost, *pairs)


def estimate(
    names: Sequence[str], start: Array, model: Model, limits: Array | None = None, evaluations: int = 60
) -> Estimate:
    """Fit from one start; see the module. `limits` (free, 2) are the lowest and highest values that make sense."""
    low, high = np.log(np.maximum(limits, 1e-300)).T if limits is not None else (-np.inf, np.inf)
    scale = _rms(model(start).residual)
    search = _Search(model, scale)
    found = _minimum(search, np.log(start), low, high, evaluations)
    settled = _Search(model, np.maximum(_rms(model(np.exp(found)).residual), 1e-9 * scale))
    found = _minimum(settled, found, low, high, evaluations)
    values = np.exp(found)
    outputs = model(values)
    counted = search.evaluations + settled.evaluations
    covariance = _covariance(outputs, settled.scale)
    return Estimate(tuple(names), start, values, covariance, _rms(outputs.residual), counted)


class _Search:
    """Scaled residuals and derivatives by the logarithms of the parameters; the last evaluation is kept."""

    def __init__(self, model: Model, scale: Array) -> None:
        self.model, self.scale, self.evaluations = model, scale, 0
        self._at: tuple[bytes, Outputs] | None = None

    def _outputs(self, logs: Array) -> Outputs:
        if self._at is None or self._at[0] != logs.tobytes():
            self.evaluations += 1
            self._at = logs.tobytes(), self.model(np.exp(logs))
        return self._at[1]

    def residual(self, logs: Array) -> Array:
        return np.asarray((self._outputs(logs).residual / self.scale).ravel())

    def jacobian(self, logs: Array) -> Array:
        slopes = self._outputs(logs).slopes / self.scale[:, None] * np.exp(logs)
        return np.asarray(-slopes.reshape(-1, len(logs)))


def _minimum(search: _Search, logs: Array, low: Array | float, high: Array | float, evaluations: int) -> Array:
    wide = np.log(WIDEST)
    bounds = np.maximum(logs - wide, low), np.minimum(logs + wide, high)
    inside = np.clip(logs, bounds[0] + 1e-9, bounds[1] - 1e-9)
    found = least_squares(search.residual, inside, search.jacobian, bounds=bounds, xtol=1e-8, max_nfev=evaluations)
    return np.asarray(found.x)


def _rms(residual: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(residual**2, axis=0)) + 1e-300)


def _covariance(outputs: Outputs, scale: Array) -> Array:
    slopes, residual = outputs.slopes / scale[:, None], outputs.residual / scale
    count = slopes.shape[2]
    normal = np.einsum("ioj,iok->jk", slopes, slopes)
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    inverse = np.linalg.pinv(normal / np.outer(size, size), rcond=1e-14) / np.outer(size, size)
    pulls = np.einsum("ioj,io->ij", slopes, residual)
    sums = np.array([block.sum(0) for block in np.array_split(pulls, BLOCKS)])
    spread = sums.T @ sums * BLOCKS / (BLOCKS - count)
    return np.asarray(inverse @ spread @ inverse)
