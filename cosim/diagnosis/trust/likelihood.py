"""How likely each explanation makes what was recorded: log-likelihoods of independent pieces of evidence, added up.

- the inertia and the friction that torque and motion imply, beside the card's;
- the sign of the torque: inertia, friction and viscosity take energy, they give none;
- gravity, which comes once in a turn of the axis: in how many turns of the reading?
- columns that tell the same twice: a set point beside the position, a measured speed beside its slope;
- the sample rate, beside the card's and those of real machines; the torque limit.

No single piece may say more than `Policy.clear`: each rests on a model of its own that may be wrong.
"""

from dataclasses import dataclass
from functools import cached_property
from math import copysign, exp, log, pi

import numpy as np

from cosim.data.recording import Recording
from cosim.data.speeds import times_slope
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.trust.balance import Balance, Estimate
from cosim.diagnosis.trust.explanations import ANY_FRICTION, ANY_INERTIA, Explanation
from cosim.estimation.prepare import LEAST_SECONDS, Array

MOST_GRAVITY = 6.0
"""Nats: a ripple twice a turn, or a spring over several, can look like gravity of another order. A wave of which less
than half a turn was seen is a spring; one that was passed in one direction only is any wave over time."""
CONTRADICTS = 0.2
"""|ln| of that slope from which one of the two columns, or the time, is wrong; loops and filters are within a tenth."""
ALIKE = 0.1
"""Spread of ln(slope) of a column on one that tells the same: loops follow their set points to that."""
FOLLOWS = 0.95
"""Squared correlation from which a column tells the same as another."""
DRIVEN = 0.9
"""Correlation of torque and following error from which a position loop without an integral makes the one of the other.
Unit: 1. Twelve runs of a geared servo with such a loop have .93 and more, of 67 generated loops one .92, the others
less than .9."""
USUAL_RATE, RATES = 500.0, 1.6
"""Sample rates of recordings [Hz]: log-normal, a factor of 5 wide."""
SIZES, ANY_SIZES = 1.5, 2.5
"""Spread of ln(torque / what the reference needs): loads make it larger, springs that help make it smaller; and the
same where the reference is of another machine."""
STATED_RATE, OTHER_RATE = 0.02, 0.05
"""A recording is at the card's rate to within the former, or else, in so many cases, was decimated."""
BEYOND_LIMIT = 1.3
"""Torques above the card's limit times this are not the drive's."""
FASTEST = 1e5
"""Hz above which no axis is recorded."""


@dataclass(frozen=True)
class Reference:
    """The inertia and the Coulomb friction that a recording is held against; None: not known."""

    inertia: float
    coulomb: float | None
    torque_limit: float = float("inf")
    record_hz: float | None = None
    linear: bool = False
    is_of_recordings: bool = False
    """Whether it was estimated from these recordings: then it is no witness of their units, and may be any number."""

    def spread_of_inertia(self, explanation: Explanation) -> float:
        """Spread of ln(truth / reference) of the inertia under an explanation."""
        return ANY_INERTIA if self.is_of_recordings else explanation.inertia

    def spread_of_friction(self, explanation: Explanation) -> float:
        """The same of the friction."""
        return ANY_FRICTION if self.is_of_recordings else explanation.friction


