"""An FMU stepped in FMPy, and a system run by the master and as one such FMU."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from fmpy import extract, read_model_description
from fmpy.simulation import instantiate_fmu

from cosim.master.simulate import simulate
from cosim.system.system import System
from cosim_nesting.nest import nest

Rows = dict[str, np.ndarray]


class InFmpy:
    """An FMU in FMPy; its steps are those of its default experiment unless another is given."""

    def __init__(self, path: Path, step: float | None = None) -> None:
        self.description = read_model_description(path)
        self.places = {one.name: one.valueReference for one in self.description.modelVariables}
        self.fmu = instantiate_fmu(extract(path), self.description, "CoSimulation")
        self.step = step or float(self.description.defaultExperiment.stepSize)
        two = self.description.fmiVersion == "2.0"
        self._set, self._get = (
            (self.fmu.setReal, self.fmu.getReal) if two else (self.fmu.setFloat64, self.fmu.getFloat64)
        )

    def set(self, values: Mapping[str, float]) -> None:
        self._set([self.places[name] for name in values], list(values.values()))

    def get(self, names: list[str]) -> list[float]:
        return list(self._get([self.places[name] for name in names]))

    def start(self, values: Mapping[str, float] | None = None) -> None:
        self.set(values or {})
        if self.description.fmiVersion == "2.0":
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def run(self, names: list[str], steps: int, every: int = 1, inputs: Mapping[str, np.ndarray] | None = None) -> Rows:
        """Rows of variables at the start of each step and at the end of the last."""
        rows, size = [self.get(names)], every * self.step
        for k in range(steps):
            self.set({name: float(values[k]) for name, values in (inputs or {}).items()})
            self.fmu.doStep(k * size, size)
            rows.append(self.get(names))
        return dict(zip(names, np.array(rows).T, strict=True))

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()


def nested(system: System, folder: Path, fmi: int) -> InFmpy:
    """Export a system and load it."""
    path = folder / f"system{fmi}.fmu"
    nest(system, {fmi: path})
    return InFmpy(path)


def both(system: System, folder: Path, fmi: int, every: int = 1) -> tuple[Rows, Rows]:
    """Recorded outputs of a run, and the same from the FMU; each has what the columns of the system are called."""
    named = {column: str(record.signal) for column, record in system.records.items()}
    recording = simulate(system).recording
    fmu = nested(system, folder, fmi)
    fmu.start()
    rows = fmu.run(list(named.values()), system.ticks // every, every)
    fmu.close()
    ours = {column: np.asarray(recording[column])[::every] for column in named}
    return ours, {column: rows[name][: len(ours[column])] for column, name in named.items()}


def assert_same_bits(ours: Rows, theirs: Rows) -> None:
    for column, values in ours.items():
        np.testing.assert_array_equal(values, theirs[column], err_msg=column)
        assert np.ptp(values) > 0, f"{column} does not move"
