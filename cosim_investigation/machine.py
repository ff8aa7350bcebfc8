"""What is moved: anything that follows a motion and gives a recording of it; here the co-simulated plant of a scenario.

A scenario names plant, controller, wires and columns; its set point says where the axis stands and what it may be asked
for. A machine in the place of its plant, a card or an FMU with effects that nobody told, stands in for the real one.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np

from cosim.data.recording import Recording
from cosim.data.set_points import Stream
from cosim.data.signals import Noise, Signal
from cosim.estimation.prepare import Array
from cosim.master.isolated import run_isolated
from cosim.master.simulate import Options, run
from cosim.models.cache import with_fmus
from cosim.support.errors import ScenarioError
from cosim.system.scenario import Scenario
from cosim.system.sections import ComponentSection
from cosim.system.wire import Wire
from cosim_investigation.motions import Motion, Sampled

OUTPUTS = ("position", "velocity", "acceleration")
NEEDED = ("tau", "q")


class Machine(Protocol):
    """What follows a motion."""

    @property
    def home(self) -> float:
        """Where the axis stands before each motion [rad, m]."""

    def record(self, motion: Motion, number: int, path: Path) -> Recording:
        """Follow a motion and keep its recording in a file; `number` is that of the run, no two have one."""


@dataclass(frozen=True)
class Planned:
    """A motion as a signal of a scenario; `origin` is what a wire adds to its position."""

    motion: Motion
    home: float
    units: Mapping[str, str]

    @property
    def outputs(self) -> Mapping[str, str]:
        """Position and its two derivatives."""
        return self.units

    def stream(self, step: float) -> Stream:
        """Make a stream of the programme."""
        return self._at if step == 1 else lambda ticks: self._at(ticks * step)

    def _at(self, t: Array) -> Array:
        q, v, a = self.motion.sampled(np.asarray(t, dtype=float))
        return np.stack([q + self.home, v, a])


@dataclass(frozen=True)
class Asked:
    """The set point of a scenario as a part of a motion; it counts from where it begins."""

    lasts: float
    signal: Signal
    step: float

    def seconds(self, here: float) -> float:
        """As long as the scenario."""
        return self.lasts

    def sampled(self, t: Array, here: float) -> Sampled:
        """What the signal gives, position counted from its first."""
        q, v, a = self.signal.stream(self.step)(t / self.step)
        first = self.signal.stream(self.step)(np.zeros(1))[0, 0]
        return q - first + here, v, a

    def end(self, here: float) -> float:
        """Where it stops."""
        return float(self.sampled(np.array([0.0, self.lasts]), here)[0][-1])


@dataclass(frozen=True)
class CoSimulated:
    """The plant of a scenario in its loop, or another machine in the plant's place: a card, or an FMU."""

    scenario: Scenario
    machine: str = ""
    reference: str = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "reference", _set_point_of(self.scenario))
        for column in NEEDED:
            if column not in self.scenario.records:
                have = tuple(self.scenario.records)
                message = f'{self.scenario.path} records no "{column}"; an investigation needs tau and q.'
                raise ScenarioError(message, culprit=column, choices=have)

    @property
    def home(self) -> float:
        """Where the set point of the scenario begins, as the controller is told it."""
        return self._start + self._offset

    def own_motion(self) -> Sampled:
        """The scenario's own set point, absolute, at every tick."""
        q, v, a = self.own().sampled(self.scenario.step * np.arange(self.scenario.ticks, dtype=float))
        return q + self.home, v, a

    def own(self) -> Motion:
        """The scenario's own set point as a motion."""
        lasts = self.scenario.ticks * self.scenario.step
        part = Asked(lasts, self.scenario.signals[self.reference], self.scenario.step)
        return Motion("scenario", f"the set point of {self.scenario.name}", (part,))

    def record(self, motion: Motion, number: int, path: Path) -> Recording:
        """Run the scenario with a motion in the place of its set point."""
        return self._run(self.follows(motion), path, number)

    def follows(self, motion: Motion, home: float | None = None) -> Scenario:
        """The scenario with a motion in the place of its set point, from its own start or from another place."""
        signal, start = self.scenario.signals[self.reference], self._start if home is None else home - self._offset
        planned: dict[str, Signal] = {self.reference: Planned(motion, start, dict(signal.outputs))}
        ticks = round(motion.seconds / self.scenario.step)
        return replace(self.scenario, signals={**self.scenario.signals, **planned}, ticks=ticks)

    def _run(self, scenario: Scenario, path: Path, number: int) -> Recording:
        fresh = {name: _again(signal, number) for name, signal in scenario.signals.items()}
        ready = with_fmus(replace(scenario, signals=fresh, components=self._components))
        options = Options(path, False, None, True, f"cosim investigate {scenario.path}")
        given = any(one.fmu is not None or one.python is not None for one in self._components.values())
        (run_isolated if given else run)(ready, options)
        return Recording.read(path)

    @cached_property
    def _components(self) -> Mapping[str, ComponentSection]:
        if not self.machine:
            return self.scenario.components
        plant = _plant_of(self.scenario)
        update: dict[str, object] = {"card": self.machine}
        if self.machine.endswith(".fmu"):
            update = {"card": None, "part": None, "fmu": Path(self.machine)}
        return {**self.scenario.components, plant: self.scenario.components[plant].model_copy(update=update)}

    @property
    def _start(self) -> float:
        first = self.scenario.signals[self.reference].stream(self.scenario.step)(np.arange(1))
        return float(first[0, 0])

    @property
    def _offset(self) -> float:
        return next((w.offset for w in self._wires if w.source.port == OUTPUTS[0]), 0.0)

    @property
    def _wires(self) -> list[Wire]:
        return [wire for wire in self.scenario.wires if wire.source.owner == self.reference]


def _again(signal: Signal, number: int) -> Signal:
    """Noise is another in each run; everything else is the same."""
    return signal.model_copy(update={"seed": signal.seed + number}) if isinstance(signal, Noise) else signal


def _set_point_of(scenario: Scenario) -> str:
    """Name of the one signal that is a motion, wired as it is."""
    moving = [name for name, one in scenario.signals.items() if set(OUTPUTS) <= set(one.outputs)]
    if len(moving) != 1:
        rule = "an investigation moves one axis, by one signal with position, velocity and acceleration"
        raise ScenarioError(f"{scenario.path} has {len(moving)} set points; {rule}.", culprit=str(scenario.path))
    for wire in scenario.wires:
        if wire.source.owner == moving[0] and wire.gain != 1:
            rule = "limits are those of the set point, so its wires must have no gain"
            raise ScenarioError(f"{scenario.path}: {wire.source} goes through a gain of {wire.gain:g}; {rule}.")
    return moving[0]


def _plant_of(scenario: Scenario) -> str:
    """Name of the one component that is the plant of a card."""
    plants = [name for name, one in scenario.components.items() if one.part == "plant"]
    if len(plants) != 1:
        rule = 'a machine takes the place of the one component with part = "plant"'
        raise ScenarioError(f"{scenario.path} has {len(plants)} plants; {rule}.", culprit=str(scenario.path))
    return plants[0]
