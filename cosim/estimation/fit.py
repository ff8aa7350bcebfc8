"""Fit the parameters of a known structure to the torque of recorded motions.

Least squares on the filtered torque residual with exact derivatives, bounds from the parameters' own declarations,
and a prior that keeps what the recordings cannot tell at the card's number,

    minimise |w r|^2 (1 + sum ln(p / p_card)^2 / (INDEPENDENT ln(PRIOR_FACTOR)^2)),

the log-normal prior of the base's positive parameters beside as many independent errors as the misfit has, whose size
is not known. What a law of friction misses it misses in each stroke again, so these are no more in longer recordings;
where the model is right the prior fades with the residual.

A fit moves free parameters in units of their own, values = matrix u, low <= u <= high. Where an effect says that one
parameter is above another by a factor at least (`Effect.ordered`), u holds what the upper one has beyond that, and the
bound on u keeps it from going below zero.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import log, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.least_squares import ENOUGH, least_squares
from cosim.estimation.prepare import Array, Piece
from cosim.estimation.tonal_disturbance import phases_of
from cosim.support.statistics import rms
from pyfmi_models.effects import Effect
from pyfmi_models.model import Pair, Recorded, Variable, fields_of, unfitted_of
from pyfmi_models.mount import Mount

PRIOR_FACTOR = 2.0
"""Standard deviation of a card's numbers: right up to this factor."""
INDEPENDENT = 400.0
"""Independent rows beyond which more say nothing new, as there the model's own misfit is the limit (Miller and Dunson,
J. Am. Stat. Assoc. 114 (2019) 1113; evidence counts no more either). With 100 or 25 two more of ten strong effects that
a base without prior absorbed are named, and of a measured axis one is lost, whose truth is far from the card."""
FAR = 1 / float(np.finfo(float).eps)
"""No number goes further than this many of its units, beyond which a step of one unit is lost in rounding: what the
recordings say nothing of (a rough spot beyond what was visited) went on to infinity, where it has no derivatives."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Result: the mount with fitted numbers, its torque (rows,), the derivatives (rows, free), and the residual.

    A phase that is another in each recording is that of the first piece.
    """

    mount: Mount
    free: tuple[str, ...]
    values: Array
    torque: Array
    slopes: Array
    residual: Array
    phases: int = 0
    """How many phases were found beside the free parameters, one in each piece for each tone."""

    @property
    def count(self) -> int:
        """How many numbers were fitted."""
        return len(self.free) + self.phases

    @property
    def rms(self) -> float:
        """RMS of the residual."""
        return rms(self.residual)

    def parameters(self) -> dict[str, float]:
        """Return the fitted numbers by name."""
        return dict(zip(self.free, self.values.tolist(), strict=True))


def free_parameters(mount: Mount, fixed: Sequence[str] = (), freed: Sequence[str] = ()) -> tuple[str, ...]:
    """Names of the parameters a fit may change; a phase that is another in each recording is none of them.

    What parts declare as not fitted stays, but for endings that are `freed`; endings that are `fixed` stay too.
    """
    left = {f"{prefix}.{name}" for prefix, part in mount.components().items() for name in unfitted_of(part)}
    left = {name for name in left if not name.endswith(tuple(freed))} | set(phases_of(mount))
    known = [variable.name for variable in mount.parameters()]
    return tuple(name for name in known if name not in left and not name.endswith(tuple(fixed)))


def fit(
    mount: Mount,
    pieces: Sequence[Piece],
    weight: Array,
    prior: Mount | None = None,
    evaluations: int = 25,
    fixed: Sequence[str] = (),
    freed: Sequence[str] = (),
    held: Sequence[str] = (),
    enough: float = ENOUGH,
) -> Fit:
    """Fit all free parameters of a mount, starting from its numbers.

    Args:
        mount: structure and start.
        pieces: what was recorded.
        weight: weight of each kept row, 0 leaves it out; shape (rows,).
        prior: mount whose numbers the prior pulls to (default: the start).
        evaluations: how many evaluations of the model may be spent.
        fixed: endings of the names of parameters that stay.
        freed: endings of the names of parameters that are fitted although their parts declare that they stay.
        held: names of parameters that keep their start although they are unknown: they count as free.
        enough: share of the sum of squares below which a step ends the fit.

    Returns:
        The fit; residual = measured - model torque, N m.
    """
    free = free_parameters(mount, fixed, freed)
    inverse, tau = Inverse(mount, free), np.concatenate([piece.tau[piece.kept] for piece in pieces])
    known = {variable.name: variable for variable in mount.parameters()}
    start = np.array([known[name].start for name in free])
    stays, (low, high) = np.isin(free, held), _edges(mount, [known[name] for name in free], pieces)
    edges = np.where(stays, start, low), np.where(stays, start, high)
    own = coordinates(mount, free, np.array([_scale(known[name]) for name in free]), edges)
    pull = _Prior(_centre(prior or mount, free))
    # Pieces without weight are only looked at once, at the end.
    used, unused = _weighted(pieces, weight)
    model = _Model(inverse, [pieces[k] for k in used.pieces])
    tau_used, weight_used = tau[used.rows], weight[used.rows]

    def residuals(u: Array) -> Array:
        values = own.matrix @ u
        rest = weight_used * (tau_used - model.torque(values))
        return np.concatenate([rest, np.linalg.norm(rest) * pull(values)[0]])

    def equations(u: Array, left: Array) -> tuple[Array, Array]:
        values, rest, pulled = own.matrix @ u, left[: len(tau_used)], left[len(tau_used) :]
        columns = -weight_used * model.whole(values)[1].T
        prior = pull.slopes(values, rest, columns.T)
        normal, slope = columns @ columns.T + prior.T @ prior, columns @ rest + prior.T @ pulled
        return own.matrix.T @ normal @ own.matrix, own.matrix.T @ slope

    found = least_squares(residuals, equations, own.of(start), (own.low, own.high), evaluations, enough)
    values = _in_a_turn(free, np.clip(own.matrix @ found, *edges))
    seen = model.whole(own.matrix @ found)
    torque, slopes = _joined(used, seen, unused, lambda rest: stacked(inverse, [pieces[k] for k in rest], values))
    phases = inverse.phases(pieces[0], values)
    fitted = with_values(mount, (*free, *phases), np.array([*values, *phases.values()]))
    return Fit(fitted, free, values, torque, slopes, tau - torque, len(phases) * len(pieces))


