"""Which motion tells most: the expected log-odds between structures, after a refit to all recordings together.

Each motion of the programme is put through both structures of a duel. If ours is right, the recording would be its
torque and noise; the other is then refitted, to first order and with all of its parameters free, to the old
recordings and the new one. What it cannot follow, d, decides:

    expected log-odds = sum d^2 / (2 sigma^2 tau)        [nats]

with sigma the RMS of the residual that our structure leaves now and tau its correlation in rows. The other way round it
is computed too, and the smaller of both counts; but a structure follows its own special case perfectly, so between such
two it is asked what would show if the general one were right. Parameters that the old recordings tell badly are what a
refit uses to follow, so their uncertainty is in it. What is not between two structures (something without a name, an
effect that no recording could show) is sought where nothing was visited yet.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from cosim.diagnosis.effects import candidates
from cosim.diagnosis.effects.candidates import contact_level
from cosim.estimation.filters import lowpass
from cosim.estimation.fit import Fit, free_parameters
from cosim.estimation.inverse import Inverse
from cosim.estimation.least_squares import projected
from cosim.estimation.prepare import Array, Piece, Prepared
from cosim.estimation.problem import Problem
from cosim_investigation.families import AT_RANDOM, FAMILIES
from cosim_investigation.ground import new_ground, visited
from cosim_investigation.limits import KEPT, Limits
from cosim_investigation.motions import FADE, JERK, Motion, Room
from cosim_investigation.questions import Duel
from pyfmi_models.effects.base import TonalEffect
from pyfmi_models.mount import Mount

ENOUGH = 10.0
"""Nats at which a question counts as settled: more for one is not worth less for another (odds of 20 000)."""
LEAST = 2.0
"""Nats below which a motion is not worth running: odds of 7, less than the margin of a set."""

LEAST_GROUND = 0.1
"""Share of new ground below which a motion shows nothing new. Unit: 1."""


@dataclass(frozen=True)
class Plan:
    """A motion that may be run, the nats that it promises for each duel, and the share of it that is new ground."""

    motion: Motion
    nats: tuple[float, ...]
    ground: float
    shows: int = 0
    """Effects that could not be tested so far and that it would show."""
    at_random: tuple[float, float] | None = None
    """Worth and new ground of many tones at random in its place, for as long; None where those would leave a limit."""

    @property
    def worth(self) -> float:
        """Nats for all duels together, each counted up to what settles it."""
        return sum(min(one, ENOUGH) for one in self.nats)


SPARE, GROWTH = 4.0, 3
"""Torque that must be left over, in units of the RMS that the model leaves: for noise, and for what it lacks. Beyond
the positions, speeds and accelerations of the recordings it grows by this power of how far beyond: so steeply grows a
cable that hardens (q^3), and 4 s^3 RMS covers what a drag of v^2 is off the best line through speeds up to v/s. At
faster reversals it is for an inertia that slow ones told badly, and for what the loop adds there. Unit: 1."""
RAMP = 20
"""Rows in which a motion reaches its acceleration, for the torque that it asks for: misses a peak by 3 % at most."""
SMALLER = ((1.0, 1.0), (0.5, 1.0), (0.25, 1.0), (0.5, 0.5), (0.25, 0.25))
"""Shares of speed and acceleration, and of the way, at which a motion is tried until it leaves no limit. Unit: 1."""


@dataclass(frozen=True)
class Refusal:
    """A motion that is not run, and which limit it would have left."""

    motion: Motion
    limit: str


class Rated(NamedTuple):
    """Motions that may be run, and those that may not."""

    plans: tuple[Plan, ...]
    refused: tuple[Refusal, ...]


def plans(
    room: Room,
    problem: Problem,
    ours: Fit,
    duels: Sequence[Duel],
    limits: Limits,
    home: float,
    untested: Collection[str] = (),
) -> Rated:
    """Rate a motion of every family that keeps to the limits, by set point and by the torque that the model says.

    `untested`: effects that no recording could show so far, and are in question. A motion that would leave the limits
    is tried again slower, then nearer to where the axis stands, and refused at last.
    """
    weighed = [_Weighed(problem, duel) for duel in duels]
    seen = visited(problem.prepared, limits)
    good, refused = list[Plan](), list[Refusal]()
    for family in FAMILIES:
        motion, piece, limit = allowed(family, room, ours, problem.prepared, limits, home)
        if limit:
            refused.append(Refusal(motion, limit))
            continue
        shows = len(shown_by_motion(untested, ours, [replace(piece, recording=0)], ours.rms))
        good.append(Plan(motion, tuple(one.nats(piece) for one in weighed), new_ground(piece, seen, limits), shows))
    return Rated(tuple(good), tuple(refused))


def pieces_of(room: Room, ours: Fit, problem: Problem, limits: Limits, home: float) -> list[Piece]:
    """What motions of every family would visit, those that leave no limit."""
    found = (allowed(family, room, ours, problem.prepared, limits, home) for family in FAMILIES)
    return [replace(piece, recording=k) for k, (_, piece, limit) in enumerate(found) if not limit]


def allowed(
    family: Callable[[Room], Motion], room: Room, ours: Fit, known: Prepared, limits: Limits, home: float
) -> tuple[Motion, Piece, str]:
    """The largest motion of a family that leaves no limit, as a piece; or the smallest and the limit that it leaves.

    `known`: the recordings that our structure was fitted to.
    """
    within = limits.less(*strayed(known))
    for share, way in SMALLER:
        motion = family(room.slower(share).nearer(way))
        piece, limit = piece_of(motion, home, known.cutoff, within)
        limit = limit or limits.torque_left(torque_asked(motion, home, piece, ours, known) / KEPT)
        if not limit:
            break
    return motion, piece, limit


def strayed(known: Prepared) -> tuple[float, float]:
    """How far, and how much faster, the axis was at most than its set point in recordings; 0 where they have none.

    A loop that friction lets go at a reversal overshoots by a speed of its own, however slow the motion is.
    """
    far, fast = 0.0, 0.0
    for piece in (one for one in known.pieces if "q_d" in one.extras):
        gap = piece.q - piece.lowpass(piece.extras["q_d"])
        gap = gap - np.median(gap)  # the set point may count from elsewhere
        far = max(far, float(np.abs(gap[piece.inside]).max()))
        fast = max(fast, float(np.abs(np.gradient(gap, piece.dt)[piece.inside]).max()))
    return far, fast


def spare(known: Prepared, piece: Piece, rms: float) -> Array:
    """Torque to leave over at each row of a motion, for what a model lacks that leaves an RMS on known recordings."""
    low, high = known.ranges["q"]
    pairs = ((piece.q - (low + high) / 2, (high - low) / 2), *((getattr(piece, k), _top(known, k)) for k in "va"))
    beyond = np.maximum(1.0, np.max([np.abs(one) / max(most, 1e-300) for one, most in pairs], axis=0))
    return np.asarray(SPARE * rms * beyond**GROWTH)


def torque_asked(motion: Motion, home: float, piece: Piece, ours: Fit, known: Prepared) -> Array:
    """Torque of a motion as it is asked, and what is to be left over: a low-pass takes a quarter of a move of 50 ms."""
    asked = _as_asked(motion, home)
    return np.asarray(np.abs(torque_of(ours, asked)) + np.interp(asked.t, piece.t, spare(known, piece, ours.rms)))


def torque_predicted(motion: Motion, home: float, mount: Mount) -> Array:
    """Torque of a motion as it is asked, by a card alone, as long as nothing was recorded."""
    return _of_mount(mount, _as_asked(motion, home))


def _as_asked(motion: Motion, home: float) -> Piece:
    """A motion without a low-pass, in steps that show its ramps."""
    rate = RAMP * JERK
    t: Array = np.arange(0.0, motion.seconds, 1 / rate)
    q, v, a = motion.sampled(t)
    return Piece(0, t, q + home, v, a, np.zeros_like(t), np.ones(len(t), bool), 1 / rate, rate / 4, 1)


def _top(known: Prepared, name: str) -> float:
    return float(np.abs(known.stacked(name)).max())


def best(found: Sequence[Plan], has_duels: bool, done: Sequence[str] = ()) -> Plan | None:
    """The plan that tells most; without a duel the one that shows most, then of most new ground, each family once."""
    if has_duels:
        top = max(found, key=lambda one: (one.worth, one.shows, one.ground), default=None)
        return top if top and top.worth >= LEAST else None
    fresh = [one for one in found if one.motion.family not in done and one.ground >= LEAST_GROUND]
    return max(fresh, key=lambda one: (round(one.worth), one.shows, one.ground), default=None)


def beside_random(plan: Plan, found: Sequence[Plan]) -> Plan:
    """The plan with what motion at random, among those that may be run, promises in its place."""
    tones = next((one for one in found if one.motion.family == AT_RANDOM), None)
    return replace(plan, at_random=(tones.worth, tones.ground)) if tones else plan


def shown_by_motion(names: Collection[str], ours: Fit, pieces: Sequence[Piece], noise: float) -> set[str]:
    """Of some effects those that a diagnosis would look for in recordings of these motions, with noise.

    What needs another load, or a quantity that nothing records, is not among them.
    """
    planned = Prepared(("planned",), tuple(pieces), pieces[0].cutoff, True)
    residual = noise * np.random.default_rng(0).standard_normal(len(planned.recording_of))
    level = np.full(len(residual), contact_level(ours.mount))
    return {one.effect for one in candidates(ours.mount, planned, residual, level, names)} if names else set()


def piece_of(motion: Motion, home: float, cutoff: float, limits: Limits) -> tuple[Piece, str]:
    """A motion as a piece of a recording, at the rate of the analysis; and the limit that it leaves, "" if none."""
    dt = 1 / (8 * cutoff)
    t: Array = dt * np.arange(max(int(motion.seconds / dt), 64), dtype=float)
    asked = motion.sampled(t)
    left = limits.left_by(asked[0] + home, *asked[1:])
    q, v, a = (lowpass(row, dt, cutoff) for row in asked)
    inside = np.asarray((t > FADE / 2) & (t < t[-1] - FADE / 2))
    return Piece(0, t, q + home, v, a, np.zeros_like(t), inside, dt, cutoff, 3), left


def torque_of(fit: Fit, piece: Piece) -> Array:
    """Torque that a fitted structure needs for a motion; what shakes the axis in any phase."""
    return _of_mount(fit.mount, piece)


def _of_mount(mount: Mount, piece: Piece) -> Array:
    tones = [one for one in mount.effects if isinstance(one, TonalEffect)]
    still = replace(mount, effects=tuple(one for one in mount.effects if not isinstance(one, TonalEffect)))
    torque = Inverse(still, ()).torque(piece, np.zeros(0))[0]
    for hertz, size in (one.wave() for one in tones):
        torque = torque + float(size) * np.sin(2 * np.pi * float(hertz) * piece.t)
    return torque


class _Weighed:
    """A duel with what the old recordings say: both ways, what is refitted and what it leaves there."""

    def __init__(self, problem: Problem, duel: Duel) -> None:
        ways = ((duel.ours, duel.other), (duel.other, duel.ours))
        used = {"ours": ways[:1], "other": ways[1:]}.get(duel.general, ways)
        self._ways = [_Way(problem, true, refitted) for true, refitted in used]

    def nats(self, piece: Piece) -> float:
        """The smaller of both expectations; that of the general structure where the other is a special case of it."""
        return min(way.nats(piece) for way in self._ways)


class _Way:
    def __init__(self, problem: Problem, true: Fit, refitted: Fit) -> None:
        self._true, self._mount = true, refitted.mount
        self._inverse = Inverse(refitted.mount, free_parameters(refitted.mount))
        self._weight = problem.weight
        self._gap, self._slopes = true.torque - refitted.torque, refitted.slopes
        self._noise = _noise(true.residual[problem.weight > 0])
        self._before = _energy(*self._old())

    def nats(self, piece: Piece) -> float:
        torque = torque_of(self._true, piece)
        other, slopes = self._inverse.torque(replace(piece, tau=torque), self._inverse.present)
        gap, old = (torque - other)[piece.kept], self._old()
        joint = np.concatenate([old[0], gap]), np.concatenate([old[1], slopes[piece.kept]])
        return max(_energy(*joint) - self._before, 0.0) / (2 * self._noise)

    def _old(self) -> tuple[Array, Array]:
        return self._weight * self._gap, self._weight[:, None] * self._slopes


def _energy(target: Array, columns: Array) -> float:
    left = projected(target, columns)
    return float(left @ left)


def _noise(residual: Array) -> float:
    """Variance of the residual times its correlation in rows: what a sum of squares over rows is divided by."""
    x = residual - residual.mean()
    power = float(x @ x) / max(len(x), 1)
    correlation, shift = 1.0, 1
    while shift < len(x) // 4:
        now = float(x[shift:] @ x[:-shift]) / len(x) / max(power, 1e-300)
        if now <= 0.05:
            break
        correlation, shift = correlation + 2 * now, shift + 1
    return max(power * correlation, 1e-300)


__all__ = [
    *("Plan", "Rated", "Refusal", "allowed", "beside_random", "best", "piece_of", "plans", "torque_of"),
    "torque_predicted",
]
