"""One experiment of an FMU, simulated and compared with its reference."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import floor
from pathlib import Path
from typing import Any

import numpy as np

from cosim.data.recording import Recording
from cosim.data.signals import Samples
from cosim.experiments.comparison import Compared, compare_numbers, compare_texts
from cosim.experiments.experiment_file import Experiment
from cosim.experiments.parameter_set import values_in
from cosim.experiments.series import Array, Series, series_of
from cosim.fmi.component import Port
from cosim.fmi.description import INTERFACES, describe, own_step_of
from cosim.fmi.types import FLOATS
from cosim.fmi.variables import ports_of
from cosim.master.simulate import simulate
from cosim.support.errors import CosimError, FmuError
from cosim.system.system import Fmu, System
from cosim.system.wire import Record, Wire

MODEL = "fmu"
STEPS = 500
"""Steps of a simulation for which nothing says a length."""
MOST = 20_000_000
ON_TICK = 1e-6
"""Share of a step by which a row of a reference may miss a tick and still be compared there without interpolation."""


@dataclass(frozen=True)
class Outcome:
    """What became of an experiment: `reason` says why it failed where it did not get as far as variables."""

    experiment: Experiment
    passed: bool
    reason: str = ""
    compared: tuple[Compared, ...] = ()
    notes: tuple[str, ...] = ()
    times: Array = field(default_factory=lambda: np.zeros(0))
    reference: Mapping[str, Array] = field(default_factory=dict)
    simulated: Mapping[str, Array] = field(default_factory=dict)
    run: bool = True
    units: Mapping[str, str] = field(default_factory=dict)
    """Of what was compared, as the FMU states them."""


@dataclass(frozen=True)
class Settings:
    """Start, length of a step [s] and number of steps."""

    start: float
    step: float
    ticks: int

    @property
    def stop(self) -> float:
        """When the simulation ends [s]."""
        return self.start + self.ticks * self.step


def run_experiment(path: Path, experiment: Experiment, rtol: float, interface: str = "") -> Outcome:
    """Simulate an experiment and compare it; what goes wrong is its reason."""
    if experiment.not_run:
        return Outcome(experiment, True, f"not run: {experiment.not_run}", run=False)
    try:
        return _run(path, experiment, rtol, interface)
    except CosimError as error:
        return Outcome(experiment, False, str(error))
    except Exception as error:  # whatever a foreign archive raises is a fault of this experiment
        return Outcome(experiment, False, f"{type(error).__name__}: {error}")


def _run(path: Path, experiment: Experiment, rtol: float, interface: str) -> Outcome:
    description = describe(path)
    ports = ports_of(description)
    reference = series_of(path, experiment.references, ports) if experiment.references else None
    stimuli = series_of(path, experiment.stimuli, ports) if experiment.stimuli else None
    settings = settings_of(path, description, experiment, reference, interface)
    values = values_in(path, experiment.parameters, ports) if experiment.parameters else {}
    notes = [
        f"{what} that the FMU does not have: {', '.join(one.strange)}."
        for what, one in (("The reference has columns", reference), ("The stimulus has columns", stimuli))
        if one and one.strange
    ]
    if stimuli is not None:
        _check_stimulus(stimuli, settings)
    if reference is not None:
        _check_time(reference, settings)
        if not reference.numbers and not reference.texts:
            text = f"None of the columns of {experiment.references} is a variable of {path}."
            raise FmuError(text, culprit=str(path))
    system = system_of(path, ports, settings, stimuli, values, reference, interface)
    recording = simulate(system).recording
    if reference is None:
        return Outcome(experiment, True, "it ran to its end; there is no reference to compare with", notes=tuple(notes))
    return _judged(experiment, ports, reference, recording, settings, rtol, tuple(notes))


def settings_of(
    path: Path, description: Any, experiment: Experiment, reference: Series | None, interface: str
) -> Settings:
    """Return the times of an experiment: its own, else those of the default experiment, else of the reference.

    Raises:
        FmuError: it ends before it starts, or has steps beyond reason.
    """
    default = description.defaultExperiment
    start = _first(experiment.start, getattr(default, "startTime", None), 0.0)
    last = None if reference is None else float(reference.times[-1])
    stop = _first(experiment.stop, getattr(default, "stopTime", None), last, start + 1.0)
    gaps = np.diff(reference.times) if reference is not None else np.zeros(0)
    gap = float(np.median(gaps[gaps > 0])) if (gaps > 0).any() else None
    kind = next((key for key, word in INTERFACES.items() if word == interface), "coSimulation")
    own = own_step_of(description, kind) or None
    step = _first(experiment.step, getattr(default, "stepSize", None), own, gap, (stop - start) / STEPS)
    if not (step > 0 and stop > start):
        text = f"The experiment goes from {start:g} to {stop:g} s in steps of {step:g} s; it must go forward."
        raise FmuError(text, culprit=experiment.name)
    ticks = max(1, floor((stop - start) / step * (1 + 1e-9) + 1e-6))
    if ticks > MOST:
        steps = f"{ticks:,} steps of {step:g} s; {MOST:,} are the most"
        raise FmuError(f"The experiment goes from {start:g} to {stop:g} s in {steps}.", culprit=experiment.name)
    return Settings(start, step, ticks)


def system_of(
    path: Path,
    ports: Mapping[str, Port],
    settings: Settings,
    stimuli: Series | None,
    values: Mapping[str, Any],
    reference: Series | None,
    interface: str,
) -> System:
    """Return what is simulated: the FMU alone, its inputs fed, what is compared recorded."""
    fed = stimuli.numbers if stimuli is not None else {}
    signals, wires = {}, []
    for k, (name, series) in enumerate(fed.items()):
        port = ports[name]
        if port.causality != "input":
            raise FmuError(f'The stimulus has "{name}", which is no input of {path}.', culprit=name)
        signals[f"column {k}"] = Samples(_on_ticks(stimuli, series, settings, port), port.unit, name)
        wires.append(Wire(f"column {k}.value", f"{MODEL}.{name}", cast=port.type not in FLOATS))
    outputs = [port for port in ports.values() if port.causality == "output" and not port.array]
    names = [port.name for port in outputs if port.type != "Clock"]
    names = [*reference.numbers, *reference.texts] if reference is not None else names
    return System(
        components={MODEL: Fmu(path, interface)},
        records={name: Record(f"{MODEL}.{name}") for name in names},
        step=settings.step,
        ticks=settings.ticks,
        wires=wires,
        signals=signals,
        parameters={MODEL: dict(values)},
        start=settings.start,
        last=True,
    )


def _judged(
    experiment: Experiment,
    ports: Mapping[str, Port],
    reference: Series,
    recording: Recording,
    settings: Settings,
    rtol: float,
    notes: tuple[str, ...],
) -> Outcome:
    done = len(recording.t) - 1
    if done < settings.ticks:
        reference, note = _until_ended(reference, settings, done)
        notes = (*notes, note)
    ticks = (reference.times - settings.start) / settings.step
    near = np.clip(np.rint(ticks).astype(np.intp), 0, done)
    on = bool(np.all(np.abs(ticks - near) <= 1e-3))
    simulated: dict[str, Array] = {}
    compared = []
    for name, values in reference.numbers.items():
        exact = ports[name].type not in FLOATS
        column = np.asarray(recording.table[name], np.float64)
        simulated[name] = column[near] if on or exact else np.interp(ticks, np.arange(len(column)), column)
        compared.append(compare_numbers(name, reference.times, values, simulated[name], rtol, exact))
    for name, texts in reference.texts.items():
        shown = [recording.others[name][k] for k in near]
        cells = [one.hex() if isinstance(one, bytes) else str(one) for one in shown]
        compared.append(compare_texts(name, reference.times, texts, cells))
    passed = all(one.passed for one in compared)
    units = {name: ports[name].unit for name in simulated}
    numbers = (reference.times, dict(reference.numbers), simulated)
    return Outcome(experiment, passed, "", tuple(compared), notes, *numbers, units=units)


def _until_ended(reference: Series, settings: Settings, done: int) -> tuple[Series, str]:
    """The reference up to where the FMU asked to end; the row at the end of that step is not recorded here.

    Raises:
        FmuError: the reference goes on.
    """
    ended = settings.start + (done + 1) * settings.step
    rows = reference.times <= settings.start + (done + ON_TICK) * settings.step
    said = f"The FMU asked to end the simulation in the step to {ended:g} s"
    if reference.times[-1] > ended + ON_TICK * settings.step or not rows.any():
        raise FmuError(f"{said}, and its reference goes on to {reference.times[-1]:g} s.", culprit="reference")
    count = int((~rows).sum())
    left = f"; {count:,} row{'s are' if count > 1 else ' is'} left out of the comparison" if count else ""
    numbers = {name: values[rows] for name, values in reference.numbers.items()}
    texts = {name: cells[: int(rows.sum())] for name, cells in reference.texts.items()}
    return Series(reference.times[rows], numbers, texts, reference.strange), f"{said}{left}."


def _check_stimulus(stimuli: Series, settings: Settings) -> None:
    """Refuse a stimulus without a number in a row, or one that says nothing of the time of the experiment."""
    for name, values in stimuli.numbers.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            text = f"The stimulus has no number for {name} at {stimuli.times[bad[0]]:g} s; it must be finite."
            raise FmuError(text, culprit=name)
    first, last = float(stimuli.times[0]), float(stimuli.times[-1])
    if first >= settings.stop or last < settings.start:
        times = f"from {first:g} to {last:g} s, and the experiment from {settings.start:g} to {settings.stop:g} s"
        raise FmuError(f"The stimulus is {times}: they must have a time in common.", culprit="stimulus")


def _check_time(reference: Series, settings: Settings) -> None:
    first, last = float(reference.times[0]), float(reference.times[-1])
    room = 1e-6 * settings.step
    if first < settings.start - room or last > settings.stop + room:
        text = f"The reference is from {first:g} to {last:g} s, and the experiment from {settings.start:g} to"
        raise FmuError(f"{text} {settings.stop:g} s: it must lie within.", culprit="reference")


def _on_ticks(stimuli: Any, values: Array, settings: Settings, port: Port) -> Array:
    """The stimulus at each tick, which is held over the step; numbers between rows run linearly, others are held.

    Of two rows of one time the last one holds from then on.
    """
    at = settings.start + settings.step * np.arange(settings.ticks + 1)
    last = np.searchsorted(stimuli.times, at + ON_TICK * settings.step, side="right") - 1
    held: Array = values[np.clip(last, 0, None)]
    if port.type not in FLOATS:
        return held
    exact = np.abs(stimuli.times[np.clip(last, 0, None)] - at) <= ON_TICK * settings.step
    return np.where(exact, held, np.interp(at, stimuli.times, values))


def _first(*values: Any) -> float:
    return next(float(one) for one in values if one is not None)