class _Model:
    """Torque of a structure at the kept rows for one set of numbers after another, and its derivatives where asked for.

    Both are found together, but where the last derivatives were not asked for: after a step that was taken back comes
    another one that may be, and torque alone is cheaper.
    """

    def __init__(self, inverse: Inverse, pieces: Sequence[Piece]) -> None:
        self._inverse, self._pieces = inverse, pieces
        self._alone = replace(inverse, alone=True)
        self._here: dict[bytes, tuple[Array, Array]] = {}
        self._tried: dict[bytes, tuple[Array, Array]] = {}
        self._goes_on = True

    def torque(self, values: Array) -> Array:
        """Torque (rows,)."""
        if self._goes_on:
            self._goes_on = False
            return self._looked_up(values)[0]
        return stacked(self._alone, self._pieces, values)[0]

    def whole(self, values: Array) -> tuple[Array, Array]:
        """Torque, and its derivatives (rows, free); of the last values that were asked for they are at hand."""
        self._goes_on, self._here = True, {values.tobytes(): self._looked_up(values)}
        return self._here[values.tobytes()]

    def _looked_up(self, values: Array) -> tuple[Array, Array]:
        known, key = self._here | self._tried, values.tobytes()
        self._tried = {key: known[key] if key in known else stacked(self._inverse, self._pieces, values)}
        return self._tried[key]


class _Part(NamedTuple):
    """Some of the pieces, by number, and their kept rows."""

    pieces: list[int]
    rows: npt.NDArray[np.int64]


def _weighted(pieces: Sequence[Piece], weight: Array) -> tuple[_Part, _Part]:
    """Pieces with any weight, and the others."""
    edges = np.cumsum([0, *(len(piece.kept) for piece in pieces)])
    spans = [np.arange(first, last) for first, last in pairwise(edges)]
    heavy = [bool(np.any(weight[rows] > 0)) for rows in spans]
    parts = ([k for k, one in enumerate(heavy) if one is wanted] for wanted in (True, False))
    used, unused = (_Part(part, np.concatenate([*(spans[k] for k in part), np.arange(0)])) for part in parts)
    return used, unused


def _joined(
    used: _Part, known: tuple[Array, Array], unused: _Part, look: Callable[[list[int]], tuple[Array, Array]]
) -> tuple[Array, Array]:
    """Torque and slopes at all rows: known where there was weight, looked at only now elsewhere."""
    if not unused.pieces:
        return known
    count = len(used.rows) + len(unused.rows)
    torque, slopes = np.empty(count), np.empty((known[1].shape[1], count)).T
    for part, (own, derivatives) in ((used, known), (unused, look(unused.pieces))):
        torque[part.rows], slopes[part.rows] = own, derivatives
    return torque, slopes


def _in_a_turn(names: Sequence[str], values: Array) -> Array:
    """Phases between -pi and pi: of a wave that is hardly there a step may be many turns, and was 1e7 of them."""
    far = np.array([name.endswith(".phase") for name in names], bool) & (np.abs(values) > pi)
    return np.where(far, np.remainder(values + pi, 2 * pi) - pi, values)


def with_values(mount: Mount, names: Sequence[str], values: Array) -> Mount:
    """Return the mount with new numbers for the named parameters."""
    numbers = {variable.name: variable.start for variable in mount.parameters()}
    numbers |= dict(zip(names, (float(value) for value in values), strict=True))
    parts = {prefix: _filled(part, prefix, numbers) for prefix, part in mount.components().items()}
    axis, friction, *effects = parts.values()
    return replace(mount, axis=axis, friction=friction, effects=tuple(effects))


