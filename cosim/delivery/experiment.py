"""The experiment that an FMU of ours carries: a stimulus, and what the FMU makes of it here, as FMI-LS-REF says.

`cosim check`, and any tool that knows the layered standard, then sees whether the FMU runs elsewhere as it did here.
The stimulus is a recording's, or where there is none a sine for each input. What was measured lies beside it.
Reference: FMI Layered Standard References 1.0.0-beta.1; Experiments Format (ma-hs-experiments), draft of 2026.
"""

import csv
import io
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import pi
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.data.recording import Recording
from cosim.experiments.experiment_file import CSV, KINDS, SET
from cosim.experiments.run import Settings, system_of
from cosim.experiments.series import TIME, Series
from cosim.fmi.component import Port
from cosim.fmi.description import describe
from cosim.fmi.types import FLOATS
from cosim.fmi.variables import ports_of
from cosim.master.simulate import simulate
from cosim.support.errors import CosimError
from pyfmi_models.export.description import xml_text
from pyfmi_models.export.platforms import host
from pyfmi_models.export.related import Related
from pyfmi_models.export.ssp import NAMESPACES
from pyfmi_models.model import Model, Variable

Array = npt.NDArray[np.float64]
ROWS = 2000
"""Rows of a recording that are carried at most: they make the archive some 100 kB larger."""
SECONDS, STEP, EVERY = 2.0, 1e-3, 10
"""Length and step of an experiment without a recording [s], and its steps for each row."""
SIZES = {"N.m": 1.0, "N": 1.0, "rad": 1e-2, "m": 1e-2}
"""Amplitudes of such an experiment by unit; a hundredth of any other."""


@dataclass(frozen=True)
class Stimulus:
    """Inputs of shape (rows,) over times [s] from 0 on, the step of the simulation, and what was measured."""

    name: str
    description: str
    times: Array
    inputs: Mapping[str, Array]
    step: float
    measured: Mapping[str, Array] = field(default_factory=dict)
    rows: Array = field(default_factory=lambda: np.zeros(0))
    """Times of what was measured and of the reference, where they are not those of the inputs [s]."""
    compared: tuple[str, ...] = ()
    """Variables of the reference; () is each output."""
    values: Mapping[str, float] = field(default_factory=dict)
    """Parameters and start values of this experiment, by name."""


def sines(model: Model) -> Stimulus:
    """A sine for each input of a model, each with its own frequency; the step is the model's where it is sampled."""
    step = model.period or STEP
    times: Array = EVERY * step * np.arange(round(SECONDS / (EVERY * step)) + 1, dtype=np.float64)
    inputs = {
        one.name: _size(one) * np.sin(2 * pi * (1 + 0.5 * k) / SECONDS * 2 * times)
        for k, one in enumerate(model.inputs)
    }
    return Stimulus("default", "A sine for each input", times, inputs, step)


def of_recording(recording: Recording, model: Model) -> Stimulus:
    """The first rows of a recording that feed a model: torque in, position measured."""
    rows = slice(0, ROWS)
    times = np.asarray(recording.t[rows] - recording.t[0], np.float64)
    names = {one.name for one in model.inputs}
    inputs = {name: np.asarray(recording[name][rows]) for name in recording.columns if name in names}
    measured = {name: np.asarray(recording[name][rows]) for name in ("q", "v") if name in recording}
    said = f"Torque of the recording {recording.name}, open loop"
    return Stimulus(recording.name, said, times, inputs, float(np.median(np.diff(times))), measured)


def with_experiment(
    export: Callable[[Sequence[Related]], Path], stimulus: Stimulus, platforms: Sequence[str] = ()
) -> Path:
    """Export an FMU, simulate the stimulus with it, and export it again with both.

    An FMU without a binary for this machine, or one that cannot follow the stimulus, carries none.

    Args:
        export: writes the FMU with related files, and returns its path.
        stimulus: of the experiment.
        platforms: those that the FMU has binaries for; () is this machine's.
    """
    path = export(())
    if not stimulus.inputs or (platforms and host() not in platforms):
        return path
    try:
        return export(experiment_files(path, stimulus))
    except CosimError:  # a model that cannot follow this stimulus may be right all the same
        return path


