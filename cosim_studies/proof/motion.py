"""Set points for concealed recordings of a telescope: smooth, with speed and acceleration in closed form.

Every motion starts at rest at `home`; `amplitude` [rad] bounds the travel and `hertz` sets its pace.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cosim_studies.proof.truth import TICK, Array, ticks


class Motion(NamedTuple):
    """Position, speed and acceleration of the set point, one value a tick."""

    q: Array
    v: Array
    a: Array


class Pace(NamedTuple):
    """How far and how fast a mount is used."""

    home: float
    amplitude: float
    hertz: float
    duration: float

    @property
    def time(self) -> Array:
        """Ticks of the loop [s]."""
        return ticks(round(self.duration / TICK))

    @property
    def speed(self) -> float:
        """Typical peak speed [rad/s]."""
        return 2 * np.pi * self.hertz * self.amplitude


def _soft(pace: Pace) -> Motion:
    """A quintic step from 0 to 1 over two fifths of a typical period, with its derivatives."""
    takes = max(2.0, 0.4 / pace.hertz)
    x = np.minimum(pace.time / takes, 1)
    q = x**3 * (10 - 15 * x + 6 * x**2)
    v = 30 * x**2 * (1 - x) ** 2 / takes
    return Motion(q, v, 60 * x * (1 - x) * (1 - 2 * x) / takes**2)


def product(f: Motion, g: Motion) -> Motion:
    """The product of two motions, with its derivatives."""
    return Motion(f.q * g.q, f.v * g.q + f.q * g.v, f.a * g.q + 2 * f.v * g.v + f.q * g.a)


def placed(pace: Pace, wave: Motion) -> Motion:
    """`wave` started softly, scaled to the travel and set at home."""
    soft = product(_soft(pace), wave)
    scale = pace.amplitude / float(np.max(np.abs(soft.q)))
    return Motion(pace.home + scale * soft.q, scale * soft.v, scale * soft.a)


def wander(pace: Pace, rng: np.random.Generator) -> Motion:
    """A sum of eight tones of unrelated pitch; high ones are small."""
    pitch = pace.hertz * np.exp(rng.uniform(np.log(0.35), np.log(3.0), 8))
    weight = rng.uniform(0.5, 1.5, 8) * (pace.hertz / pitch) ** 1.3
    q, v, a = np.zeros((3, pace.time.size))
    for w, angle, phase in zip(weight, 2 * np.pi * pitch, rng.uniform(0, 2 * np.pi, 8), strict=True):
        wave = w * np.sin(angle * pace.time + phase)
        q += wave
        v += w * angle * np.cos(angle * pace.time + phase)
        a -= angle**2 * wave
    return placed(pace, Motion(q, v, a))


def slews(pace: Pace, rng: np.random.Generator) -> Motion:
    """Point to point with rests of 0.3 to 8 s, some moves at crawling speed: how a telescope spends its night."""
    motion = Motion(np.full(pace.time.size, pace.home), *np.zeros((2, pace.time.size)))
    start, here = 0.5, pace.home
    while start < pace.duration:
        there, takes = _next_move(pace, rng, here)
        _move(motion, start, takes, here, there)
        start, here = start + takes + float(np.exp(rng.uniform(np.log(0.3), np.log(8.0)))), there
    return motion


def _next_move(pace: Pace, rng: np.random.Generator, here: float) -> tuple[float, float]:
    """Next target and the seconds it takes; every third move crawls, the way a star is followed."""
    there = pace.home + pace.amplitude * float(rng.uniform(-1, 1))
    if rng.random() < 0.33:
        takes = float(rng.uniform(3, 8))
        reach = 0.03 * pace.speed * takes * float(rng.uniform(0.3, 2))
        return here - float(np.copysign(reach, here - pace.home)), takes
    distance, brisk = abs(there - here), float(rng.uniform(0.5, 1.0))
    hardest = 3 * pace.speed * 2 * np.pi * pace.hertz
    return there, max(1.2, 1.9 * distance / (pace.speed * brisk), float(np.sqrt(5.8 * distance / hardest)))


def _move(motion: Motion, start: float, takes: float, here: float, there: float) -> None:
    """Write one minimum-jerk move into `motion`, and rest at its end."""
    first = round(start / TICK)
    x = np.minimum((np.arange(motion.q.size - first) * TICK) / takes, 1)
    d = there - here
    motion.q[first:] = here + d * x**3 * (10 - 15 * x + 6 * x**2)
    motion.v[first:] = d / takes * 30 * x**2 * (1 - x) ** 2
    motion.a[first:] = d / takes**2 * 60 * x * (1 - x) * (1 - 2 * x)


def swell(pace: Pace, rng: np.random.Generator) -> Motion:
    """An oscillation whose amplitude breathes and whose pitch glides: seen by no training recording."""
    t, w = pace.time, 2 * np.pi * pace.hertz * float(rng.uniform(0.8, 1.1))
    slow, deep = w * float(rng.uniform(0.17, 0.23)), float(rng.uniform(0.2, 0.35))
    glide = w * float(rng.uniform(-0.3, 0.5)) / pace.duration
    phase, rate = w * t + 0.5 * glide * t**2, w + glide * t
    tone = Motion(np.sin(phase), rate * np.cos(phase), glide * np.cos(phase) - rate**2 * np.sin(phase))
    breath = Motion(
        1 - deep + deep * np.cos(slow * t), -deep * slow * np.sin(slow * t), -deep * slow**2 * np.cos(slow * t)
    )
    return placed(pace, product(breath, tone))


def chirp(pace: Pace, rng: np.random.Generator) -> Motion:
    """A warped sweep: pitch itself swings between half and twice the pace."""
    t, w = pace.time, 2 * np.pi * pace.hertz
    turn, depth = w * float(rng.uniform(0.1, 0.16)), float(rng.uniform(0.4, 0.6))
    phase = w * t - depth * w / turn * np.sin(turn * t) + float(rng.uniform(0, 6))
    rate, change = w * (1 - depth * np.cos(turn * t)), w * depth * turn * np.sin(turn * t)
    return placed(pace, Motion(np.sin(phase), rate * np.cos(phase), change * np.cos(phase) - rate**2 * np.sin(phase)))


def with_tremble(motion: Motion, rng: np.random.Generator, share: float) -> Motion:
    """`motion` with two bursts of a faint tremble, 2 to 20 Hz, whose acceleration is `share` of the motion's peak."""
    strength = share * float(np.quantile(np.abs(motion.a), 0.98))
    time, total = ticks(motion.q.size), motion
    for place in (rng.uniform(0.15, 0.45), rng.uniform(0.55, 0.85)):
        pitches = np.array([2 * np.pi * np.exp(rng.uniform(np.log(2), np.log(20))) for _ in range(5)])
        burst = _burst(time - place * time[-1], float(rng.uniform(2, 4)), pitches, rng)
        scale = strength / float(np.max(np.abs(burst.a)))
        total = Motion(*(whole + scale * part for whole, part in zip(total, burst, strict=True)))
    return total


def _burst(time: Array, half: float, pitches: Array, rng: np.random.Generator) -> Motion:
    """Tones of equal acceleration under a cos^4 window of +- `half` seconds."""
    x = np.clip(time / half, -1, 1) * np.pi / 2
    c, s, w = np.cos(x), np.sin(x), np.pi / 2 / half
    window = Motion(c**4, -4 * w * c**3 * s, 4 * w**2 * c**2 * (3 * s**2 - c**2))
    phases = rng.uniform(0, 2 * np.pi, pitches.size)[:, None] + pitches[:, None] * time
    power = pitches[:, None]
    tones = Motion(*(np.sum(f, axis=0) for f in (np.sin(phases) / power**2, np.cos(phases) / power, -np.sin(phases))))
    return product(window, tones)


MOTIONS: dict[str, Callable[[Pace, np.random.Generator], Motion]] = {
    "wander": wander,
    "slews": slews,
    "swell": swell,
    "chirp": chirp,
}
