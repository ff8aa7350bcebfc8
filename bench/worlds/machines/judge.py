"""How much the true effect matters: least-squares inverse dynamics with and without the true missing torque.

The base is what the card says (inertia, friction law, known payload), every number of it refitted on the training
recordings. The effect enters as its own noise-free torque from the simulator, one free factor each.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import minimum_filter1d
from scipy.signal import butter, lfilter, sosfiltfilt

from .plant import bristle

CUTOFF = 30.0
"""Hz; the protocol of the project's torque residual."""


@dataclass
class Rows:
    """One recording at the judge's rows."""

    a: np.ndarray
    v: np.ndarray
    q: np.ndarray
    tau: np.ndarray
    missing: np.ndarray
    fine_v: np.ndarray
    dt: float
    keep: slice
    filter: object
    skip: int
    source: np.ndarray

    def window(self, base):
        """Row numbers that count: away from the ends, and from reversals where the base says nothing there."""
        rows = np.arange(len(self.tau))[self.keep][:: self.skip]
        if not base.moving:
            return rows
        near = int(0.05 / self.dt) + 1
        slow = minimum_filter1d(np.abs(self.v), 2 * near + 1)[rows] < 4 * base.still
        return rows if np.mean(slow) > 0.7 else rows[~slow]


def _difference(x, dt, order):
    p = np.pad(x, 2, mode="edge")
    if order == 1:
        return (p[:-4] - 8 * p[1:-3] + 8 * p[3:-1] - p[4:]) / (12 * dt)
    return (-p[:-4] + 16 * p[1:-3] - 30 * p[2:-2] + 16 * p[3:-1] - p[4:]) / (12 * dt * dt)


def rows(record):
    """Filter and thin a recording (dict with dt, tau, q and missing: rows x channels)."""
    dt = record["dt"]
    thin = max(int(1 / dt / 250), 1)
    sos = butter(4, min(CUTOFF, 0.3 / dt), fs=1 / dt, output="sos")

    def low(x):
        return sosfiltfilt(sos, x, axis=0, padlen=min(600, len(x) - 2))

    q = low(record["q"] - record["q"][0]) + record["q"][0]
    v, a = _difference(q, dt, 1), _difference(q, dt, 2)
    cut = slice(int(3 / (dt * thin)), -int(0.5 / (dt * thin)))
    coarse = butter(4, min(CUTOFF, 0.3 / (dt * thin)), fs=1 / (dt * thin), output="sos")

    def again(x):
        return sosfiltfilt(coarse, x, axis=0, padlen=min(300, len(x) - 2))

    missing = low(record["missing"])[::thin]
    return Rows(
        a[::thin],
        v[::thin],
        q[::thin],
        low(record["tau"])[::thin],
        missing,
        v[::thin],
        dt * thin,
        cut,
        again,
        max(int(1 / (dt * thin) / 80), 1),
        record["q"],
    )


def late(x, dt, T, lag):
    """Pass a signal through a first-order lag or a dead time T."""
    if lag:
        memory = np.exp(-dt / T)
        return lfilter([1 - memory], [1, -memory], x, zi=[memory * x[0]])[0]
    t = np.arange(len(x)) * dt
    return np.interp(t - T, t, x)


class Base:
    """The card's structure as columns; `start` are the nonlinear numbers it begins with (all positive)."""

    def __init__(self, law, stribeck, payload, start, still, moving=False):
        """`still`: speed within which a static law is at rest; `moving`: rows around a rest do not count."""
        self.moving = moving
        self.law, self.stribeck, self.payload, self.still = law, stribeck, payload, still
        names = {
            "lugre": ["kappa"] + (["rho", "Vs"] if stribeck else []),
            "static": ["Vs"] if stribeck else [],
            "coulomb": [],
        }
        self.names = names[law]
        self.start = np.log([start[name] for name in self.names])

    def columns(self, r, theta):
        """Build the columns of one recording."""
        x = dict(zip(self.names, np.exp(theta), strict=True))
        cols = [r.a, r.v]
        if self.law == "lugre":
            force, rate = bristle(r.fine_v, r.dt, x["kappa"], 1 + x.get("rho", 0.0), x.get("Vs", 1.0))
            cols += [r.filter(force), r.filter(rate)]
        else:
            side = np.tanh(r.v / self.still)
            cols.append(r.filter(side))
            if self.stribeck:
                cols.append(r.filter(side * np.exp(-((r.v / x["Vs"]) ** 2))))
        if self.payload:
            cols += [np.sin(r.q), np.cos(r.q)]
        return np.stack(cols, 1)


@dataclass
class Fit:
    """A refitted structure."""

    base: Base
    theta: np.ndarray
    factors: np.ndarray
    channels: list

    def residual(self, r):
        """Torque that is left in one recording, in its window."""
        A = np.hstack([self.base.columns(r, self.theta), r.missing[:, self.channels]])
        return (r.tau - A @ self.factors)[r.window(self.base)]


def _normal(base, recordings, channels, theta, slopes_of=None):
    """Gram matrix, right side and energy of the weighted rows; `slopes_of` adds the slopes of a model in theta."""
    blocks, sides = [], []
    for r in recordings:
        own = base.columns(r, theta)
        A = np.hstack([own, r.missing[:, channels]])
        if slopes_of is not None:
            near = slopes_of[: own.shape[1]]
            steps = 0.02 * np.eye(len(theta))
            A = np.hstack([A, *[((base.columns(r, theta + d) - own) @ near / 0.02)[:, None] for d in steps]])
        rows_used = r.window(base)
        w = 1 / np.sqrt(len(rows_used))
        blocks.append(A[rows_used] * w)
        sides.append(r.tau[rows_used] * w)
    return np.concatenate(blocks), np.concatenate(sides)


def _solve(A, y):
    size = np.sqrt(np.sum(A * A, 0)) + 1e-300
    B = A / size
    x = np.linalg.solve(B.T @ B + 1e-9 * np.eye(len(size)), B.T @ y) / size
    return x, float(np.sum((y - A @ x) ** 2))


def fit(base, recordings, channels, start=None, rounds=6):
    """Refit base and factors of channels jointly, each recording with the same weight (Gauss-Newton, shorter steps)."""
    theta = np.array(base.start if start is None else start, float)
    factors, best = _solve(*_normal(base, recordings, channels, theta))
    for _ in range(rounds if len(theta) else 0):
        A, y = _normal(base, recordings, channels, theta, factors)
        step = np.clip(_solve(A, y)[0][len(factors) :], -1.0, 1.0)
        for share_of_step in (1.0, 0.4, 0.1):
            trial = np.clip(theta + share_of_step * step, base.start - 3.5, base.start + 3.5)
            found, left = _solve(*_normal(base, recordings, channels, trial))
            if left < best:
                break
        else:
            break
        gain, theta, factors, best = best - left, trial, found, left
        if gain < 1e-3 * best:
            break
    return Fit(base, theta, factors, list(channels))


def energy(fitted, recordings):
    """Mean over recordings of the squared residual."""
    return float(np.mean([np.mean(fitted.residual(r) ** 2) for r in recordings]))


def share(less, more, recordings):
    """Part of the residual energy of `less` that `more` removes."""
    return 1 - energy(more, recordings) / max(energy(less, recordings), 1e-300)