class Evidence:
    """What some recordings, held against a reference, say of explanations."""

    def __init__(self, recordings: list[Recording], reference: Reference) -> None:
        self._recordings, self.reference = recordings, reference
        self._balances: dict[float, Balance] = {}

    def of(self, explanation: Explanation) -> float:
        """Log-likelihood of an explanation; -inf where its time cannot be."""
        rate = explanation.time / max(one.sample_time for one in self._recordings)
        if rate > FASTEST or min(one.duration for one in self._recordings) < LEAST_SECONDS * explanation.time:
            return -float("inf")
        balance = self.balance(explanation.time)
        if not balance.is_told:
            return -float("inf")
        # How often gravity comes in one radian of the reading; 0 on a linear axis.
        order = 0.0 if self.reference.linear or explanation.is_counted else 1 / explanation.position
        solution, known = balance.solution(order), self.reference
        torque, position = explanation.torque, explanation.position
        found = _gain(solution.inertia, known.inertia * torque / position, known.spread_of_inertia(explanation))
        if known.coulomb:
            found += _gain(solution.coulomb, known.coulomb * torque, known.spread_of_friction(explanation))
        found -= float(np.logaddexp(0.0, -copysign(1.0, torque) * np.clip(solution.sign, -POLICY.clear, POLICY.clear)))
        sized = self._size(balance, explanation)
        found += sized + self._gravity(balance, order) + self._rate(rate) + self._limit(explanation)
        return found + sum(_slip_likelihood(slope, explanation, kind) for kind, slope in self._slopes)

    def balance(self, time: float) -> Balance:
        """The torque balance where time counts `time` to a second."""
        if time not in self._balances:
            self._balances[time] = Balance(self._recordings, self.reference.linear, time)
        return self._balances[time]

    def _size(self, balance: Balance, explanation: Explanation) -> float:
        """The torque beside what the reference needs for such a motion; loads and balanced springs are the spread."""
        spread = SIZES if self.reference.spread_of_inertia(explanation) < ANY_INERTIA else ANY_SIZES
        needed = self.reference.inertia * balance.acceleration / explanation.position + (self.reference.coulomb or 0.0)
        off = log(balance.torque / abs(explanation.torque) / needed) / spread
        return -0.5 * off**2 - log(spread)

    @staticmethod
    def _gravity(balance: Balance, order: float) -> float:
        if order in (0.0, 1.0) or balance.one_way:
            return 0.0
        one, other = balance.solution(1.0), balance.solution(order)
        rows = min(one.independent, other.independent)
        told = 0.5 * rows * log((one.left + balance.overlooked) / (other.left + balance.overlooked))
        # For another order than the stated one speaks no more than what overlooked physics, one wave, may not leave.
        gain = min(told, 0.5 * (one.left - other.left) / balance.overlooked)
        most = MOST_GRAVITY if order * balance.reach > pi else 0.0
        return float(np.clip(max(one.explained, other.explained) * gain, -MOST_GRAVITY, most))

    def _rate(self, rate: float) -> float:
        usual = -0.5 * (log(rate / USUAL_RATE) / RATES) ** 2
        stated = self.reference.record_hz
        return usual if not stated or abs(log(rate / stated)) < STATED_RATE else usual + log(OTHER_RATE)

    def _limit(self, explanation: Explanation) -> float:
        if not np.isfinite(self.reference.torque_limit) or self.reference.torque_limit <= 0:
            return 0.0
        beyond = self._largest / abs(explanation.torque) / self.reference.torque_limit / BEYOND_LIMIT
        return -min(POLICY.clear, 4 * log(beyond)) if beyond > 1 else 0.0

    @cached_property
    def _largest(self) -> float:
        """Torque that hardly any row exceeds."""
        return max(float(np.quantile(np.abs(one["tau"]), 0.999)) for one in self._recordings)

    @property
    def speed_off(self) -> float:
        """How many times the slope of the position a measured speed is; 1 where none says otherwise."""
        slopes = [abs(slope) for kind, slope in self._slopes if kind == "v"]
        return 1 / slopes[0] if slopes and abs(log(slopes[0])) > CONTRADICTS else 1.0

    @cached_property
    def _slopes(self) -> list[tuple[str, float]]:
        """Slopes of the position on the set point, and of its derivative on a measured speed, where they follow."""
        found = []
        for one in self._recordings[:1]:
            if "q" in one and "q_d" in one and not _droops(one):
                found += [("q_d", slope) for slope in _slope(one["q"], one["q_d"])]
            if "q" in one and "v" in one:
                times, share = times_slope(one.t, one["q"], one["v"])
                found += [("v", 1 / times)] if share > FOLLOWS else []
        return found


NORMAL = np.linspace(-4, 4, 81)
WEIGHT = np.exp(-0.5 * NORMAL**2)
ANYTHING = 16.0
"""Orders of magnitude (in e) that any number may be off: from ns to s, from micrometres to metres."""
EVEN = np.arange(-ANYTHING, ANYTHING, 0.1)


def _gain(found: Estimate, centre: float, spread: float) -> float:
    """Log-likelihood of an estimate whose truth is `centre` e^x, x normal with `spread`, over one that may be anything.

    Anything is positive and of any order of magnitude, x even over +-`ANYTHING`. Both are held against the same
    estimate: so estimates of different balances compare, and their errors cancel.
    """
    return _mean(found, centre, spread * NORMAL, WEIGHT) - _mean(found, abs(centre), EVEN, np.ones(len(EVEN)))


def _mean(found: Estimate, centre: float, x: Array, weight: Array) -> float:
    """Log of the mean likelihood of an estimate whose truth is `centre` e^x."""
    off = (found.value - centre * np.exp(x)) / found.error
    return log(max(float(weight @ np.exp(-0.5 * np.minimum(off**2, 1400.0))) / float(weight.sum()), 1e-300))


def _slope(values: np.ndarray, other: np.ndarray) -> list[float]:
    """Slope of one column on another that it follows, else nothing."""
    if np.ptp(other) <= 0 or np.ptp(values) <= 0:
        return []
    both = np.cov(values, other)
    if both[0, 1] ** 2 < FOLLOWS * both[0, 0] * both[1, 1]:
        return []
    return [float(both[0, 1] / both[1, 1])]


def _droops(recording: Recording) -> bool:
    """Whether what is left between set point and position drives the axis: a loop of finite gain follows by less."""
    left = recording["q_d"] - recording["q"]
    if np.ptp(left) <= 0 or np.ptp(recording["tau"]) <= 0:
        return False
    return bool(np.corrcoef(left, recording["tau"])[0, 1] > DRIVEN)


def _slip_likelihood(slope: float, slip: Explanation, kind: str) -> float:
    """Log-likelihood of such a slope: the slip is in one of the columns, or in both."""
    ticks = 1 / (slip.time * slip.speed) if kind == "v" else 1.0
    found = [exp(-0.5 * (log(abs(slope) / (each * ticks)) / ALIKE) ** 2) for each in {1.0, slip.position}]
    return max(log(sum(found) / len(found) + 1e-300), -POLICY.clear)
