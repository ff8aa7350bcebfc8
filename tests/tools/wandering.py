"""An axis that wanders, with all its derivatives known, and what is recorded of it."""

from collections.abc import Sequence

import numpy as np

from cosim.data.recording import Recording
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

Tones = Sequence[tuple[float, float, float]]


def swing(t: np.ndarray, tones: Tones, per: float = 2 * np.pi) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, speed and acceleration of sines: amplitude, frequency (in Hz; in rad/s with `per` 1), phase."""
    waves = [(a, per * f, per * f * t + p) for a, f, p in tones]
    q, v = sum(a * np.sin(x) for a, _, x in waves), sum(a * w * np.cos(x) for a, w, x in waves)
    return np.asarray(q), np.asarray(v), np.asarray(sum(-a * w**2 * np.sin(x) for a, w, x in waves))


def wander(seconds: float = 20.0, rate: float = 500.0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Position and its exact derivatives of a smooth multisine."""
    t = np.arange(int(seconds * rate)) / rate
    return t, *swing(t, [(0.2, 0.11, 0.0), (0.1, 0.37, 1.0), (0.03, 0.9, 2.0)])


def recorded(tau: np.ndarray, t: np.ndarray, q: np.ndarray, name: str = "run") -> Recording:
    return Recording(name, {"t": t, "tau": tau, "q": q})


def axis(inertia: float = 5.0, Fc: float = 2.0, effects: tuple = ()) -> Mount:
    return Mount(name="axis", axis=Axis(inertia=inertia), friction=Coulomb(Fc=Fc, sigma2=1.0), effects=effects)


def posed(mount: Mount, recordings: Sequence[Recording], cutoff: float, slowest: float = 0.0) -> Problem:
    """What is fitted to recordings; rows that are slower than `slowest` do not count."""
    prepared = prepare(recordings, cutoff)
    weight = (np.abs(prepared.stacked("v")) >= slowest).astype(float)
    return Problem(mount, prepared, weight, recordings[0].sample_time)
