"""Set points on command: a path to follow, joined smoothly from wherever the set point is.

    braking      v = v0 (1 - 3 s^2 + 2 s^3) + a0 T (s - 2 s^2 + s^3),   s = (t - t0) / T,   T = 2.25 |v0| / acceleration
    joining      set point = path + d,   d the quintic that ends at zero with its first two derivatives

Position, velocity and acceleration never jump, whether the mount rests, tracks, slews or brakes when a command comes.
Joining is as short as the limits allow; they limit what comes on top of the path's own motion. A command in the middle
of an acceleration may exceed the limit of the velocity, by 7 % at most.
"""

from collections.abc import Callable

import numpy as np

Path = Callable[[np.ndarray], np.ndarray]
"""Times [s], shape (n,), to positions, velocities and accelerations of the axes, shape (axes, 3, n)."""

_SHORTEST = 0.05
_PEAK_VELOCITY, _PEAK_ACCELERATION = 1.875, 5.7735
"""Of a quintic from rest to rest over unit time and way."""


def still(position: np.ndarray) -> Path:
    """Return the path that stays where it is; `position` has shape (axes,)."""
    held = np.stack((position, 0 * position, 0 * position), axis=1)[:, :, np.newaxis]
    return lambda t: np.repeat(held, len(t), axis=2)


def steady(position: np.ndarray, rates: np.ndarray, since: float) -> Path:
    """Return the path through `position` at the time `since` with constant `rates` [rad/s], each of shape (axes,)."""

    def path(t: np.ndarray) -> np.ndarray:
        way = position[:, np.newaxis] + rates[:, np.newaxis] * (t - since)
        return np.stack((way, np.repeat(rates[:, np.newaxis], len(t), axis=1), np.zeros_like(way)), axis=1)

    return path


class Guide:
    """The set points of all axes; `velocity` and `acceleration` are their limits, shape (axes,)."""

    def __init__(self, position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> None:
        self._velocity, self._acceleration = velocity, acceleration
        self._path = self._brake = still(position)
        self._joins, self.arrival = 0.0, 0.0
        self._apart = np.zeros((len(position), 6))

    def __call__(self, t: np.ndarray) -> np.ndarray:
        """Return the set points at t [s], shape (axes, 3, n)."""
        found = self._path(t)
        joining, braking = (t >= self._joins) & (t < self.arrival), t < self._joins
        if joining.any():
            found[:, :, joining] += _polynomial(self._apart, t[joining] - self._joins)
        if braking.any():
            found[:, :, braking] = self._brake(t[braking])
        return found

    def at(self, t: float) -> np.ndarray:
        """Return position, velocity and acceleration of each axis at one time, shape (axes, 3)."""
        found: np.ndarray = self(np.array([t]))[:, :, 0]
        return found

    def follow(self, path: Path, t: float) -> None:
        """Brake from t on, then join another path; `arrival` is when that is done."""
        rest = self._braked(t)
        there = path(np.array([self._joins]))[:, :, 0]
        apart = np.stack((rest, 0 * rest, 0 * rest), axis=1) - there
        way = np.abs(apart[:, 0])
        slow, hard = _PEAK_VELOCITY * way / self._velocity, _PEAK_ACCELERATION * way / self._acceleration
        duration = max(_SHORTEST, float(slow.max()), float(np.sqrt(hard.max())))
        self._path, self.arrival = path, self._joins + duration
        self._apart = _quintic(apart, duration)

    def stop(self, t: float) -> None:
        """Come to rest as soon as the limits allow, wherever that is."""
        self._path, self.arrival = still(self._braked(t)), self._joins

    def _braked(self, t: float) -> np.ndarray:
        """Brake from t on; returns where the axes come to rest, each as soon as it can."""
        position, velocity, acceleration = self.at(t).T
        durations = np.maximum(_SHORTEST, 2.25 * np.abs(velocity) / self._acceleration)
        v, a = velocity * durations, acceleration * durations**2
        rows = (position, v, a / 2, -v - 2 * a / 3, v / 2 + a / 4)  # the integral of v(s)

        def brake(now: np.ndarray) -> np.ndarray:
            return np.stack([
                _polynomial(_scaled(rows, durations)[axis : axis + 1], np.minimum(now - t, durations[axis]))[0]
                for axis in range(len(position))
            ])  # fmt: skip

        self._brake, self._joins = brake, t + float(durations.max())
        rest: np.ndarray = position + v / 2 + a / 12
        return rest


def _quintic(apart: np.ndarray, duration: float) -> np.ndarray:
    """Coefficients from the lowest power on, shape (axes, 6), of the quintic from `apart` to zero."""
    d, v, a = apart[:, 0], apart[:, 1] * duration, apart[:, 2] * duration**2
    rows = (d, v, a / 2, -10 * d - 6 * v - 1.5 * a, 15 * d + 8 * v + 1.5 * a, -6 * d - 3 * v - 0.5 * a)
    return _scaled(rows, np.full(len(d), duration))


def _scaled(rows: tuple[np.ndarray, ...], durations: np.ndarray) -> np.ndarray:
    """Turn coefficients of powers of s = t / duration, a row each, into those of t, shape (axes, rows)."""
    return np.stack([row / durations**power for power, row in enumerate(rows)], axis=1)


def _polynomial(coefficients: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Values and two derivatives at t, shape (axes, 3, n)."""
    found, row = [], coefficients
    for _ in range(3):
        found.append(sum(row[:, k : k + 1] * t**k for k in range(row.shape[1])))
        row = row[:, 1:] * np.arange(1, row.shape[1])
    made: np.ndarray = np.stack(found, axis=1)
    return made
