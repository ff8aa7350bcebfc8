"""Set points of machines other than telescopes: strokes at constant speed, jogs, stairs, one-way turning, tones, sines.

Speeds are drawn as steps and smoothed by a Hann window, so that speed and acceleration stay finite and nothing moves
before the start. Every motion starts at rest at `home`.
"""

from collections.abc import Callable, Iterator

import numpy as np

from cosim.support.statistics import hann
from cosim_studies.proof.motion import Motion, Pace, placed, product
from cosim_studies.proof.truth import TICK, Array

Leg = tuple[float, float]
"""A speed as a share of the typical peak, and the seconds for which it is held."""


def _ridden(pace: Pace, legs: Iterator[Leg], ramp: float) -> Motion:
    """Hold the speeds of the legs one after the other, with ramps of so many seconds between them."""
    n = pace.time.size
    speed, first = np.zeros(n), round(0.5 / TICK)
    for share, seconds in legs:
        last = first + max(1, round(seconds / TICK))
        speed[first:last] = share * pace.speed
        if (first := last) >= n:
            break
    return _from_speed(pace, _smoothed(speed, ramp))


def _smoothed(x: Array, seconds: float) -> Array:
    """`x` behind a Hann window of so many seconds."""
    from scipy.signal import fftconvolve  # nearly a second that telescopes do not need

    window = hann(max(3, round(seconds / TICK)) + 2)
    return np.asarray(fftconvolve(x, window / window.sum())[: x.size])


def _from_speed(pace: Pace, v: Array) -> Motion:
    return Motion(pace.home + np.cumsum(v) * TICK, v, np.gradient(v, TICK))


def _ramp(pace: Pace, rng: np.random.Generator) -> float:
    return float(rng.uniform(0.05, 0.25)) / pace.hertz


def _within(
    pace: Pace, rng: np.random.Generator, least: float, most: float, rests: tuple[float, float]
) -> Iterator[Leg]:
    """Moves over a share `least` to `most` of the travel, never beyond it, each followed by a rest."""
    here = 0.0
    while True:
        reach = 2 * pace.amplitude * float(rng.uniform(least, most))
        side = -np.sign(here) if abs(here) > 1e-12 and rng.random() < 0.5 + abs(here) / 2 / pace.amplitude else 1.0
        there = float(np.clip(here + side * reach, -pace.amplitude, pace.amplitude))
        share = float(np.exp(rng.uniform(np.log(0.15), 0.0)))
        if abs(there - here) > 0.02 * pace.amplitude:
            yield float(np.copysign(share, there - here)), abs(there - here) / (share * pace.speed)
            yield 0.0, float(rng.uniform(*rests))
        here = there if abs(there) < pace.amplitude else 0.999 * there


def shuttle(pace: Pace, rng: np.random.Generator) -> Motion:
    """To and fro over most of the travel, each stroke at a speed of its own: a ball screw's day."""
    return _ridden(pace, _strokes(pace, rng), _ramp(pace, rng))


def _strokes(pace: Pace, rng: np.random.Generator) -> Iterator[Leg]:
    here = 0.0
    while True:
        edge = pace.amplitude * float(rng.uniform(0.7, 1.0))
        there = -edge if here > 0 else edge
        share = float(np.exp(rng.uniform(np.log(0.1), 0.0)))
        yield float(np.copysign(share, there - here)), abs(there - here) / (share * pace.speed)
        here = there


def jogs(pace: Pace, rng: np.random.Generator) -> Motion:
    """Moves to anywhere with rests between them: pick and place."""
    return _ridden(pace, _within(pace, rng, 0.1, 0.8, (0.2, 1.5)), _ramp(pace, rng))


def stairs(pace: Pace, rng: np.random.Generator) -> Motion:
    """Small steps with short rests."""
    return _ridden(pace, _within(pace, rng, 0.02, 0.15, (0.1, 0.6)), _ramp(pace, rng) / 3)


def turning(pace: Pace, rng: np.random.Generator) -> Motion:
    """Round and round: the speed changes, the direction hardly ever."""

    def legs() -> Iterator[Leg]:
        while True:
            way = -1.0 if rng.random() < 0.1 else 1.0
            yield way * float(rng.uniform(0.05, 1.0)), float(rng.uniform(2, 7))

    return _ridden(pace, legs(), 2 * _ramp(pace, rng))


def tones(pace: Pace, rng: np.random.Generator) -> Motion:
    """Twenty tones up to six times the pace, alike in speed: what an identification would ask for."""
    q, v, a = np.zeros((3, pace.time.size))
    for hertz in pace.hertz * np.exp(rng.uniform(np.log(0.3), np.log(6.0), 20)):
        w, phase = 2 * np.pi * hertz, float(rng.uniform(0, 2 * np.pi))
        q += np.sin(w * pace.time + phase) / w
        v += np.cos(w * pace.time + phase)
        a -= w * np.sin(w * pace.time + phase)
    whole = placed(pace, Motion(q, v, a))
    share = min(1.0, 1.3 * pace.speed / float(np.max(np.abs(whole.v))))
    return Motion(pace.home + share * (whole.q - pace.home), share * whole.v, share * whole.a)


def sines(pace: Pace, rng: np.random.Generator) -> Motion:
    """One pitch, whose amplitude goes up and down in steps."""
    w, n = 2 * np.pi * pace.hertz, pace.time.size
    levels = np.repeat(rng.uniform(0.25, 1.0, 6), -(-n // 6))[:n]
    size = _smoothed(levels, 1.0 / pace.hertz)
    breath = Motion(size, np.gradient(size, TICK), np.gradient(np.gradient(size, TICK), TICK))
    phase = w * pace.time
    return placed(pace, product(breath, Motion(np.sin(phase), w * np.cos(phase), -(w**2) * np.sin(phase))))


STROKES: dict[str, Callable[[Pace, np.random.Generator], Motion]] = {
    "shuttle": shuttle,
    "jogs": jogs,
    "stairs": stairs,
    "turning": turning,
    "tones": tones,
    "sines": sines,
}