def experiment_files(path: Path, stimulus: Stimulus, folder: str = "") -> tuple[Related, ...]:
    """Simulate a stimulus with an FMU and return the files of the experiment, in a folder ("" or "name/")."""
    ports = ports_of(describe(path))
    ticks = round(float(stimulus.times[-1]) / stimulus.step)
    settings = Settings(0.0, stimulus.step, ticks)
    series = Series(stimulus.times, stimulus.inputs, {}, ())
    values = {name: _typed(ports[name], value) for name, value in stimulus.values.items()}
    asked = Series(stimulus.times, {name: stimulus.times for name in stimulus.compared}, {}, ())
    columns = simulate(
        system_of(path, ports, settings, series, values, asked if stimulus.compared else None, "")
    ).recording.table
    measured_at = stimulus.rows if len(stimulus.rows) else stimulus.times
    rows = np.minimum(np.rint(measured_at / stimulus.step).astype(np.intp), ticks)
    at: Array = stimulus.step * rows.astype(np.float64)
    reference = {name: values[rows] for name, values in columns.items() if name != "t" and np.isfinite(values).all()}
    found = [
        Related(KINDS[0], "experiments.exp", "experiment/smoke-test", stimulus.description, _file(stimulus, ticks)),
        Related(CSV, "stimulus.csv", "other", "Stimulus of the experiment", _csv(stimulus.times, stimulus.inputs)),
        Related(CSV, "reference.csv", "other", "What the FMU gave where it was made", _csv(at, reference)),
    ]
    if values:
        found.append(Related(SET, "values.ssv", "other", "Values of the experiment", _set(stimulus.name, values)))
    if stimulus.measured:
        said = f"What was measured in the recording {stimulus.name}"
        found.append(Related(CSV, "measured.csv", "result", said, _csv(measured_at, stimulus.measured)))
    return tuple(replace(one, source=f"{folder}{one.source}") for one in found)


def _typed(port: Port, value: float) -> float | int | bool:
    return float(value) if port.type in FLOATS else bool(value) if port.type == "Boolean" else int(value)


def _set(name: str, values: Mapping[str, float | int | bool]) -> bytes:
    """A parameter set of SSP, in the units of the variables."""
    kinds = {float: "Real", int: "Integer", bool: "Boolean"}
    root = ET.Element("ssv:ParameterSet", {"xmlns:ssv": NAMESPACES["ssv"], "version": "1.0", "name": name})
    group = ET.SubElement(root, "ssv:Parameters")
    for key, value in values.items():
        parameter = ET.SubElement(group, "ssv:Parameter", name=key)
        ET.SubElement(parameter, f"ssv:{kinds[type(value)]}", value=repr(value).lower())
    return xml_text(root)


def _size(variable: Variable) -> float:
    size = SIZES.get(variable.unit, 1e-2)
    return float(np.clip(size, max(variable.low, -size), min(variable.high, size)))


def _file(stimulus: Stimulus, ticks: int) -> bytes:
    root = ET.Element("Experiments", name=stimulus.name, description=stimulus.description)
    times = {"startTime": "0.0", "stopTime": repr(ticks * stimulus.step), "stepSize": repr(stimulus.step)}
    one = ET.SubElement(root, "Experiment", name=stimulus.name, description=stimulus.description)
    ET.SubElement(one, "TransientSimulation", times)
    if stimulus.values:
        ET.SubElement(one, "Parameters", source="values.ssv")
    ET.SubElement(one, "Stimuli", source="stimulus.csv")
    ET.SubElement(one, "References", source="reference.csv")
    return xml_text(root)


def _csv(times: Array, columns: Mapping[str, Array]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([TIME, *columns])
    rows = zip(times.tolist(), *(values.tolist() for values in columns.values()), strict=True)
    writer.writerows([repr(float(one)) for one in row] for row in rows)
    return text.getvalue().encode()
