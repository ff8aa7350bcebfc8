"""Motions whose position, velocity and acceleration belong together exactly.

Powers are written as products: `**` asks libm, which differs between machines in the last bit.
"""

from itertools import pairwise
from math import sqrt

import numpy as np

from cosim.support.elementary import cube_root

Motion = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Position, velocity and acceleration, each of the shape of t."""


def envelope(motion: Motion, t: np.ndarray, rise: float) -> Motion:
    """Multiply a motion by a quintic that goes from 0 to 1 in `rise` seconds, with the product rule for derivatives.

    s(x) = 10 x^3 - 15 x^4 + 6 x^5,  x = t / rise,  s'' continuous
    """
    if rise <= 0:
        return motion
    x = np.clip(t / rise, 0.0, 1.0)
    bump = x * (1 - x)
    s = x * x * x * (10 - x * (15 - 6 * x))
    ds = 30 * bump * bump / rise
    dds = 60 * bump * (1 - 2 * x) / (rise * rise)
    q, v, a = motion
    return s * q, ds * q + s * v, dds * q + 2 * ds * v + s * a


def slews(t: np.ndarray, positions: list[float], dwells: list[float], limits: tuple[float, float, float]) -> Motion:
    """Go through positions with limited velocity, acceleration and jerk, resting `dwells[i]` seconds at each."""
    pieces: list[tuple[float, ...]] = []  # start, position, velocity, acceleration, jerk
    start = 0.0
    for dwell, (here, there) in zip(dwells, pairwise(positions), strict=False):
        pieces.append((start, here, 0.0, 0.0, 0.0))
        start = _slew(pieces, start + dwell, here, there, limits)
    pieces.append((start, positions[-1], 0.0, 0.0, 0.0))
    return _cubic(t, np.array(pieces))


def _slew(pieces: list[tuple[float, ...]], t: float, here: float, there: float, limits: tuple[float, ...]) -> float:
    """Append the seven pieces of one slew and return its end time."""
    direction = 1.0 if there >= here else -1.0
    jerk_time, rise, cruise = _durations(abs(there - here), *limits)
    flat = rise - 2 * jerk_time
    durations = (jerk_time, flat, jerk_time, cruise, jerk_time, flat, jerk_time)
    q, v, a = here, 0.0, 0.0
    for duration, sign in zip(durations, (1, 0, -1, 0, -1, 0, 1), strict=True):
        jerk = direction * sign * limits[2]
        pieces.append((t, q, v, a, jerk))
        q += duration * (v + duration * (a / 2 + duration * jerk / 6))
        v += duration * (a + duration * jerk / 2)
        a += duration * jerk
        t += duration
    return t


def _durations(distance: float, velocity: float, acceleration: float, jerk: float) -> tuple[float, float, float]:
    """Return the time of constant jerk, the time of rising velocity and the time of cruising, in s."""
    reached = velocity / acceleration >= acceleration / jerk
    jerk_time = acceleration / jerk if reached else sqrt(velocity / jerk)
    rise = jerk_time + velocity / acceleration if reached else 2 * jerk_time
    cruise = distance / velocity - rise
    if cruise >= 0:
        return jerk_time, rise, cruise
    if reached and distance >= 2 * acceleration * jerk_time * jerk_time:
        return jerk_time, jerk_time / 2 + sqrt(jerk_time * jerk_time / 4 + distance / acceleration), 0.0
    jerk_time = cube_root(distance / (2 * jerk))
    return jerk_time, 2 * jerk_time, 0.0


def _cubic(t: np.ndarray, pieces: np.ndarray) -> Motion:
    start, q, v, a, jerk = pieces[np.searchsorted(pieces[:, 0], t, side="right") - 1].T
    s = t - start
    return q + s * (v + s * (a / 2 + s * jerk / 6)), v + s * (a + s * jerk / 2), a + s * jerk
