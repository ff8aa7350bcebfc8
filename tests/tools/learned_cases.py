"""Recordings of an axis with physics that has no name, and what is learned from them."""

from collections.abc import Callable
from functools import cache

import numpy as np

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.terms.learn import Learned, learn
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import PROTOCOL_HZ, prepare
from cosim.estimation.problem import Problem
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

Array = np.ndarray
Extra = Callable[[dict[str, Array]], Array]
FC = 2.0
NOISE = 0.05
MOUNT = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=FC, sigma2=1.0), effects=())


def night(seed: int) -> dict[str, Array]:
    """A minute of a smooth motion that turns often, with a temperature that rises, faster or slower."""
    rng, t = np.random.default_rng(seed), np.arange(6000) / 100
    tones = [(0.3, rng.uniform(0.05, 0.1)), (0.2, rng.uniform(0.1, 0.2)), (0.05, rng.uniform(0.3, 0.5))]
    table = {"t": t, "q": np.zeros_like(t), "v": np.zeros_like(t), "a": np.zeros_like(t)}
    for size, hertz in tones:
        w, phase = 2 * np.pi * hertz, rng.uniform(0, 2 * np.pi)
        table["q"] += size * np.sin(w * t + phase)
        table["v"] += size * w * np.cos(w * t + phase)
        table["a"] -= size * w**2 * np.sin(w * t + phase)
    warm = 10 * (1 - np.exp(-t / rng.uniform(10, 30))) + rng.uniform(10, 20)
    return {**table, "temperature": warm, "run": np.full_like(t, float(seed))}


def warm_place(now: dict[str, Array]) -> Array:
    """Friction that rises at one place with the temperature: a product, none of the catalogue."""
    bump = np.exp(-((now["q"] / 0.15) ** 2))
    return 0.15 * (now["temperature"] - 20) * bump * np.sign(now["v"])


def teeth(now: dict[str, Array]) -> Array:
    """A torque constant that waves with position."""
    needed = 5.0 * now["a"] + FC * np.sign(now["v"]) + now["v"]
    return 0.15 * needed * np.sin(25 * now["q"])


def swerve(now: dict[str, Array]) -> Array:
    """Drag by speed and acceleration at once."""
    return 6.0 * np.abs(now["a"]) * now["v"]


def droop(now: dict[str, Array]) -> Array:
    """A drive whose torque falls behind its command, the more the more it is asked for."""
    needed = 5.0 * now["a"] + FC * np.sign(now["v"]) + now["v"]
    return 0.05 * needed * np.abs(needed)


def iron(now: dict[str, Array]) -> Array:
    """An elastic stop over 0.25 rad."""
    state, out = 0.0, []
    for step in np.diff(now["q"], prepend=now["q"][0]) / 0.25:
        state = min(max(state + step, -1.0), 1.0)
        out.append(1.0 * state)
    return np.array(out)


def wanders(now: dict[str, Array]) -> Array:
    """Large, and of another sign in each night: what was learned from two helps no third."""
    return (-1.0 if now["run"][0] == 3 else 1.0) * np.cos(20 * now["q"])


def recording(extra: Extra, seed: int, noise: float = NOISE) -> Recording:
    now, rng = night(seed), np.random.default_rng(100 + seed)
    tau = 5.0 * now["a"] + FC * np.sign(now["v"]) + now["v"] + extra(now) + noise * rng.standard_normal(6000)
    return Recording(f"night_{seed}", {n: now[n] for n in ("t", "q", "temperature")} | {"tau": tau})


@cache
def parts(extra: Extra) -> tuple[Comparison, Fit, Predictive]:
    """The refitted base on two nights, and a third that proves."""
    train, there = [recording(extra, 1), recording(extra, 2)], [recording(extra, 3)]
    prepared = prepare(train, 10.0)
    v = np.abs(prepared.stacked("v"))
    problem = Problem(MOUNT, prepared, np.asarray(v > 0.02 * v.max(), float), 0.01)
    base = problem.fit(MOUNT, 25)
    comparison = Comparison.of(problem, base, POLICY)
    predictive = Predictive.of(comparison, prepare(there, 10.0), base, prepare(there, PROTOCOL_HZ))
    return comparison, base, predictive.as_delivered()


@cache
def tried(extra: Extra) -> Learned | None:
    return learn(*parts(extra))


def learned(extra: Extra) -> Learned | None:
    """What is delivered."""
    found = tried(extra)
    return found if found and found.helps else None
