"""Motions that a mechanic understands, as programmes of moves, rests and tones, and the families that are tried.

A programme starts and ends at rest in the same place; positions count from there. Moves have limited speed,
acceleration and jerk; tones swell and fade with a quintic. So position, speed and acceleration belong together exactly.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import pi
from typing import NamedTuple, Protocol

import numpy as np

from cosim.data.profile import envelope, slews
from cosim.estimation.prepare import Array
from cosim.support.elementary import sine_and_cosine
from cosim_investigation.limits import KEPT, Limits

Sampled = tuple[Array, Array, Array]
"""Position, speed and acceleration, one value a row."""
JERK = 20.0
"""Jerk, as accelerations a second [1/s]: a move reaches its acceleration in 50 ms."""
BELOW = 0.95
"""A tone that would lie in the forbidden band lies at this share of its lower end: one that swells is a little wide."""
SUDDEN = 1e-3
"""Seconds in which full speed is reached at least: more acceleration than that is not used."""
FADE = 1.5
"""Seconds in which tones swell and fade, and rests at both ends of a programme [s]."""


class Part(Protocol):
    """A piece of a programme."""

    def seconds(self, here: float) -> float:
        """How long it takes from `here`."""

    def sampled(self, t: Array, here: float) -> Sampled:
        """Position, speed and acceleration at the times t [s] of the part, from `here`."""

    def end(self, here: float) -> float:
        """Where it ends."""


@dataclass(frozen=True)
class Rest:
    """Stand still."""

    lasts: float

    def seconds(self, here: float) -> float:
        """As long as it lasts."""
        return self.lasts

    def sampled(self, t: Array, here: float) -> Sampled:
        """Nothing changes."""
        return np.full_like(t, here), np.zeros_like(t), np.zeros_like(t)

    def end(self, here: float) -> float:
        """Where it began."""
        return here


@dataclass(frozen=True)
class Move:
    """Go to a position and stop there."""

    to: float
    speed: float
    acceleration: float

    @property
    def _limits(self) -> tuple[float, float, float]:
        return self.speed, self.acceleration, JERK * self.acceleration

    def seconds(self, here: float) -> float:
        """Until it has stopped; at most what a move with room for all ramps takes."""
        way, ramp = abs(self.to - here), self.speed / self.acceleration + 1 / JERK
        if way >= self.speed * ramp:
            return way / self.speed + ramp
        longest = way / self.speed + 2 * ramp
        t = np.linspace(0.0, longest, 400)
        moving = np.flatnonzero(np.abs(self.sampled(t, here)[0] - self.to) > 1e-9 * way)
        return float(t[min(moving[-1] + 1, len(t) - 1)]) if len(moving) else 0.0

    def sampled(self, t: Array, here: float) -> Sampled:
        """Seven pieces of constant jerk."""
        if here == self.to:
            return Rest(0.0).sampled(t, here)
        return slews(t, [here, self.to], [0.0, 0.0], self._limits)

    def end(self, here: float) -> float:
        """Where it was to go."""
        return self.to


@dataclass(frozen=True)
class Tones:
    """Sines about where the axis stands, which swell and fade."""

    lasts: float
    hertz: tuple[float, ...]
    sizes: tuple[float, ...]
    phases: tuple[float, ...]

    def seconds(self, here: float) -> float:
        """As long as it lasts."""
        return self.lasts

    def sampled(self, t: Array, here: float) -> Sampled:
        """The sum of the sines, times a rise and a fall."""
        q, v, a = (np.zeros_like(t) for _ in range(3))
        for hertz, size, phase in zip(self.hertz, self.sizes, self.phases, strict=True):
            w = 2 * pi * hertz
            sine, cosine = sine_and_cosine(w * t + phase)
            q, v, a = q + size * sine, v + size * w * cosine, a - w * w * (size * sine)
        q, v, a = envelope((q, v, a), t, FADE)
        q, v, a = envelope((q, -v, a), self.lasts - t, FADE)
        return here + q, -v, a

    def end(self, here: float) -> float:
        """Where it began."""
        return here


@dataclass(frozen=True)
class Motion:
    """A programme by name: the family it is of, the sentence that orders it, and its parts."""

    family: str
    title: str
    parts: tuple[Part, ...]

    @property
    def seconds(self) -> float:
        """How long it takes."""
        return sum(part.seconds(here) for part, here in self._placed())

    def sampled(self, t: Array) -> Sampled:
        """The whole programme at times t [s] from 0 on; it rests where it ends."""
        found, starts, ways = np.zeros((3, len(t))), 0.0, list(self._placed())
        for part, here in ways:
            rows = t >= starts
            lasts = part.seconds(here)
            found[:, rows] = part.sampled(np.minimum(t[rows] - starts, lasts), here)
            starts += lasts
        found[:, t >= starts] = [[ways[-1][0].end(ways[-1][1])], [0.0], [0.0]]
        return found[0], found[1], found[2]

    def _placed(self) -> Iterator[tuple[Part, float]]:
        here = 0.0
        for part in self.parts:
            yield part, here
            here = part.end(here)


class Room(NamedTuple):
    """What a motion may use: positions from where the axis stands, first end first; speed, acceleration, frequency."""

    first: float
    second: float
    speed: float
    acceleration: float
    frequency: float
    seconds: float
    seed: int
    forbidden: tuple[float, float] = (0.0, 0.0)
    """Band [Hz] in which no tone lies."""

    @property
    def reach(self) -> float:
        """Way from end to end."""
        return abs(self.first - self.second)

    @property
    def middle(self) -> float:
        """Half-way between both ends."""
        return (self.first + self.second) / 2

    def outside(self, hertz: float) -> float:
        """The frequency itself, or one below the forbidden band where it lies in it."""
        low, high = self.forbidden
        return BELOW * low if BELOW * low < hertz < high / BELOW else hertz

    def slower(self, share: float) -> "Room":
        """The same with a share of speed and acceleration."""
        return self._replace(speed=share * self.speed, acceleration=share * self.acceleration)

    def nearer(self, share: float) -> "Room":
        """The same with a share of the way to both ends."""
        return self._replace(first=share * self.first, second=share * self.second)


def room_of(limits: Limits, home: float, seconds: float, seed: int, turned: bool) -> Room:
    """The room inside limits for an axis that stands at `home`; `turned` begins with the other end."""
    middle, half = (limits.high + limits.low) / 2, KEPT * (limits.high - limits.low) / 2
    ends = (min(middle - half, home) - home, max(middle + half, home) - home)
    first, second = ends if turned else ends[::-1]
    usable = KEPT * limits.frequency
    band = limits.forbidden_from, limits.forbidden_to
    acceleration = min(KEPT * limits.acceleration, KEPT * limits.speed / SUDDEN)
    return Room(first, second, KEPT * limits.speed, acceleration, usable, seconds, seed, band)
