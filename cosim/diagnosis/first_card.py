"""A first card from recordings alone: inertia, friction, a constant torque and a weight, where the motion tells them.

The torque balance of the recordings gives the start (`trust/balance.py`), inverse dynamics the numbers:

    tau = J a + Fc sign(v) + sigma2 v [+ offset] [+ mgl sin(q + phase)]

A constant torque and a weight are taken where their size is clear of its error and they explain a share of the error
that matters; a diagnosis with the card looks for everything else. An inertia that the axis' own motion does not show is
taken from the balance with its neighbours'.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import atan2, isfinite, sqrt
from typing import Literal

import numpy as np

from cosim.data.own_rate import as_analysed
from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.band import in_band
from cosim.diagnosis.search.admissibility import standard_errors
from cosim.diagnosis.trust.balance import Balance
from cosim.estimation.blocks import Blocks, covariance
from cosim.estimation.fit import Fit, fit
from cosim.estimation.neighbours import key
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.problem import Problem
from cosim.estimation.row_weights import CLEAR_MOTION, weights
from cosim.support.errors import InputError, RecordingError
from cosim.support.statistics import SURELY, Z95, column_rms
from pyfmi_models.effects import Effect, GravityUnbalance, TorqueOffset
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import LINEAR_UNITS, Axis, Mount

LEAST_TRAVEL = 0.35
"""Travel [rad] from which a weight differs from a constant torque and a spring: its cosine changes by .06 in 20 deg."""
EVALUATIONS, ROUNDS = 60, 2
"""Evaluations of a fit, and fits one after the other: the pull of a prior towards a rough start dies out."""
LEAST_ROWS = 3
"""Rows for each number that is estimated beside neighbours: of fewer the error of the inertia is not known."""
OnProgress = Callable[[str], None]
Motion = Literal["rotary", "linear"]


@dataclass(frozen=True)
class Number:
    """One number of a card as estimated: value, standard error, and whether the recordings determine it."""

    name: str
    value: float
    error: float
    unit: str
    is_determined: bool

    @property
    def range(self) -> tuple[float, float]:
        """95 % range."""
        return self.value - Z95 * self.error, self.value + Z95 * self.error


@dataclass(frozen=True)
class FirstCard:
    """An axis as estimated from recordings: the mount, its numbers, and what is to be known of it."""

    mount: Mount
    numbers: tuple[Number, ...]
    explained: float
    """Share of the torque's energy that the model explains."""
    notes: tuple[str, ...] = ()

    def number(self, name: str) -> Number:
        """A number by its name."""
        return _number(self.numbers, name)


def first_card(
    recordings: Sequence[Recording],
    motion: Motion,
    inertia: float | None = None,
    on_progress: OnProgress = lambda _: None,
    is_asked: bool = True,
) -> FirstCard:
    """Estimate an axis.

    Args:
        recordings: of one axis; tau, and q or v.
        motion: "rotary" or "linear".
        inertia: where it is known [kg m2, kg]; it is not fitted then.
        on_progress: called with a few words before each fit.
        is_asked: whether an inertia that the recordings do not determine is asked for; else it is taken from their
            limit and said, where that is a part of the torque: then it hardly acts in these motions.

    Raises:
        RecordingError: too little motion, or the recordings do not determine the inertia and it is asked for.
    """
    linear = motion == "linear"
    recordings = [as_analysed(one) for one in recordings]
    on_progress("reading the torque balance")
    problem, best = _with_loads(*_base(recordings, motion, inertia), inertia, on_progress)
    numbers = tuple(_numbers(problem, best, inertia, linear))
    coupled = _with_neighbours(problem, _number(numbers), linear)
    if coupled:
        on_progress("reading the inertia beside the motion of the neighbours")
        problem, best = _with_loads(*_base(recordings, motion, _within(coupled)), _within(coupled), on_progress)
        numbers = (coupled, *_numbers(problem, best, coupled.value, linear)[1:])
    tau = problem.weight * problem.prepared.stacked("tau")
    if is_asked or not _is_small(problem, tau, numbers):
        _check_inertia(numbers, linear)
    left = problem.weight * best.residual
    explained = 1 - float(left @ left) / max(float(tau @ tau), 1e-300)
    notes = _notes(numbers, explained)
    if coupled and coupled.is_determined:
        low, high = coupled.range
        said = f"{coupled.value:.3g} {coupled.unit} (95 %: {low:.3g} to {high:.3g})"
        names = ", ".join(one.name for one in problem.prepared.neighbours)
        notes.insert(0, f"The inertia shows only beside the motion of {names}: {said}.")
    return FirstCard(_held(best.mount, numbers), numbers, explained, tuple(notes))


def _with_loads(problem: Problem, found: Fit, inertia: float | None, on_progress: OnProgress) -> tuple[Problem, Fit]:
    """Add a constant torque and a weight to a base where they are clear."""
    best = found
    for effect in _extras(problem, found):
        on_progress(f"trying {effect.title.lower()}")
        tried = _fitted(problem, replace(best.mount, effects=(*best.mount.effects, effect)), inertia)
        if _is_clear(problem, best, tried):
            best = tried
    return problem, best


