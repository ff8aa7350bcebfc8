"""The paper's identification experiments on FMUs.

Friction map (Fig. 4, Table 2), a plant that is not stationary (Fig. 5), presliding steps (Fig. 6, Table 3).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cosim.data.recording import Recording
from cosim.estimation.identify.estimate import Estimate
from cosim.estimation.identify.friction_map import FrictionMap, Samples, friction_map, samples_of
from cosim.estimation.identify.presliding import Presliding, presliding, simulated
from cosim_studies.paper.benches import STEP, moved, pushed, step_response
from cosim_studies.paper.conditions import times, tuned
from cosim_studies.paper.experiment import Floats
from pyfmi_models.card import Card, read_card
from pyfmi_models.effects import FrictionWander
from pyfmi_models.friction import LuGre
from pyfmi_models.model import Pair, fields_of

RATE, PEAK = 2 * np.pi * 0.04, 0.056
"""The quasi-static sine: angular frequency [rad/s] and largest speed [rad/s]."""
CUT = 4e-3
"""Slowest speed in the friction map [rad/s]: below it bristles have not settled (errata, 12)."""
PUSH = 6.0
"""Largest torque of the open-loop sine [N m]: 1.4 times break-away."""
MOVING = 2e-3
"""Speed that says that friction has broken away [rad/s]."""
NOISE = 1e-7
"""Encoder noise [rad rms]."""
STEPS = (1.0, -1.0, 0.02, -0.02)
"""Torque steps [N m]: the paper's, and one far below break-away."""
SIDES = ("positive", "negative")
STATIC = ("sigma2", "Fc", "Fs", "Vs", "delta")


@dataclass(frozen=True, kw_only=True)
class Step:
    """One presliding step: torque [N m], what was recorded, both fits, and positions by each [rad].

    `directions` is "one" where the plant has the numbers of the step's direction both ways, "both" where it has both.
    """

    torque: float
    directions: str
    recording: Recording
    found: Presliding
    fitted: dict[str, Floats]


@dataclass(frozen=True, kw_only=True)
class Identification:
    """All of it; `slow` is the recording behind `map` and `every`, `periods` and `maps` are of a plant that wanders.

    `push` is its answer to a torque in open loop, `breakaways` are times [s] and torques [N m] at which it moved off.
    """

    seed: int
    slow: Recording
    map: FrictionMap
    every: Samples
    steps: tuple[Step, ...]
    push: Recording
    breakaways: tuple[tuple[float, float], ...]
    periods: tuple[Samples, ...]
    maps: tuple[Estimate, ...]


def mount(**changes: Any) -> Card:
    """The directional mount under the paper's C1 with kp 255; what a controller believes plays no part."""
    card = tuned(read_card("paper_mount_directional"), compensation="C1", kp=255.0)
    return replace(card, believed=None, **changes)


def identification(seed: int, periods: int = 2, wandering: int = 4) -> Identification:
    """Run the experiments and fit them; `periods` of the sine are fitted, `wandering` more show what varies."""
    card = mount()
    slow = moved(card, _sine(periods), NOISE, seed)
    unsteady = mount(effects=(FrictionWander(std=0.165, jump_std=0.15, jump_period=np.pi / RATE, seed=float(seed)),))
    pieces = _cut(moved(unsteady, _sine(wandering), NOISE, seed), wandering)
    inertia = card.mount.inertia
    push = pushed(unsteady, PUSH * np.sin(RATE * STEP * np.arange(_ticks(wandering))), decimation=100)
    return Identification(
        seed=seed,
        slow=slow,
        map=friction_map([slow], inertia, CUT),
        every=samples_of([slow], inertia, 0.0, True)[0],
        steps=tuple(_steps(seed)),
        push=push,
        breakaways=tuple(breakaways(push)),
        periods=tuple(samples_of([piece], inertia, CUT, True)[0] for piece in pieces),
        maps=tuple(friction_map([piece], inertia, CUT).fits["positive"] for piece in pieces),
    )


def _sine(periods: int) -> Floats:
    t = np.arange(round(2 * np.pi / RATE * periods * 1000) + 1) / 1000
    return np.asarray(PEAK / RATE * (1 - np.cos(RATE * t)))


def _ticks(periods: int) -> int:
    return round(2 * np.pi / RATE * periods / STEP)


def _cut(recording: Recording, parts: int) -> list[Recording]:
    size = len(recording) // parts
    rows = [slice(k * size, (k + 1) * size) for k in range(parts)]
    return [replace(recording, table={name: column[one] for name, column in recording.table.items()}) for one in rows]


def _steps(seed: int) -> Iterator[Step]:
    """Both fits of each step, from starts that are wrong by a half."""
    for plant, torques in (("one", STEPS), ("both", STEPS[:2])):
        for torque in torques:
            law = mount().friction if plant == "both" else replace(mount().friction, **true_numbers(side_of(torque)))
            wrong = {name: times(getattr(law, name), 1.5) for name in ("sigma0", "sigma1", "Fs")}
            started = mount(friction=replace(law, **wrong))
            recording = step_response(mount(friction=law), torque, NOISE, seed)
            found = presliding(started, recording)
            fitted = simulated(started, recording, found)
            yield Step(torque=torque, directions=plant, recording=recording, found=found, fitted=fitted)


def side_of(torque: float) -> str:
    """Direction that a torque pushes in."""
    return "positive" if torque > 0 else "negative"


def _pair(value: Any) -> tuple[float, float]:
    return (value.positive, value.negative) if isinstance(value, Pair) else (value, value)


def breakaways(push: Recording) -> Iterator[tuple[float, float]]:
    """Yield time and torque [N m] at which each half period of the open-loop sine sets the axis in motion."""
    moving = np.abs(push["v"]) > MOVING
    along = moving & (np.sign(push["v"]) == np.sign(push["tau"])) & ~np.r_[False, moving[:-1]]
    half = np.floor(push.t * RATE / np.pi + 1e-9)
    for number in range(int(half[-1]) + 1):
        rows = np.flatnonzero(along & (half == number))
        if len(rows):
            yield float(push.t[rows[0]]), float(push["tau"][rows[0]])


def true_numbers(side: str) -> dict[str, float]:
    """The plant's friction in one direction."""
    law = mount().friction
    assert isinstance(law, LuGre)
    place = SIDES.index(side)
    return {name: _pair(getattr(law, name))[place] for name in fields_of(law) if name != "smoothing"}


def curve(numbers: dict[str, float], v: Floats) -> Floats:
    """Steady friction torque at speeds v > 0."""
    fall = np.exp(-((v / numbers["Vs"]) ** numbers["delta"]))
    return np.asarray(numbers["Fc"] + (numbers["Fs"] - numbers["Fc"]) * fall + numbers["sigma2"] * v)


PAPER_NOMINAL = {"sigma2": 32.77, "Fc": 2.322, "Fs": 3.322, "Vs": 0.04129, "delta": 2.0}
"""Table 2 of the paper, nominal case."""


def spread(samples: Sequence[Samples]) -> float:
    """Largest difference [N m] between periods of the friction at one speed, over bins of the positive speeds."""
    edges = np.linspace(CUT, 0.98 * PEAK, 13)
    means = []
    for one in samples:
        forward = one.v > 0
        place = np.digitize(one.v[forward], edges)
        means.append([one.friction[forward][place == k].mean() for k in range(1, len(edges))])
    return float(np.ptp(np.array(means), axis=0).max())
