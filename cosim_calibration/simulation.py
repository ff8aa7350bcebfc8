"""Simulations of a calibration in a process of their own: a model that crashes there costs a point.

FMUs stay open from one simulation to the next, where a second run gives the same bits as the first; else they are
opened anew each time. The process keeps what is simulated, so that only numbers travel.
"""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace

import numpy as np

from cosim.fmi.component import Component
from cosim.fmi.fmu import FmuComponent
from cosim.master.opening import open_source
from cosim.master.simulate import simulate
from cosim.system.scenario import Scenario
from cosim.system.system import Fmu, Source
from cosim_calibration.experiment import Array, Experiment
from cosim_calibration.subject import MODEL, Subject

Point = Mapping[str, float]
Outputs = list[list[Array]]
"""By experiment and output: the values at the rows of the recording."""


@dataclass(frozen=True)
class Answer:
    """What came of a point: its outputs, or why there are none."""

    outputs: Outputs | None
    reason: str = ""


@dataclass(frozen=True)
class Job:
    """What all simulations share: the subject, its experiments, and values that stay as they were given."""

    subject: Subject
    experiments: tuple[Experiment, ...]
    given: Point
    keeps: bool | None = None
    """Whether FMUs give the same bits when they stay open; None where each process finds out by a second run."""

    @property
    def scenario(self) -> Scenario:
        """The scenario of the subject, whose files can be elsewhere."""
        return self.subject.scenario

    def with_scenario(self, scenario: Scenario) -> "Job":
        """The same job with another scenario."""
        return replace(self, subject=replace(self.subject, scenario=scenario))

    def at(self, point: Point, experiment: Experiment) -> Scenario:
        """What is simulated at a point for one of the experiments."""
        values = {**self.given, **(experiment.starts or {}), **self.of(point, experiment)}
        return experiment.of(self.subject, self.subject.with_values(values))

    def of(self, point: Point, experiment: Experiment) -> Point:
        """The numbers of a point that are for an experiment, by variable."""
        own = {variable: point[number] for variable, number in experiment.own.items()}
        return {**own, **{name: value for name, value in point.items() if name in self.subject.known}}


class Bench:
    """A job with its FMUs open."""

    def __init__(self, job: Job) -> None:
        self.job = job
        self._stack, self._open = ExitStack(), dict[str, Component]()
        self.keeps = job.keeps

    def outputs(self, point: Point, part: slice) -> Outputs:
        """Outputs at the rows of each experiment of a part of them.

        Raises:
            CosimError: the model cannot be simulated there.
        """
        if self.keeps is None:
            first, second = (self._all(point, part) for _ in range(2))
            self.keeps = _same(first, second)
            return first
        return self._all(point, part)

    def slopes(self, point: Point, part: slice, names: Sequence[str]) -> Outputs | None:
        """Derivatives of the outputs by some numbers, (rows, names) for each; None where the FMU gives none."""
        from cosim_calibration.sensitivity import slopes_of

        subject, found = self.job.subject, []
        source = self.job.scenario.system().components[MODEL]
        for experiment in self.job.experiments[part]:
            with ExitStack() as stack:
                component = open_source(stack, MODEL, source)
                if not isinstance(component, FmuComponent):
                    return None
                values = {**self.job.given, **(experiment.starts or {}), **self.job.of(point, experiment)}
                one = slopes_of(component, subject, experiment, values, names)
            if one is None:
                return None
            found.append(one)
        return found

    def close(self) -> None:
        """Close the FMUs."""
        self._open.clear()
        self._stack.close()
        self._stack = ExitStack()

    def _all(self, point: Point, part: slice) -> Outputs:
        try:
            return [self._one(point, experiment) for experiment in self.job.experiments[part]]
        except BaseException:
            self.close()  # an FMU that failed may be good for nothing
            raise

    def _one(self, point: Point, experiment: Experiment) -> list[Array]:
        system = self.job.at(point, experiment).system()
        if self.keeps is False:
            self.close()
        components: dict[str, Source] = {
            name: self._opened(name, source) if isinstance(source, Fmu) else source
            for name, source in system.components.items()
        }
        columns = simulate(replace(system, components=components)).recording.table
        return experiment.at_rows(columns)

    def _opened(self, name: str, source: Fmu) -> Component:
        if name not in self._open:
            self._open[name] = open_source(self._stack, name, source)
        return self._open[name]


_BENCHES: dict[str, Bench] = {}


def prepare(key: str, job: Job) -> None:
    """Keep a job in this process, in the place of the one before."""
    for bench in _BENCHES.values():
        bench.close()
    _BENCHES.clear()
    _BENCHES[key] = Bench(job)


def outputs_at(key: str, point: Point, part: slice) -> Outputs | None:
    """Outputs of a job that was prepared; None where it was not."""
    bench = _BENCHES.get(key)
    return bench.outputs(point, part) if bench else None


def keeps_at(key: str) -> bool | None:
    """Whether the FMUs of a job that was simulated here may stay open."""
    bench = _BENCHES.get(key)
    return bench.keeps if bench else None


def slopes_at(key: str, job: Job, point: Point, part: slice, names: Sequence[str]) -> Outputs | None:
    """Derivatives of a job; it is prepared where it was not."""
    if key not in _BENCHES:
        prepare(key, job)
    return _BENCHES[key].slopes(point, part, names)


def _same(first: Sequence[Sequence[Array]], second: Sequence[Sequence[Array]]) -> bool:
    pairs = zip(first, second, strict=True)
    return all(np.array_equal(a, b, equal_nan=True) for one, other in pairs for a, b in zip(one, other, strict=True))