def _with_neighbours(problem: Problem, alone: Number, linear: bool) -> Number | None:
    """The inertia beside the neighbours' motion, where the axis' own does not show it and theirs narrows it."""
    if alone.is_determined:
        return None
    value, error = inertia_with_neighbours(problem.prepared, not linear)
    found = replace(alone, value=value, error=error, is_determined=value > SURELY * error)
    return found if error < alone.error and _within(found) > 0 else None


def inertia_with_neighbours(prepared: Prepared, turns: bool) -> tuple[float, float]:
    """Estimate the inertia beside the motion of the neighbours.

        tau = J a + Fc sign(v) + sigma2 v + c + w(q) + sum_n [ h_n a_n + w(q_n) + w(q + q_n) + w(q - q_n) ]

    with w(x) = s sin(x) + r cos(x): the neighbours' accelerations and weights that turn with one axis or with both.
    Linear least squares; what the neighbours do is a nuisance here, which a diagnosis names. An arm of seven joints
    that all move leaves .2 N m of 11 so, and 3.7 without the neighbours.

    Args:
        prepared: recordings with columns of neighbours.
        turns: whether this axis turns: then weights hang on it.

    Returns:
        Inertia and its standard error [kg m2, kg]; an infinite error where no neighbour moves or rows are too few.
    """
    q, v = prepared.stacked("q"), prepared.stacked("v")
    sign = np.tanh(v / (CLEAR_MOTION * np.abs(v).max() + 1e-300))
    shapes = [prepared.stacked("a"), sign, v, np.ones_like(v), *(_weight(q) if turns else ())]
    for one in prepared.neighbours:
        shapes.append(prepared.of_neighbour(key(one.name, "acceleration")))
        if turns and one.turns and one.position:
            angle = prepared.of_neighbour(key(one.name, "position"))
            shapes += [wave for together in (angle, q + angle, q - angle) for wave in _weight(together)]
    columns = np.column_stack(shapes)
    rows, count = columns.shape
    if not prepared.neighbours or rows < LEAST_ROWS * count:
        return 0.0, np.inf
    size = column_rms(columns) + 1e-300
    columns, tau = columns / size, prepared.stacked("tau")
    value = np.linalg.lstsq(columns, tau, rcond=1e-9)[0]
    spread = covariance(columns, tau - columns @ value, Blocks.of(prepared))[0, 0]
    return float(value[0] / size[0]), sqrt(spread * rows / (rows - count)) / float(size[0])


def _weight(angle: Array) -> tuple[Array, Array]:
    return np.sin(angle), np.cos(angle)


def _base(recordings: Sequence[Recording], motion: Motion, inertia: float | None) -> tuple[Problem, Fit]:
    """Inertia, level and viscous friction, from the torque balance on."""
    balance = Balance(recordings, motion == "linear")
    if not balance.is_told:
        text = f"{', '.join(one.name for one in recordings)}: too little motion to estimate an axis from"
        raise RecordingError(f"{text}; record some swings and slews, ten seconds or more.", culprit="motion")
    said = balance.solution(balance.own_order)
    rough = balance.torque / max(balance.acceleration, 1e-300)
    start = inertia or (said.inertia.value if said.inertia.value > said.inertia.error else 0.1 * rough)
    level = said.coulomb.value if said.coulomb.value > said.coulomb.error else 0.3 * balance.torque
    top = float(np.abs(balance.prepared.stacked("v")).max())
    friction = Coulomb(Fc=level, sigma2=0.1 * level / max(top, 1e-300))
    mount = Mount(name="axis", axis=Axis(inertia=start), friction=friction, effects=(), motion=motion)
    for _ in range(ROUNDS):
        prepared = in_band(recordings, mount)
        slowest = max(one.sample_time for one in recordings)
        problem = Problem(mount, prepared, weights(mount.friction, prepared), slowest)
        found = _fitted(problem, mount, inertia)
        mount = found.mount
    return problem, found


def _fitted(problem: Problem, mount: Mount, inertia: float | None) -> Fit:
    """Fit a structure; an inertia that is known stays."""
    fixed = ("axis.inertia",) if inertia else ()
    return fit(mount, problem.prepared.pieces, problem.weight, problem.mount, EVALUATIONS, fixed)


def _extras(problem: Problem, found: Fit) -> list[Effect]:
    """A constant torque, and on an axis that turns far enough a weight, each started where the rest says."""
    extras: list[Effect] = [TorqueOffset(torque=float(np.mean(found.residual)))]
    prepared = problem.prepared
    travel = float(np.ptp(prepared.stacked("q"))) if prepared.has_position else 0.0
    if found.mount.motion == "rotary" and travel > LEAST_TRAVEL:
        q = prepared.stacked("q")
        columns = np.column_stack([np.sin(q), np.cos(q), np.ones_like(q)])
        sine, cosine, _ = np.linalg.lstsq(columns, found.residual, rcond=None)[0].tolist()
        extras.insert(0, GravityUnbalance(mgl=max(float(np.hypot(sine, cosine)), 1e-9), phase=atan2(cosine, sine)))
    return extras


