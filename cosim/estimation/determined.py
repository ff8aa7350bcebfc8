"""Which numbers of the base recordings determine, and what a card may hold of those that they do not.

A number p is not determined where recordings tell it `WORSE` times worse than the card, whose numbers are right up to a
factor (`PRIOR_FACTOR`), or where noise of the reading rather than motion tells it:

    |p s'| / |r| < 1 / (WORSE sqrt(INDEPENDENT) ln(PRIOR_FACTOR)),        |n|^2 > NOISE |s'|^2

with r the weighted residual, s' the part of the weighted derivative by p that the derivatives by the other numbers do
not hold, and n what noise of the reading alone makes of it: noise in an acceleration pulls an inertia to zero, however
small its standard error. Numbers that are told only together have no s' of their own: the one told worst is held at the
card's, and the others are asked again without it.

A number that ends at a bound of the fit is limited by the recordings, not found: a card then holds the value next to
its own that they do not contradict, which is that where |r|^2 has grown by one part in `INDEPENDENT`.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import log, sqrt

import numpy as np

from cosim.estimation.filters import derivative, lowpass
from cosim.estimation.fit import INDEPENDENT, PRIOR_FACTOR, Fit, edges_of, with_values
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Array, Piece, Prepared
from cosim.estimation.problem import Problem
from cosim.plots.quantities import joined, number, raised
from cosim.support.plain import JsonObject
from pyfmi_models.model import Variable
from pyfmi_models.mount import Mount

WORSE = 4.0
"""How much worse than the card recordings may tell a number that still counts as determined. Between 1 and that the
prior of the fit weighs both; of twelve simulated axes no number is told worse than .8 of the card."""
NOISE = 0.5
"""Share of the energy of s' that noise of the reading may make: with half of it an estimate is half of the truth."""
EXACT = 1e-4
"""Least residual, relative to the torque: no torque is recorded more exactly."""
INSIDE = 0.5
"""Share of its way to a bound that another number may go along with one that is taken off its bound."""


@dataclass(frozen=True)
class Limited:
    """A number that recordings only limit: what a card holds, and whether that is the highest or the lowest value."""

    value: float
    is_highest: bool


def with_held(problem: Problem, base: Fit) -> tuple[Problem, Fit]:
    """Hold what the recordings do not determine at the card's numbers, and fit the rest of the base again."""
    held = undetermined(problem, base)
    if not held:
        return problem, base
    starts = {variable.name: variable.start for variable in problem.mount.parameters()}
    card = np.array([starts[name] for name in held])
    problem = replace(problem, held=held)
    return problem, problem.fit(with_values(base.mount, held, card), 75)


def undetermined(problem: Problem, found: Fit) -> tuple[str, ...]:
    """Names of the base's numbers that a fit of it does not determine, told worst first."""
    weight, sizes = problem.weight[:, None], _sizes(problem, found)
    noisy = stacked(Inverse(found.mount, found.free), _with_noise(problem.prepared), found.values)[1]
    noise = weight * (noisy - found.slopes) * sizes
    least = _misfit(problem, found) / (WORSE * sqrt(INDEPENDENT) * log(PRIOR_FACTOR))
    asked = [k for k, name in enumerate(found.free) if _is_of_base(name)]
    return tuple(found.free[k] for k in _worst_first(weight * found.slopes * sizes, noise, least, asked))


def limited(problem: Problem, mount: Mount) -> tuple[Mount, dict[str, Limited]]:
    """A fitted mount without numbers of the base at bounds of the fit, and those that were there.

    The others go along as far as residuals are linear; numbers that the card itself has at a bound stay.
    """
    ended = _at_bounds(problem, mount)
    if not ended:
        return mount, {}
    found = problem.fit(mount, 1)
    columns, residual = problem.weight[:, None] * found.slopes, problem.weight * found.residual
    least, values, moved = _misfit(problem, found) ** 2 / INDEPENDENT, found.values.copy(), {}
    edges = edges_of(mount, problem.prepared.pieces)
    low, high = (np.array([edges[name][side] for name in found.free]) for side in (0, 1))
    others = [j for j, other in enumerate(found.free) if _is_of_base(other) and other not in (*ended, *problem.held)]
    for name, (bound, card) in ended.items():
        k, sign = found.free.index(name), 1.0 if card > bound else -1.0
        along = np.zeros(len(values))
        along[others] = np.linalg.lstsq(columns[:, others], columns[:, k], rcond=1e-10)[0]
        own = columns[:, k] - columns @ along
        push, bend = max(0.0, -sign * float(own @ residual)), max(float(own @ own), 1e-300)
        step = sign * min((sqrt(push**2 + bend * least) - push) / bend, abs(card - bound))
        room = np.where(along * step > 0, values - low, high - values)
        crosses = np.abs(along * step) > INSIDE * room
        step *= float(np.min(INSIDE * room[crosses] / np.abs(along * step)[crosses], initial=1.0))
        values += step * (np.eye(len(values))[k] - along)
        moved[name] = Limited(float(values[k]), card > bound)
    return with_values(mount, found.free, values), moved


def _at_bounds(problem: Problem, mount: Mount) -> dict[str, tuple[float, float]]:
    """Numbers of the base that ended at a bound of the fit: that bound, and the card's number."""
    card = {variable.name: variable.start for variable in problem.mount.parameters()}
    edges, ended = edges_of(mount, problem.prepared.pieces), {}
    for variable in mount.parameters():
        name = variable.name
        is_asked = _is_of_base(name) and name in card and name in edges and name not in problem.held
        edge = ended_at(variable.start, card[name], edges[name]) if is_asked else None
        if edge is not None:
            ended[name] = edge, card[name]
    return ended


