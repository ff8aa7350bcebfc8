"""A simulated mount that runs beside the clock and takes commands: the scenario of a star with the star in our hands.

The scenario is run as `cosim run` runs it, every component and every gust of it; only its signal of kind "star" is
replaced by the set points of a `Guide`, and the encoders are looked at every 10 ms.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import radians
from pathlib import Path
from threading import Event, RLock, Thread
from time import monotonic

import numpy as np

from cosim.data.signals import Star, Stream
from cosim.fmi.function import FunctionComponent
from cosim.master.simulate import Options, simulate
from cosim.support.errors import CosimError, ScenarioError
from cosim.system.ports import PortRef
from cosim.system.scenario import Scenario
from cosim.system.system import System
from cosim.system.wire import Wire
from cosim_observatory.guide import Guide
from cosim_observatory.guide import Path as Motion

AXES = ("azimuth", "altitude")
LOOK = 0.01
"""Seconds between two looks at the encoders."""
LONGEST = 100_000.0
"""Simulated seconds after which a session ends by itself: a day and more."""
ROW = 0.1
"""Seconds of a row of the recording."""


@dataclass(frozen=True)
class Limits:
    """What is asked of an axis at most beside its path: rad/s and rad/s2."""

    velocity: float = radians(4.0)
    acceleration: float = radians(2.0)


class _Guided:
    """The signal in the star's place."""

    def __init__(self, star: Star, values: Callable[[np.ndarray], np.ndarray]) -> None:
        self.outputs: Mapping[str, str] = star.outputs
        self._values = values

    def stream(self, step: float) -> Stream:
        return lambda ticks: self._values(ticks * step).reshape(len(self.outputs), len(ticks))


class _Ended(CosimError):
    """The session was closed."""


class SimulatedMount:
    """Two axes, azimuth and altitude, that are simulated in a thread of their own while commands come from others.

    Args:
        scenario: with FMUs, a signal of kind "star" and both encoders wired to controllers that it guides; the mount
            begins at rest where the star does.
        speed: simulated seconds a second; the clock of the mount is that of the simulation.
        recording: Parquet file for what the scenario records; None keeps it in memory, for nobody.
        force: overwrite it.

    Raises:
        ScenarioError: there is no star in the scenario, or nothing that follows it.

    `failure` says why the simulation ended by itself; it is empty while it runs.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        limits: Limits | None = None,
        speed: float = 1.0,
        recording: Path | None = None,
        force: bool = False,
    ) -> None:
        self.scenario, self.speed, self._recording, self._force = scenario, speed, recording, force
        self._name, self.star = star_of(scenario)
        self._encoders = encoders_of(scenario, self._name)
        most = limits or Limits()
        start = self.star.stream(scenario.step)(np.zeros(1, np.int64))[[0, 3], 0]
        self._guide = Guide(start, np.full(2, most.velocity), np.full(2, most.acceleration))
        self._lock, self._stop = RLock(), Event()
        self._asked = 0.0
        self._seen: tuple[float, float, float] = (0.0, float(start[0]), float(start[1]))
        self.failure = ""
        self._thread = Thread(target=self._run, name="mount", daemon=True)

    def __enter__(self) -> "SimulatedMount":
        self._begun = monotonic()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self._seen[0]

    @property
    def angles(self) -> tuple[float, float]:
        """Azimuth and altitude [rad] as the encoders showed them last."""
        return self._seen[1], self._seen[2]

    @property
    def set_point(self) -> tuple[float, float, float]:
        """Time [s] of the newest set point, and its azimuth and altitude [rad]; the next command acts from there."""
        with self._lock:
            azimuth, altitude = self._guide.at(self._asked)[:, 0]
            return self._asked, float(azimuth), float(altitude)

    @property
    def moving(self) -> bool:
        """Whether the set point is still on its way to the path it shall follow."""
        with self._lock:
            return self.time < self._guide.arrival

    def follow(self, path: Motion) -> None:
        """Join a path, smoothly and within the limits, from the next set point on."""
        with self._lock:
            self._guide.follow(path, self._asked)

    def stop(self) -> None:
        """Come to rest."""
        with self._lock:
            self._guide.stop(self._asked)

    def _values(self, t: np.ndarray) -> np.ndarray:
        with self._lock:
            self._asked = float(t[-1])
            return self._guide(t)

    def _pace(self, tick: int, _: int) -> None:
        """Wait until the clock of the wall has come as far; a simulation that is slower than it just goes on."""
        ahead = tick * self.scenario.step / self.speed - (monotonic() - self._begun)
        if ahead < -LOOK:
            self._begun -= ahead
        if self._stop.wait(max(0.0, ahead)):
            raise _Ended

    def _look(self, t: float, azimuth: float, altitude: float) -> float:
        self._seen = (t, azimuth, altitude)
        return 0.0

    def _run(self) -> None:
        try:
            self._simulate()
            self.failure = f"a session lasts {LONGEST:g} simulated seconds."
        except _Ended:
            pass
        except Exception as error:  # a thread has nobody else to tell
            self.failure = str(error)

    def _simulate(self) -> None:
        scenario = self.scenario
        encoders = FunctionComponent(self._look, dict.fromkeys(AXES, "rad"), {"looked": ""}, "encoders")
        seen = [Wire(source, f"encoders.{axis}") for source, axis in zip(self._encoders, AXES, strict=True)]
        fmus = {name: one.fmu for name, one in scenario.components.items() if one.fmu}
        system = System(
            components={**fmus, "encoders": encoders},
            wires=[*scenario.wires, *seen],
            records=scenario.records,
            step=scenario.step,
            ticks=round(LONGEST / scenario.step),
            signals=dict(scenario.signals) | {self._name: _Guided(self.star, self._values)},
            parameters={name: one.parameters for name, one in scenario.components.items()},
            every=dict(scenario.every) | {"encoders": max(1, round(LOOK / scenario.step))},
            variables={name: one.aliases for name, one in scenario.components.items()},
            decimation=max(1, round(ROW / scenario.step)),
        )
        simulate(system, Options(self._recording, self._force, self._pace))


def star_of(scenario: Scenario) -> tuple[str, Star]:
    """Return the signal that a mount follows.

    Raises:
        ScenarioError: there is none, or more than one.
    """
    stars = {name: one for name, one in scenario.signals.items() if isinstance(one, Star)}
    if len(stars) != 1:
        rule = f'a telescope needs one signal of kind "star" to guide, and this has {len(stars)}'
        raise ScenarioError(f"{scenario.path}: {rule}; the scenario two_axis has one.", culprit=scenario.path)
    return next(iter(stars.items()))


def encoders_of(scenario: Scenario, star: str) -> tuple[str, str]:
    """Return what the controllers measure that follow azimuth and altitude of the star.

    Raises:
        ScenarioError: nothing follows one of them, or it measures nothing.
    """
    fed: dict[str, str] = {wire.target: wire.source for wire in scenario.wires}
    found = []
    for axis in AXES:
        followers = [PortRef(target).owner for target, source in fed.items() if source == f"{star}.{axis}"]
        measured = [fed[f"{one}.q"] for one in followers if f"{one}.q" in fed and f"{one}.q_d" in fed]
        if len(measured) != 1:
            rule = f'one controller must measure "q" and follow "{star}.{axis}"; there are {len(measured)}'
            raise ScenarioError(f"{scenario.path} has no axis for the {axis}: {rule}.", culprit=scenario.path)
        found.append(measured[0])
    return found[0], found[1]
