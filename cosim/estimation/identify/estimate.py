"""Least squares on simulated outputs: numbers with standard errors, and what the data cannot tell apart.

    min over p of  sum_k [(q_k - q_k(p)) / s_q]^2 + [(tau_k - tau_k(p)) / s_tau]^2

`s_q` and `s_tau` are the RMS of the residuals themselves, found in a second round. Parameters are searched as
logarithms, so that none changes its sign. Standard errors are those of dependent residuals (`BLOCKS` stretches of rows
are taken as independent): Liang and Zeger, Biometrika 73 (1986) 13.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from cosim.estimation.least_squares import least_squares, of_jacobian
from cosim.plots.quantities import number
from cosim.support.errors import InputError
from cosim.support.statistics import column_rms

Array = npt.NDArray[np.float64]
BLOCKS = 50
ALIKE = 0.98
"""Two parameters whose estimates correlate more than this are told to be inseparable."""
UNCERTAIN = 0.5
"""A parameter whose standard error exceeds this share of it, or of the card's number, is not determined."""
ENOUGH = 1e-7
"""A fit ends when a step lowers the sum of squares by less than this share: less than a standard error moves it."""
ROUGH = 1e-3
"""The same for a first look: basins differ by per cents."""
MOST = 60
"""Evaluations that a fit may take."""
KEPT = 4
"""Evaluations that are kept: a search that ends with some that were no better ends at one before them."""
WIDEST = 1e3
"""A parameter may differ from its start by this factor."""
EDGE = 1e-4
"""Share of a limit of the search within which it has ended there."""


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
    held: Mapping[str, float] = field(default_factory=dict)
    """Numbers that the data do not determine, at the card's value; they are not among `names`."""

    @property
    def standard_errors(self) -> Array:
        """Standard deviation of each estimate."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def certain(self) -> dict[str, float]:
        """Numbers by name, but for those whose standard error says that they are not determined."""
        triples = zip(self.names, self.values.tolist(), self.standard_errors.tolist(), strict=True)
        return {name: value for name, value, error in triples if error <= UNCERTAIN * abs(value)}

    @property
    def correlation(self) -> Array:
        """Correlation of the estimates."""
        size = np.maximum(self.standard_errors, 1e-300)
        return np.asarray(self.covariance / np.outer(size, size))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Parameters, or pairs of them, that these recordings cannot tell."""
        lost = [f"{name} is not determined here: {number(value, 4)} is kept." for name, value in self.held.items()]
        lost += [f"{name} is not determined here." for name in self.names if name not in self.certain]
        pairs = [
            f"{a} and {self.names[j]} cannot be told apart here: they correlate by {self.correlation[i, j]:+.3f}."
            for i, a in enumerate(self.names)
            for j in range(i)
            if abs(self.correlation[i, j]) > ALIKE
        ]
        return (*lost, *pairs)


def estimate(names: Sequence[str], start: Array, model: Model, limits: Array | None = None) -> Estimate:
    """Fit from one start; see the module. `limits` (free, 2) are the lowest and highest values that make sense."""
    return settle(explore(names, start, model, limits, MOST, ENOUGH), model, limits)


def explore(
    names: Sequence[str], start: Array, model: Model, limits: Array | None, evaluations: int, enough: float = ROUGH
) -> Estimate:
    """Fit in the first round only: weights are those of the residuals at the start."""
    search = _Search(model, np.ones(1))
    search.scale = _rms(search.outputs(np.log(start)).residual)
    found = _minimum(search, np.log(start), limits, evaluations, enough)
    outputs = search.outputs(found)
    covariance = _covariance(outputs, _rms(outputs.residual))
    return Estimate(tuple(names), start, np.exp(found), covariance, _rms(outputs.residual), search.evaluations)


def settle(rough: Estimate, model: Model, limits: Array | None = None) -> Estimate:
    """Go on from an estimate with its own residuals as weights, until nothing changes any more."""
    scale = np.maximum(rough.rms, 1e-300)
    settled = _Search(model, scale)
    found = _minimum(settled, np.log(rough.values), limits, MOST, ENOUGH)
    outputs = settled.outputs(found)
    counted = rough.evaluations + settled.evaluations
    rms = _rms(outputs.residual)
    return Estimate(rough.names, rough.start, np.exp(found), _covariance(outputs, scale), rms, counted)


