"""The experiment that would settle it: for two causes that these recordings cannot tell apart, the set point on which
they would differ most.

Each motion of a small programme (slow and fast sines, a chirp, slews with rests) stays inside what was visited. The
torque that it needs is computed for the model with one cause; the model with the other is refitted to that torque
(to first order, all of its parameters free); what is left is the difference that the recording would show.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cosim.data.signals import Chirp, Multisine, Sine, Slews
from cosim.diagnosis.answer.entries import NextExperiment
from cosim.estimation.filters import lowpass
from cosim.estimation.fit import free_parameters
from cosim.estimation.inverse import Inverse
from cosim.estimation.least_squares import projected
from cosim.estimation.prepare import Array, Piece, Prepared
from cosim.support.statistics import rms
from pyfmi_models.card import Card
from pyfmi_models.mount import Mount

SetPoint = Chirp | Multisine | Sine | Slews
SCENARIO = "next_experiment.toml"
SECONDS = 40.0
SMOOTH_START = 3.0
SPEEDS = (0.03, 0.3, 1.0)
"""Shares of the top speed at which the programme moves."""
HARDEST = 1.2
"""A motion may ask for this multiple of the largest torque that was recorded."""
FASTEST = 0.7
"""Highest frequency of a chirp, as a share of the band of the analysis."""


@dataclass(frozen=True)
class Visited:
    """What the recordings visited: middle and half range of positions, top speed and acceleration, largest torque."""

    middle: float
    reach: float
    speed: float
    acceleration: float
    torque: float
    cutoff: float

    @classmethod
    def of(cls, prepared: Prepared) -> "Visited":
        """Read it off prepared recordings."""
        low, high = prepared.ranges["q"]
        return cls(
            middle=(low + high) / 2,
            reach=(high - low) / 2,
            speed=max(abs(edge) for edge in prepared.ranges["v"]),
            acceleration=float(np.quantile(np.abs(prepared.stacked("a")), 0.99)),
            torque=float(np.abs(prepared.stacked("tau")).max()),
            cutoff=prepared.cutoff,
        )


@dataclass(frozen=True)
class Experiment:
    """A set point by name, the RMS torque [N m] by which two causes would differ on it, and the causes."""

    title: str
    signal: SetPoint
    difference: float
    separates: tuple[str, ...]
    visited: Visited


def best(main: Mount, rival: Mount, separates: tuple[str, ...], prepared: Prepared) -> Experiment | None:
    """The motion that tells two fitted structures apart best; None if no motion of the programme is allowed."""
    if not prepared.has_position:
        return None
    visited = Visited.of(prepared)
    rated = [
        Experiment(title, signal, _difference(main, rival, signal, visited), separates, visited)
        for title, signal in motions(visited)
    ]
    found = max(rated, key=lambda one: one.difference)
    return found if found.difference > 0 else None


def in_words(experiment: Experiment, has_controller: bool) -> NextExperiment:
    """The experiment as it stands in diagnosis.json; without a controller in the card there is no scenario to run."""
    words: NextExperiment = {
        "separates": list(experiment.separates),
        "expected_difference": experiment.difference,
        "description": f"record {experiment.title}, for {SECONDS:.0f}\N{NO-BREAK SPACE}s",
        "set_point": experiment.signal.model_dump(exclude_none=True),
    }
    return words | NextExperiment(scenario=SCENARIO) if has_controller else words


def motions(visited: Visited) -> Iterator[tuple[str, SetPoint]]:
    """The programme: every motion with the sentence that orders it; positions count from the middle of the range."""
    reach, hertz = 0.9 * visited.reach, FASTEST * visited.cutoff
    for share in SPEEDS:
        speed = share * visited.speed
        rate = max(speed / (2 * np.pi * reach), 0.02)
        size = speed / (2 * np.pi * rate)
        word = {0.03: "crawling", 0.3: "slow", 1.0: "fast"}[share]
        yield f"a {word} sine", Sine(kind="sine", frequency=rate, amplitude=size, smooth_start=SMOOTH_START)
    for share in (0.3, 1.0):
        size = share * visited.acceleration / (2 * np.pi * hertz) ** 2
        way: Any = {"start": 0.5, "stop": hertz, "duration": SECONDS, "amplitude": size}
        yield "a chirp up to high frequencies", Chirp(kind="chirp", smooth_start=SMOOTH_START, **way)
    tones = np.geomspace(0.5, hertz, 12)
    sizes = (0.3 * visited.acceleration / (2 * np.pi * tones) ** 2).tolist()
    multisine = Multisine(kind="multisine", frequencies=tones.tolist(), amplitudes=sizes, smooth_start=SMOOTH_START)
    yield "many tones at once", multisine
    limits: Any = {
        "max_velocity": visited.speed,
        "max_acceleration": visited.acceleration,
        "max_jerk": 20 * visited.acceleration,
    }
    places = [0.0, reach, 0.3 * reach, -reach, -0.3 * reach, reach, -reach, 0.0]
    rests = [0.3, 1.0, 3.0, 8.0, 0.3, 1.0, 3.0, 1.0]
    yield "slews with rests of 0.3 to 8 s", Slews(kind="slews", positions=places, dwell=rests, **limits)


def _difference(main: Mount, rival: Mount, signal: SetPoint, visited: Visited) -> float:
    """RMS by which the torques differ after the rival was refitted; 0 where the motion asks for too much."""
    piece = _piece(signal, visited)
    torque = Inverse(main, ()).torque(piece, np.zeros(0))[0]
    if np.abs(torque).max() > HARDEST * visited.torque:
        return 0.0
    inverse = Inverse(rival, free_parameters(rival))
    other, slopes = inverse.torque(replace(piece, tau=torque), inverse.present)
    residual = projected((torque - other)[piece.inside], slopes[piece.inside])
    return rms(residual)


def _piece(signal: SetPoint, visited: Visited) -> Piece:
    """The set point as a piece of a recording, at the rate of the analysis."""
    dt = 1 / (8 * visited.cutoff)
    count = int(SECONDS / dt)
    q, v, a = (lowpass(row, dt, visited.cutoff) for row in signal.stream(dt)(np.arange(count)))
    t: Array = dt * np.arange(count, dtype=float)
    inside = np.asarray((t > SMOOTH_START) & (t < SECONDS - 0.5))
    still: Array = np.zeros(count)
    return Piece(0, t, q + visited.middle, v, a, still, inside, dt, visited.cutoff, 1)


def scenario(experiment: Experiment, card: Card) -> str:
    """The scenario file that `cosim run` executes: plant and controller of the card beside it, set point, recording."""
    assert card.controller is not None
    middle = experiment.visited.middle
    numbers = experiment.signal.model_dump(exclude_none=True)
    rate, rows = card.controller.loop_hz, card.controller.record_hz
    parts = [
        f"# {experiment.title}: tells {' from '.join(experiment.separates)}; written by cosim diagnose.",
        'name = "next_experiment"',
        f"step = {1 / rate!r}",
        f"stop = {SECONDS}",
        "",
        *_component("mount", "plant", f"parameters = {{ position = {middle!r} }}"),
        *_component("controller", "controller"),
        "[signals.reference]",
        *(f"{key} = {_toml(value)}" for key, value in numbers.items() if value != ""),
        "",
        *_wire("controller.tau", "mount.tau"),
        *_wire("mount.q", "controller.q"),
        *_wire("reference.position", "controller.q_d", f"offset = {middle!r}"),
        *_wire("reference.velocity", "controller.v_d"),
        *_wire("reference.acceleration", "controller.a_d"),
        "[record]",
        f"decimation = {max(1, round(rate / rows))}",
        "",
        "[record.signals]",
        'tau = { signal = "mount.tau", mode = "mean" }',
        'q = "mount.q"',
        'q_d = "controller.q_d"',
        "",
    ]
    return "\n".join(parts)


def _component(name: str, part: str, more: str = "") -> list[str]:
    return [f"[components.{name}]", 'card = "card.toml"', f'part = "{part}"', *([more] if more else []), ""]


def _wire(source: str, target: str, more: str = "") -> list[str]:
    return ["[[connections]]", f'from = "{source}"', f'to = "{target}"', *([more] if more else []), ""]


def _toml(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else repr(value)
