"""Fit the parameters of a known structure to the torque of recorded motions.

Least squares on the filtered torque residual with exact derivatives, bounds from the parameters' own declarations,
and a weak prior that keeps what the recordings cannot tell at the card's number: a factor `PRIOR_FACTOR` off costs as
much as one standard deviation of the residual in one independent row.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import log
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.diagnosis.inverse import Inverse, stacked
from cosim.diagnosis.least_squares import least_squares
from cosim.diagnosis.prepare import Array, Piece
from cosim.diagnosis.shaken import phases_of
from pyfmi_models.model import Pair, Variable, fields_of
from pyfmi_models.mount import Mount

FIXED = (
    "axis.torque_limit",
    *(f"friction.{name}" for name in ("smoothing", "n", "spread", "attraction")),
    *("delta", "cycles_per_rev", "onset_s", "warm_up_degC", "heat_degC_per_rad", "hardening", "contact_hz"),
    "backlash.damping_ratio",
)
"""Parameters that are not fitted here: limits, shapes of laws, and numbers that candidates choose from a grid."""
BRISTLES = ("friction.sigma0", "friction.sigma1", "friction.Fs", "friction.Vs")
"""Parameters that only the slowest motion tells: a recording that never dwells says nothing about them."""
LEAST_VS, MOST_FS = 0.005, 5.0
"""Stribeck curves narrower than this share of the top speed, or higher than this times their start, are not fitted."""
LEAST_KNEE = 0.2
"""A drive that saturates does so above this share of the command that is hardly ever exceeded (98 %). Past a knee the
command outgrows the need: a drive that bends at 0.7 of what is needed, with a slope of 0.3, does so at 0.4 of it."""
LEAST_SLOPE = 0.02
"""... and gives at least this share of what more is asked for, else no command gives what is needed."""
LEAST_WARMING = 2.0
"""Seconds in which a bearing warms or cools at the fastest: faster, a warm-up is a friction that depends on speed."""
PRIOR_FACTOR = 2.0


@dataclass(frozen=True)
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
        return float(np.sqrt(np.mean(self.residual**2)))

    def parameters(self) -> dict[str, float]:
        """Return the fitted numbers by name."""
        return dict(zip(self.free, self.values.tolist(), strict=True))


def free_parameters(mount: Mount, fixed: Sequence[str] = FIXED) -> tuple[str, ...]:
    """Names of the parameters a fit may change; a phase that is another in each recording is none of them."""
    known, own = [variable.name for variable in mount.parameters()], phases_of(mount)
    return tuple(name for name in known if not name.endswith(tuple(fixed)) and name not in own)


def fit(
    mount: Mount,
    pieces: Sequence[Piece],
    weight: Array,
    prior: Mount | None = None,
    evaluations: int = 25,
    factor: float = PRIOR_FACTOR,
    fixed: Sequence[str] = FIXED,
) -> Fit:
    """Fit all free parameters of a mount, starting from its numbers.

    Args:
        mount: structure and start.
        pieces: what was recorded.
        weight: weight of each kept row, 0 leaves it out; shape (rows,).
        prior: mount whose numbers the weak prior pulls to (default: the start).
        evaluations: how many evaluations of the model may be spent.
        factor: a parameter of the base this far from the prior costs one unit (see the module).
        fixed: endings of the names of parameters that stay.

    Returns:
        The fit; residual = measured - model torque, N m.
    """
    free = free_parameters(mount, fixed)
    inverse, tau = Inverse(mount, free), np.concatenate([piece.tau[piece.kept] for piece in pieces])
    known = {variable.name: variable for variable in mount.parameters()}
    start = np.array([known[name].start for name in free])
    scale = np.array([_scale(known[name]) for name in free])
    pull = _prior(prior or mount, free, float(np.sqrt(np.mean((weight * tau) ** 2))) * 1e-2 / log(factor))
    # Pieces without weight are only looked at once, at the end.
    used, unused = _weighted(pieces, weight)
    cache: dict[bytes, tuple[Array, Array]] = {}
    best: list[tuple[Array, Array]] = []

    def evaluate(u: Array) -> tuple[Array, Array]:
        key = u.tobytes()
        if key not in cache:
            cache.clear()
            cache[key] = stacked(inverse, [pieces[k] for k in used.pieces], u * scale)
        return cache[key]

    tau_used, weight_used = tau[used.rows], weight[used.rows]

    def residuals(u: Array) -> Array:
        return np.concatenate([weight_used * (tau_used - evaluate(u)[0]), pull(u * scale)[0]])

    def jacobian(u: Array) -> Array:
        best[:] = [evaluate(u)]  # asked for where the fit goes on from, and so last where it ends
        return np.concatenate([-weight_used[:, None] * evaluate(u)[1] * scale, np.diag(pull(u * scale)[1] * scale)])

    lowest, highest = _edges([known[name] for name in free], pieces)
    low, high = lowest / scale, highest / scale
    inner = np.clip(start / scale, np.nextafter(low, 0) + 1e-9, np.nextafter(high, 0) - 1e-9)
    found = least_squares(residuals, jacobian, inner, (low, high), evaluations)
    values = np.clip(found * scale, lowest, highest)
    torque, slopes = _joined(used, best[0], unused, lambda rest: stacked(inverse, [pieces[k] for k in rest], values))
    phases = inverse.phases(pieces[0], values)
    fitted = with_values(mount, (*free, *phases), np.array([*values, *phases.values()]))
    return Fit(fitted, free, values, torque, slopes, tau - torque, len(phases) * len(pieces))


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
    count = len(used.rows) + len(unused.rows)
    torque, slopes = np.empty(count), np.empty((count, known[1].shape[1]))
    torque[used.rows], slopes[used.rows] = known
    if unused.pieces:
        torque[unused.rows], slopes[unused.rows] = look(unused.pieces)
    return torque, slopes


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


def _edges(variables: Sequence[Variable], pieces: Sequence[Piece]) -> tuple[Array, Array]:
    """Lowest and highest values of some parameters in a fit to these pieces."""
    top = max(float(np.abs(piece.v).max()) for piece in pieces)
    asked = float(np.quantile(np.abs(np.concatenate([piece.tau for piece in pieces])), 0.98))
    edges = [_bounds(variable, top, asked) for variable in variables]
    lowest, highest = (np.array(column) for column in zip(*edges, strict=True))
    return lowest, highest


def _bounds(variable: Variable, top: float, asked: float) -> tuple[float, float]:
    """Bounds of a parameter in a fit: its own, and what the recordings can tell.

    A Stribeck curve needs speeds `top` beside its own; a drive that saturates gives at least half of what is `asked`,
    else a model that needs no torque at all would fit a drive that gives none.
    """
    if variable.name.endswith(".knee_torque"):
        return LEAST_KNEE * asked, variable.high
    if variable.name.endswith(("warm_up_s", "cooling_s")):
        return min(LEAST_WARMING, variable.start), variable.high
    if variable.name.endswith("saturation.slope"):
        return LEAST_SLOPE, variable.high
    if variable.name.endswith(".Vs"):
        return min(LEAST_VS * top, variable.start), top
    if variable.name.endswith(".Fs"):
        return variable.low, max(MOST_FS * variable.start, variable.low)
    return variable.low, variable.high


def _scale(variable: Variable) -> float:
    return abs(variable.start) or abs(variable.nominal) or 1.0


def _prior(mount: Mount, free: Sequence[str], weight: float) -> Callable[[Array], tuple[Array, Array]]:
    """Weak log-normal pull of the base's positive parameters towards the card; effects are left alone."""
    known = {variable.name: variable for variable in mount.parameters()}
    centre = np.array([known[name].start if name in known else 0.0 for name in free])
    positive = np.array(
        [
            name.startswith(("axis.", "friction.")) and name in known and known[name].low >= 0 < known[name].start
            for name in free
        ]
    )
    centre = np.where(positive, centre, 1.0)

    def pull(values: Array) -> tuple[Array, Array]:
        safe = np.where(positive, np.maximum(values, 1e-3 * centre), 1.0)
        return (
            np.where(positive, weight * np.log(safe / centre), 0.0),
            np.where(positive, weight / safe, 0.0),
        )

    return pull
