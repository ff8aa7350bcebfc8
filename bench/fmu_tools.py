"""Load one FMU in another tool and step it: python bench/fmu_tools.py TOOL FILE.fmu STEPS OUT.npz

Writes the rows of all outputs after 1, 2, ... STEPS steps under the inputs of START, and the seconds from the
path to the end of the first step. Each tool has a process of its own: two of them are C++ libraries that log and fail
in their own ways.
"""

import sys
from collections.abc import Iterator
from time import perf_counter

import numpy as np
from fmpy import read_model_description

STEP = 2.0**-9
"""Exact in binary and in whole nanoseconds, so that no tool rounds the time in its own way."""
START = {"tau": 6.0, "disturbance": 0.5, "q": 1e-3, "q_d": 2e-3, "v_d": 1e-2, "a_d": 0.1}
TOOLS = {"fmpy": ("fmpy", (2, 3)), "ecos": ("ecospy", (2, 3)), "libcosim": ("libcosimpy.CosimExecution", (2,))}
"""Tools, the Python modules that bring them, the versions of FMI that they know."""
Rows = Iterator[list[float]]


def names_of(path: str) -> tuple[list[str], dict[str, float]]:
    """Outputs, and the inputs with their values."""
    variables = read_model_description(path).modelVariables
    outputs = [one.name for one in variables if one.causality == "output"]
    return outputs, {one.name: START[one.name] for one in variables if one.causality == "input"}


def fmpy(path: str) -> Rows:
    from fmpy import extract
    from fmpy.simulation import instantiate_fmu

    outputs, inputs = names_of(path)
    description = read_model_description(path)
    place = {one.name: one.valueReference for one in description.modelVariables}
    fmu = instantiate_fmu(extract(path), description, "CoSimulation")
    two = description.fmiVersion == "2.0"
    if two:
        fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    put, get = (fmu.setReal, fmu.getReal) if two else (fmu.setFloat64, fmu.getFloat64)
    put([place[name] for name in inputs], list(inputs.values()))
    fmu.exitInitializationMode()
    k = 0
    while True:
        fmu.doStep(k * STEP, STEP)
        k += 1
        yield list(get([place[name] for name in outputs]))


def ecos(path: str) -> Rows:
    from ecospy import EcosSimulation, EcosSimulationStructure

    outputs, inputs = names_of(path)
    structure = EcosSimulationStructure()
    structure.add_model("it", path)
    structure.add_parameter_set("start", {f"it::{name}": value for name, value in inputs.items()})
    simulation = EcosSimulation(structure=structure, step_size=STEP)
    assert simulation.init(parameter_set="start")
    while True:
        simulation.step()
        yield [simulation.get_real(f"it::{name}") for name in outputs]


def libcosim(path: str) -> Rows:
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    outputs, inputs = names_of(path)
    execution, observer = CosimExecution.from_step_size(STEP * 1e9), CosimObserver.create_last_value()
    execution.add_local_slave(CosimLocalSlave(path, "it"))
    execution.add_observer(observer)
    index = execution.slave_index_from_instance_name("it")
    place = {one.name.decode(): one.reference for one in execution.slave_variables(index)}
    for name, value in inputs.items():
        execution.real_initial_value(index, place[name], value)
    while True:
        assert execution.step()
        yield list(observer.last_real_values(index, [place[name] for name in outputs]))


if __name__ == "__main__":
    tool, file, steps, out = sys.argv[1:]
    __import__(TOOLS[tool][0])
    begun = perf_counter()
    rows = globals()[tool](file)
    found = [next(rows)]
    seconds = perf_counter() - begun
    found += [next(rows) for _ in range(int(steps) - 1)]
    np.savez(out, rows=np.array(found), seconds=seconds)
