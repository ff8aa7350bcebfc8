"""Recordings laid on the ticks of a simulation: what feeds the inputs, and what the outputs are compared with.

Time counts from the first row of a recording. Values are converted from the unit of the column to that of the variable;
a column whose unit is not known is taken in the variable's.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import floor
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.data.recording import Recording
from cosim.data.signals import Samples
from cosim.fmi.types import FLOATS
from cosim.support.errors import InputError, UnitError
from cosim.support.units import conversion
from cosim.system.scenario import Scenario
from cosim.system.wire import Record, Wire
from cosim_calibration.subject import Subject, unknown

Array = npt.NDArray[np.float64]
ON_TICK = 1e-3
"""Share of a step by which a row may miss its tick and still be the sample at that tick."""
MULTIPLE = 1e-6
"""Share by which a step may miss a multiple of an FMU's own step."""
MOST_TICKS = 50_000_000
FED = "column "
"""Names of the signals that columns are: no scenario can have them."""


@dataclass(frozen=True)
class Experiment:
    """A recording on ticks: inputs of shape (ticks + 1,) by variable, and outputs of shape (rows,) by variable.

    `times` are those of the rows from the first one on [s]; `replaced` are signals of a scenario that columns replace.
    """

    name: str
    step: float
    ticks: int
    times: Array
    inputs: Mapping[str, Array]
    outputs: Mapping[str, Array]
    replaced: tuple[str, ...] = ()
    starts: Mapping[str, float] | None = None
    """Start values that hold for this experiment alone, by variable."""
    own: Mapping[str, str] = field(default_factory=dict)
    """Start values of this experiment that are free: the number's name by variable."""

    def of(self, subject: Subject, scenario: Scenario) -> Scenario:
        """The scenario that simulates it; columns of its recording are those of the outputs."""
        signals = {name: one for name, one in scenario.signals.items() if name not in self.replaced}
        wires = list(scenario.wires)
        for k, (name, values) in enumerate(self.inputs.items()):
            if name in self.replaced:
                signals[name] = Samples(values, _unit_of(scenario.signals[name]), name)
                continue
            port = subject.ports[name]
            signals[f"{FED}{k}"] = Samples(values, port.unit, name)
            wires.append(Wire(f"{FED}{k}.value", subject.full(name), cast=port.type not in FLOATS))
        records = {name: Record(record_of(subject, name)) for name in self.outputs}
        return replace(scenario, signals=signals, wires=tuple(wires), records=records, step=self.step, ticks=self.ticks)

    def at_rows(self, columns: Mapping[str, Array]) -> list[Array]:
        """Simulated outputs at the rows of the recording, from those at ticks."""
        ticks = self.times / self.step
        near = np.rint(ticks).astype(np.intp)
        if np.all(np.abs(ticks - near) <= ON_TICK):
            return [columns[name][near] for name in self.outputs]
        grid = np.arange(self.ticks + 1, dtype=np.float64)
        return [np.interp(ticks, grid, columns[name]) for name in self.outputs]


@dataclass(frozen=True)
class Matching:
    """Which columns are used: by variable, for inputs and outputs; and what a reader should know about it."""

    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    notes: tuple[str, ...]


def matching(subject: Subject, recording: Recording, columns: Mapping[str, str]) -> Matching:
    """Match the columns of a recording with inputs and outputs, by name unless `columns` says otherwise.

    Raises:
        InputError: `columns` names what the model or the recording does not have, or no output has a column.
    """
    inputs = {**{name: name for name in _inputs(subject) if name in recording}}
    outputs = {name: name for name in _outputs(subject) if name in recording}
    for name, column in columns.items():
        if name == "t":
            continue
        _check_left_out(subject, recording, columns)
        if column not in recording and name not in recording:
            have = ", ".join(one for one in recording.columns if one != "t")
            text = f'--columns {name}={column}: {recording.name} has no column "{column}"; it has: {have}.'
            raise InputError(text, culprit=column, value=column, choices=recording.columns)
        target = inputs if name in _inputs(subject) else outputs if _is_compared(subject, name) else None
        if target is None:
            choices = [*_inputs(subject), *_outputs(subject)]
            raise unknown("--columns", name, subject.source, choices, "inputs and outputs are")
        target[name] = column if column in recording else name
    if not outputs:
        have, need = ", ".join(recording.columns), ", ".join(_outputs(subject)) or "none"
        text = f"{recording.name}: none of its columns ({have}) is an output of {subject.source} ({need})"
        raise InputError(f"{text}; --columns OUTPUT=COLUMN says which is.", culprit=recording.name)
    _check_left_out(subject, recording, columns)
    used = {"t", *inputs.values(), *outputs.values()}
    silent = [name for name in _inputs(subject) if name not in inputs and name not in subject.scenario.signals]
    rest = [name for name in recording.columns if name not in used]
    notes = [f"{recording.name}: no column for the input {', '.join(silent)}; it stays at its start."] if silent else []
    notes += [f"{recording.name}: not used: {', '.join(rest)}."] if rest else []
    return Matching(inputs, outputs, (*recording.notes, *notes))