def _is_clear(problem: Problem, without: Fit, tried: Fit) -> bool:
    """Whether the last effect is clear of its error and explains a share of the error that matters."""
    effect = tried.mount.effects[-1]
    prefix = next(name for name, part in tried.mount.components().items() if part is effect)
    errors = standard_errors(tried, Blocks.of(problem.prepared), problem.weight)
    name = f"{prefix}.{effect.main.parameter}"
    value, error = tried.parameters().get(name, 0.0), errors.get(name, np.inf)
    gained = 1 - (problem.error(tried) / max(problem.error(without), 1e-300)) ** 2
    return abs(value) > SURELY * error and gained > POLICY.slight and _is_apart(problem, tried, name)


def _is_apart(problem: Problem, tried: Fit, name: str) -> bool:
    """Whether a number is separable from the sizes of the effects before: over a short way a weight is a constant."""
    spread = covariance(
        tried.slopes * problem.weight[:, None], tried.residual * problem.weight, Blocks.of(problem.prepared)
    )
    error = np.sqrt(np.maximum(np.diag(spread), 1e-300))
    prefix_of = {id(part): prefix for prefix, part in tried.mount.components().items()}
    sizes = {f"{prefix_of[id(effect)]}.{effect.main.parameter}" for effect in tried.mount.effects[:-1]}
    own = tried.free.index(name)
    others = [place for place, other in enumerate(tried.free) if other in sizes]
    return all(abs(spread[own, place]) < POLICY.nearly_all * error[own] * error[place] for place in others)


def _numbers(problem: Problem, found: Fit, inertia: float | None, linear: bool) -> list[Number]:
    errors = standard_errors(found, Blocks.of(problem.prepared), problem.weight)
    known = {variable.name: variable for variable in found.mount.parameters()}
    numbers = [Number("axis.inertia", inertia, 0.0, "kg" if linear else "kg.m2", True)] if inertia else []
    for name, value in found.parameters().items():
        variable, error = known[name], errors[name]
        inside = isfinite(error) and value > variable.low and value < variable.high
        determined = inside and (abs(value) > SURELY * error or name.endswith("phase"))
        unit = LINEAR_UNITS.get(variable.unit, variable.unit) if linear else variable.unit
        numbers.append(Number(name, value, error, unit, determined))
    return numbers


def _held(mount: Mount, numbers: Sequence[Number]) -> Mount:
    """The mount without what the recordings do not determine: friction that is not seen is none."""
    open_ = {one.name: one for one in numbers if not one.is_determined}
    law = mount.friction
    if unknown := open_.get("axis.inertia"):
        mount = replace(mount, axis=replace(mount.axis, inertia=_within(unknown)))
    zero = {name: 0.0 for name in ("Fc", "sigma2") if f"friction.{name}" in open_}
    return replace(mount, friction=replace(law, **zero))  # type: ignore[arg-type]


def _number(numbers: Sequence[Number], name: str = "axis.inertia") -> Number:
    return next(one for one in numbers if one.name == name)


def _is_small(problem: Problem, tau: Array, numbers: Sequence[Number]) -> bool:
    """Whether the axis speeds up and its inertia takes at most a part of the torque, whatever it is."""
    if all(piece.is_steady for piece in problem.prepared.pieces):
        return False
    inertia = _number(numbers)
    most = inertia.range[1] * float(np.linalg.norm(problem.weight * problem.prepared.stacked("a")))
    return most < (1 - POLICY.half) * float(np.linalg.norm(tau))


def _within(inertia: Number) -> float:
    """What is taken for an inertia that is not determined: its estimate, or half of what it may be at most."""
    return max(inertia.value, inertia.range[1] / 2)


def _check_inertia(numbers: Sequence[Number], linear: bool) -> None:
    one = _number(numbers)
    if not one.is_determined:
        what = "mass" if linear else "inertia"
        raise InputError(
            f"These recordings do not determine the {what}: the axis hardly accelerates, or friction hides it. "
            f"Give it to a card (cosim card RUN --inertia VALUE, in {one.unit}), or record faster swings; where other "
            "axes move with it, alone, or with their motion as columns (q2, q3, ...).",
            culprit="inertia",
        )


def _notes(numbers: Sequence[Number], explained: float) -> list[str]:
    notes = []
    inertia = _number(numbers)
    if not inertia.is_determined:
        said = f"{_within(inertia):.3g} {inertia.unit} is taken (95 %: at most {inertia.range[1]:.3g})"
        notes.append(f"The recordings hardly show the inertia: {said}. --card with the true one is better.")
    for name, words in (("friction.Fc", "Coulomb friction"), ("friction.sigma2", "viscous friction")):
        if not _number(numbers, name).is_determined:
            notes.append(f"The recordings do not determine the {words}; the card has none.")
    if explained < POLICY.half:
        notes.append(
            f"The card explains {100 * explained:.0f} % of the torque's energy only: something else acts here."
        )
    return notes