def determined(found: Estimate, model: Model, card: Array, limits: Array | None = None) -> Estimate:
    """Hold what the data do not determine at the card's numbers, one after the other, and fit the rest again.

    The least certain number goes first: what depends on it may be certain without it. A number that ended where its
    search ends is not determined either.

    Args:
        found: an estimate of all numbers.
        model: what it was fitted with.
        card: the card's numbers, which are kept, (names,).
        limits: as of `estimate`.

    Raises:
        InputError: no number is determined.
    """
    own, kept, best = np.asarray(card, float), list(range(len(found.names))), found
    edges = np.array([(0.0, np.inf)] * len(kept)) if limits is None else limits
    while (worst := _least_certain(best, own[kept], edges[kept])) is not None:
        del kept[worst]
        if not kept:
            raise InputError(f"these recordings determine none of {', '.join(found.names)}.")
        rough = replace(best, names=tuple(found.names[k] for k in kept), start=found.start[kept])
        rough = replace(rough, values=np.delete(best.values, worst), covariance=np.eye(len(kept)))
        best = settle(rough, _restricted(model, own, kept), edges[kept])
    held = {name: float(own[k]) for k, name in enumerate(found.names) if k not in kept}
    return replace(best, held=held)


def _least_certain(found: Estimate, card: Array, limits: Array) -> int | None:
    """The number that is determined least, if it is not determined."""
    share = found.standard_errors / np.maximum(np.abs(card), np.abs(found.values))
    ratio = found.values / found.start
    ended = (ratio > (1 - EDGE) * WIDEST) | (ratio < (1 + EDGE) / WIDEST)
    ended |= (found.values < (1 + EDGE) * limits[:, 0]) | (found.values > (1 - EDGE) * limits[:, 1])
    share = np.where(ended | ~np.isfinite(share), np.inf, share)
    worst = int(np.argmax(share))
    return worst if share[worst] > UNCERTAIN else None


def _restricted(model: Model, numbers: Array, kept: Sequence[int]) -> Model:
    """A model of some of its numbers, the others as given."""

    def some(values: Array) -> Outputs:
        full = numbers.copy()
        full[list(kept)] = values
        outputs = model(full)
        return Outputs(outputs.residual, outputs.slopes[:, :, list(kept)])

    return some


class _Search:
    """Scaled residuals and derivatives by the logarithms of the parameters; the last `KEPT` evaluations are kept."""

    def __init__(self, model: Model, scale: Array) -> None:
        self.model, self.scale, self.evaluations = model, scale, 0
        self._kept: dict[bytes, Outputs] = {}

    def outputs(self, logs: Array) -> Outputs:
        """Residuals and derivatives as the model has them."""
        key = logs.tobytes()
        if key not in self._kept:
            self.evaluations += 1
            self._kept = dict([*self._kept.items(), (key, self.model(np.exp(logs)))][-KEPT:])
        return self._kept[key]

    def residual(self, logs: Array) -> Array:
        return np.asarray((self.outputs(logs).residual / self.scale).ravel())

    def jacobian(self, logs: Array) -> Array:
        slopes = self.outputs(logs).slopes / self.scale[:, None] * np.exp(logs)
        return np.asarray(-slopes.reshape(-1, len(logs)))


def _minimum(search: _Search, logs: Array, limits: Array | None, evaluations: int, enough: float) -> Array:
    low, high = np.log(np.maximum(limits, 1e-300)).T if limits is not None else (-np.inf, np.inf)
    wide = np.log(WIDEST)
    bounds = np.maximum(logs - wide, low), np.minimum(logs + wide, high)
    inside = np.clip(logs, bounds[0] + 1e-9, bounds[1] - 1e-9)
    return least_squares(search.residual, of_jacobian(search.jacobian), inside, bounds, evaluations, enough)


def _rms(residual: Array) -> Array:
    return column_rms(residual)


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