def _check_left_out(subject: Subject, recording: Recording, columns: Mapping[str, str]) -> None:
    """Refuse a recording of which a column that feeds an input was left out as it was read."""
    for name in _inputs(subject):
        column = columns.get(name, name)
        note = next((one for one in recording.notes if f'column "{column}" was left out' in one), "")
        if note and column not in recording:
            raise InputError(f"{note} It feeds the input {name}, which needs a number in each row.", culprit=column)


def experiment_of(
    subject: Subject, recording: Recording, match: Matching, step: float | None, interpolation: str
) -> Experiment:
    """Lay a recording on ticks.

    Args:
        subject: what is simulated.
        recording: its rows must be finite where inputs are; outputs may have gaps (NaN).
        match: its columns.
        step: of the simulation [s]; None takes that of the rows, or of the system.
        interpolation: "hold" keeps an input until its next sample, "linear" takes the mean over each step.

    Raises:
        InputError: an input is not finite, a unit does not fit, or the step is beyond reason.
    """
    times = np.asarray(recording.t, np.float64) - float(recording.t[0])
    size = step or _step(subject, times)
    ticks = max(1, floor(times[-1] / size + ON_TICK))
    if ticks * size < times[-1] - ON_TICK * size:
        ticks += 1
    if ticks > MOST_TICKS:
        text = f"{recording.name}: {times[-1]:g} s in steps of {size:g} s are {ticks:,} steps"
        raise InputError(f"{text}; {MOST_TICKS:,} are the most.", culprit=recording.name)
    inputs = {}
    for name, column in match.inputs.items():
        values = _converted(subject, recording, name, column)
        if not np.isfinite(values).all():
            row = int(np.flatnonzero(~np.isfinite(values))[0]) + 1
            text = f'{recording.name}: the column "{column}" feeds {name} and has no number in row {row:,}.'
            raise InputError(text, culprit=column)
        inputs[name] = _on_ticks(times, values, size, ticks, interpolation)
    outputs = {name: _converted(subject, recording, name, column) for name, column in match.outputs.items()}
    for name, values in outputs.items():
        if np.isfinite(values).sum() < 2:
            text = f'{recording.name}: the column "{match.outputs[name]}" for {name} has fewer than two numbers.'
            raise InputError(text, culprit=match.outputs[name])
    replaced = tuple(name for name in match.inputs if name in subject.scenario.signals)
    return Experiment(recording.name, size, ticks, times, inputs, outputs, replaced)


def record_of(subject: Subject, name: str) -> str:
    """What is recorded for an output that is called `name`: a port, or what a column of the system is of."""
    known = subject.scenario.records
    return known[name].signal if not subject.alone and name in known else subject.full(name)


def _inputs(subject: Subject) -> tuple[str, ...]:
    """Inputs that no wire feeds, and signals with one output, which a column can stand for."""
    fed = {wire.target for wire in subject.scenario.wires}
    signals = [name for name, one in subject.scenario.signals.items() if len(one.outputs) == 1]
    return (*(name for name in subject.kind("input") if subject.full(name) not in fed), *signals)


def _outputs(subject: Subject) -> tuple[str, ...]:
    columns = () if subject.alone else tuple(subject.scenario.records)
    return tuple(dict.fromkeys((*columns, *subject.kind("output"))))


def _is_compared(subject: Subject, name: str) -> bool:
    port = subject.ports.get(name)
    return name in _outputs(subject) or (port is not None and port.type in FLOATS and not port.shape)


def _unit_of(signal: Any) -> str:
    return next(iter(signal.outputs.values()), "")


def _converted(subject: Subject, recording: Recording, name: str, column: str) -> Array:
    port = subject.ports.get(name) or subject.ports.get(record_of(subject, name))
    unit = port.unit if port else ""
    try:
        gain, offset = conversion(recording.units.get(column, ""), unit)
    except UnitError as error:
        text = f'{recording.name}: the column "{column}" does not fit {name}: {error}'
        raise InputError(text, culprit=column) from error
    values: Array = gain * np.asarray(recording[column], np.float64) + offset
    return values


def _step(subject: Subject, times: Array) -> float:
    """The step of the rows where they are even; of an FMU with steps of its own a multiple of those."""
    if not subject.alone:
        return subject.scenario.step
    gap = float(np.median(np.diff(times)))
    even = float(times[-1]) / (len(times) - 1)
    size = even if np.all(np.abs(times - even * np.arange(len(times))) <= ON_TICK * even) else gap
    own = subject.own_step
    if own <= 0:
        return size
    return own * max(1, floor(size / own * (1 + MULTIPLE) + MULTIPLE))


def _on_ticks(times: Array, values: Array, size: float, ticks: int, interpolation: str) -> Array:
    """Input at each tick, which the model holds for a step."""
    at = size * np.arange(ticks + 1)
    if interpolation == "linear":
        return np.asarray(np.interp(at + 0.5 * size, times, values), np.float64)
    held: Array = values[np.clip(np.searchsorted(times, at + ON_TICK * size, side="right") - 1, 0, None)]
    return held