def _filled(part: Any, prefix: str, numbers: dict[str, float]) -> Any:
    changes: dict[str, float | Pair] = {}
    for name in fields_of(part):
        full = f"{prefix}.{name}"
        sides = [numbers.get(f"{full}.{side}") for side in Pair._fields]
        changes[name] = numbers[full] if full in numbers else Pair(*sides)  # type: ignore[arg-type]
    return replace(part, **changes)


def recorded_by(pieces: Sequence[Piece]) -> Recorded:
    """What some pieces reach."""
    top = max(float(np.abs(piece.v).max()) for piece in pieces)
    often = float(np.quantile(np.abs(np.concatenate([piece.tau for piece in pieces])), 0.98))
    visited = np.concatenate([piece.q for piece in pieces])
    return Recorded(top, often, float(visited.min()), float(visited.max()))


def _edges(mount: Mount, variables: Sequence[Variable], pieces: Sequence[Piece]) -> tuple[Array, Array]:
    """Lowest and highest values of some parameters in a fit to these pieces, as their parts declare them."""
    parts, recorded = mount.components(), recorded_by(pieces)
    edges = []
    for variable in variables:
        prefix, _, name = variable.name.partition(".")
        edges.append(parts[prefix].fit_bounds(replace(variable, name=name), recorded))
    lowest, highest = (np.array(column) for column in zip(*edges, strict=True))
    return lowest, highest


def edges_of(mount: Mount, pieces: Sequence[Piece]) -> dict[str, tuple[float, float]]:
    """Bounds of each free parameter of a mount in a fit to these pieces."""
    known, free = {variable.name: variable for variable in mount.parameters()}, free_parameters(mount)
    lowest, highest = _edges(mount, [known[name] for name in free], pieces)
    return dict(zip(free, zip(lowest.tolist(), highest.tolist(), strict=True), strict=True))


def _scale(variable: Variable) -> float:
    return abs(variable.start) or abs(variable.nominal) or 1.0


def _centre(mount: Mount, free: Sequence[str]) -> Array:
    """The card's numbers of the base's positive parameters; 0 for all others, which are left alone."""
    known = {variable.name: variable for variable in mount.parameters() if variable.low >= 0}
    return np.array(
        [
            max(known[name].start, 0.0) if name.startswith(("axis.", "friction.")) and name in known else 0.0
            for name in free
        ]
    )


class _Prior(NamedTuple):
    """Log-normal pull of parameters towards their centres, where those are above zero, as a share of the misfit."""

    centre: Array

    def __call__(self, values: Array) -> tuple[Array, Array]:
        """Pull of each parameter, and its derivative by that."""
        pulled, width = self.centre > 0, sqrt(INDEPENDENT) * log(PRIOR_FACTOR)
        centre = np.where(pulled, self.centre, 1.0)
        safe = np.where(pulled, np.maximum(values, 1e-3 * centre), 1.0)
        return np.log(safe / centre) * pulled / width, pulled / safe / width

    def slopes(self, values: Array, rest: Array, slopes: Array) -> Array:
        """Derivatives of |rest| times the pull by the parameters, (parameters, parameters)."""
        size, (pull, own) = float(np.linalg.norm(rest)), self(values)
        grows = rest @ slopes / size if size else np.zeros(len(values))
        return np.asarray(np.diag(size * own) + np.outer(pull, grows))


@dataclass(frozen=True)
class Coordinates:
    """The matrix (parameters, parameters) and the bounds of u."""

    matrix: Array
    low: Array
    high: Array

    def of(self, values: Array) -> Array:
        """The u of these values, a little inside its bounds."""
        u = np.linalg.solve(self.matrix, values)
        return np.asarray(np.clip(u, np.nextafter(self.low, 0) + 1e-9, np.nextafter(self.high, 0) - 1e-9))


def coordinates(mount: Mount, free: Sequence[str], scale: Array, edges: tuple[Array, Array]) -> Coordinates:
    """Coordinates of the free parameters, given their units and their lowest and highest values."""
    matrix, low, high = np.diag(scale), edges[0] / scale, edges[1] / scale
    for lower, upper, factor in _ordered(mount, free):
        matrix[upper, lower] = factor * scale[lower]
        low[upper], high[upper] = 0.0, (edges[1][upper] - factor * edges[0][lower]) / scale[upper]
    return Coordinates(matrix, np.maximum(low, -FAR), np.minimum(high, FAR))


def _ordered(mount: Mount, free: Sequence[str]) -> list[tuple[int, int, float]]:
    """Numbers of the free parameters that must not cross, lower and upper, and the least factor between them."""
    found = [(f"{own}.{a}", f"{own}.{b}", least) for own, part in mount.of_kind(Effect) for a, b, least in part.ordered]
    return [(free.index(a), free.index(b), least) for a, b, least in found if a in free and b in free]
