"""An axis that wanders, with all its derivatives known, and what is recorded of it."""

import numpy as np

from cosim.data.recording import Recording
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount


def wander(seconds: float = 20.0, rate: float = 500.0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Position and its exact derivatives of a smooth multisine."""
    t = np.arange(int(seconds * rate)) / rate
    tones = [(0.2, 0.11, 0.0), (0.1, 0.37, 1.0), (0.03, 0.9, 2.0)]
    q = sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in tones)
    v = sum(a * 2 * np.pi * f * np.cos(2 * np.pi * f * t + p) for a, f, p in tones)
    acc = sum(-a * (2 * np.pi * f) ** 2 * np.sin(2 * np.pi * f * t + p) for a, f, p in tones)
    return t, q, v, acc


def recorded(tau: np.ndarray, t: np.ndarray, q: np.ndarray, name: str = "run") -> Recording:
    return Recording(name, {"t": t, "tau": tau, "q": q})


def axis(inertia: float = 5.0, Fc: float = 2.0, effects: tuple = ()) -> Mount:
    return Mount(name="axis", axis=Axis(inertia=inertia), friction=Coulomb(Fc=Fc, sigma2=1.0), effects=effects)
