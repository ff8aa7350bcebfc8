"""Machines with the numbers that READMEs of measured ones state: their recordings where those are not at hand.

Measured recordings belong to others and never enter this project. Where they lie beside the checkout
(`../shared/recordings`) tests read them; elsewhere the same tests take what is made here: a smooth motion and the
torque that it asks for, `tau = J a + Fc sign(v) + Fv v + loads`, read late and with noise as the README says.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.data.recording import Recording

Array = npt.NDArray[np.float64]
DATA = Path(__file__).resolve().parents[3] / "shared" / "recordings"
FINE = 10
"""Points in a row, before readings are taken."""


def read(machine: str, name: str, columns: dict[str, str] | None = None) -> Recording:
    """The measured recording, or one that is made of its machine's numbers."""
    path = DATA / machine / f"{name}.parquet"
    return Recording.read(path, columns) if path.exists() else made(machine, name)


@cache
def made(machine: str, name: str) -> Recording:
    """The recording of a machine, made of its numbers; another name, another motion."""
    return MACHINES[machine](name, sum(map(ord, name)))


def _tones(t: Array, seed: int, tones: tuple[tuple[float, float], ...]) -> tuple[Array, Array, Array]:
    """A sum of sines from rest [(amplitude, Hz)], with its speed and acceleration."""
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, len(tones))
    w = [2 * np.pi * hz for _, hz in tones]
    parts = list(zip((a for a, _ in tones), w, phases, strict=True))
    q = sum(a * (np.sin(k * t + p) - np.sin(p)) for a, k, p in parts)
    v = sum(a * k * np.cos(k * t + p) for a, k, p in parts)
    return np.asarray(q), np.asarray(v), np.asarray(sum(-a * k * k * np.sin(k * t + p) for a, k, p in parts))


def _rows(
    name: str, rate: float, torque: Array, q: Array, late: float, noise: float, step: float, seed: int
) -> Recording:
    """Readings at `rate`: the mean torque of a row, `late` [s] (negative: early), with noise; the position in steps."""
    fine = np.arange(len(q)) / (FINE * rate)
    t = fine[:-FINE:FINE]
    tau = np.interp(
        t - late, fine, np.convolve(torque, np.ones(FINE) / FINE, mode="same")
    ) + noise * np.random.default_rng(seed).standard_normal(len(t))
    return Recording(name, {"t": t, "tau": tau, "q": step * np.round(q[:-FINE:FINE] / step)})


def _pendulum(name: str, seed: int) -> Recording:
    """Rod of 0.5 m: m g l / J = g / l = 19.6, m g l 3.6 N m in the reading's units, a position 16 ms late."""
    t = np.arange(8 * 500 * FINE) / (500 * FINE)
    q, v, a = _tones(t, seed, ((1.2, 0.3), (0.7, 0.71), (0.15, 1.9)))
    torque = 3.6 / 19.6 * a + 3.6 * np.sin(q) + 0.15 * np.tanh(v / 0.02) + 0.03 * v
    return _rows(name, 500, torque, q, -0.016, 0.05, 3e-3, seed)


def _motor(name: str, seed: int) -> Recording:
    """Cogging of 72 waves a turn, 5 mN m, on a rotor of 4.8e-6 kg m2."""
    t = np.arange(12 * 1000 * FINE) / (1000 * FINE)
    q, v, a = _tones(t, seed, ((30.0, 0.31), (8.0, 1.7), (0.5, 3.1)))
    torque = 4.8e-6 * a + 2e-3 * np.tanh(v / 0.05) + 1e-5 * v + 5e-3 * np.sin(72 * q)
    return _rows(name, 1000, torque, q, 0.0, 5e-4, 2 * np.pi / 20000, seed)


def _emps(name: str, seed: int) -> Recording:
    """The asymmetric model of the benchmark's authors, four laps, shaken; a command 0.85 ms early.

    The README finds 0.56 to 0.77 ms; two thirds of a row would be half a row, which is put right without a name.
    """
    stroke = 0.24 if name == "estimation" else 0.2
    points = FINE * 1000
    lap = np.arange(6240 * FINE) / points
    half = lap % 3.12
    pace = np.where(lap < 3.12, 1.0, -1.0) * np.clip(np.minimum(half, 2.5 - half) / 0.3, 0.0, 1.0)
    smooth = np.ones(5 * FINE) / (5 * FINE)
    t = np.arange(4 * len(lap)) / points
    shaken = 2e-3 * np.sin(2 * np.pi * 12 * t) + 1e-3 * np.sin(2 * np.pi * 23 * t + seed)
    v = np.convolve(np.tile(pace * stroke / 2.2, 4), smooth, mode="same") + shaken
    q, a = np.cumsum(v) / points, np.gradient(v) * points
    level, viscous = np.where(v > 0, 20.144, 20.6277), np.where(v > 0, 166.7061, 240.4236)
    force = 95.154 * a + level * np.tanh(v / 1e-4) + viscous * v - 3.1648
    return _rows(name, 1000, force, q, -0.00085, 2.0, 1e-7, seed)


MACHINES: dict[str, Callable[[str, int], Recording]] = {
    "quasi_direct_pendulum": _pendulum,
    "anticogging_motor": _motor,
    "emps": _emps,
}