def ended_at(value: float, start: float, bounds: Sequence[float]) -> float | None:
    """The bound at which a fit ended that did not start there, to within a millionth of the number."""
    margin = 1e-6 * max(abs(start), abs(value))
    return next((edge for edge in bounds if abs(value - edge) <= margin < abs(start - edge)), None)


def _is_of_base(name: str) -> bool:
    return name.startswith(("axis.", "friction."))


def _misfit(problem: Problem, found: Fit) -> float:
    """Size of the weighted residual, or of what no recording tells."""
    torque = float(np.linalg.norm(problem.weight * problem.prepared.stacked("tau")))
    return max(float(np.linalg.norm(problem.weight * found.residual)), EXACT * torque)


def _sizes(problem: Problem, found: Fit) -> Array:
    """Size of each number: the card's, or the fitted one where that is larger."""
    card: Mapping[str, float] = {variable.name: variable.start for variable in problem.mount.parameters()}
    pairs = zip(found.free, found.values.tolist(), strict=True)
    return np.array([max(abs(card.get(name, 0.0)), abs(value)) for name, value in pairs])


def _worst_first(columns: Array, noise: Array, least: float, asked: Sequence[int]) -> Iterator[int]:
    """Columns that are not told, each beside those that remain after the ones before it."""
    remaining = [k for k in range(columns.shape[1]) if np.any(columns[:, k])]
    yield from (k for k in asked if k not in remaining)
    while remaining:
        own, loud = _alone(columns[:, remaining]), (noise[:, remaining] ** 2).sum(0)
        energies = zip(remaining, own, loud, strict=True)
        told = {k: 0.0 if n > NOISE * energy else sqrt(energy) for k, energy, n in energies if k in asked}
        worst = min(told, key=lambda k: told[k], default=None)
        if worst is None or told[worst] >= least:
            return
        yield worst
        remaining.remove(worst)


def _alone(columns: Array) -> Array:
    """Energy of the part of each column that the others do not hold, (columns,)."""
    size = np.linalg.norm(columns, axis=0)
    gram = (columns / size).T @ (columns / size)
    return np.asarray(size**2 / np.diag(np.linalg.inv(gram + 1e-12 * np.eye(len(size)))))


def _with_noise(prepared: Prepared) -> list[Piece]:
    """The pieces with noise of their reading once more, of the same size and band."""
    random = np.random.default_rng(0)
    return [_noisier(piece, prepared.has_position, random) for piece in prepared.pieces]


def _noisier(piece: Piece, has_position: bool, random: np.random.Generator) -> Piece:
    white = random.standard_normal(len(piece.t)) * piece.reading_noise / sqrt(piece.dt)
    noise = lowpass(white, piece.dt, max(piece.cutoff, piece.motion))
    if not has_position:
        return replace(piece, v=piece.v + noise, a=piece.a + derivative(noise, piece.dt))
    speed = derivative(noise, piece.dt)
    return replace(piece, q=piece.q + noise, v=piece.v + speed, a=piece.a + derivative(speed, piece.dt))


NAMES = {
    "inertia": ("inertia", "motion that speeds up and slows down"),
    "Fc": ("Coulomb friction", "constant speeds, fast and slow"),
    "sigma2": ("viscous friction", "constant speeds, fast and slow"),
    "Fs": ("break-away level", "slow motion and reversals"),
    "Vs": ("Stribeck speed", "slow motion and reversals"),
    "delta": ("Stribeck exponent", "slow motion and reversals"),
    "sigma0": ("stiffness before break-away", "small reversals"),
    "sigma1": ("damping before break-away", "small reversals"),
}
"""What the last part of a parameter's name means, and which motion shows it."""


@dataclass(frozen=True)
class NotDetermined:
    """One number: its variable as the card has it, the value that is delivered, and on which side it is limited."""

    variable: Variable
    value: float
    limit: Limited | None = None
    is_simulated: bool = True
    """Whether all numbers could be fitted at once; without a simulated loop `identify` has only its other ways."""

    def as_json(self) -> JsonObject:
        """The entry as JSON holds it: `limit` is "highest", "lowest", or null where nothing is known."""
        limit = ("highest" if self.limit.is_highest else "lowest") if self.limit else None
        return {"value": self.value, "unit": self.variable.unit, "limit": limit, "statement": self.statement}

    @property
    def statement(self) -> str:
        """One sentence: what is not determined, what the card holds, which motion would show it."""
        name = self.variable.name
        words, motion = next((NAMES[part] for part in name.split(".") if part in NAMES), ("number", ""))
        record = f" Recordings of {motion} would determine it." if motion else ""
        value, given = (
            joined(number(one, 3), raised(self.variable.unit.removeprefix("1")))
            for one in (self.value, self.variable.start)
        )
        if not self.is_simulated:
            by = f"Without a simulated loop no way here determines the {words} ({name}): the card's {value} is kept"
            return f"{by}; cosim diagnose refits it from the torque."
        if not self.limit:
            return f"These recordings do not determine the {words} ({name}): the card's {value} is kept.{record}"
        most = "most" if self.limit.is_highest else "least"
        known = f"only show that the {words} ({name}) is at {most} {value}"
        return f"These recordings {known}; the card had {given}, and now holds that limit.{record}"


def not_determined(problem: Problem, limits: Mapping[str, Limited]) -> tuple[NotDetermined, ...]:
    """All numbers that a diagnosis delivers without having found them: those held, and those at a limit."""
    known = {variable.name: variable for variable in problem.mount.parameters()}
    held = (NotDetermined(known[name], known[name].start) for name in problem.held)
    return (*held, *(NotDetermined(known[name], one.value, one) for name, one in limits.items()))
