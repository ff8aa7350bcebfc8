"""Who steps the loop of two FMUs in master_step.py: a plain C loop, cosim, and what others give Python users.

Each runner takes the folder with plant.fmu and controller.fmu, the FMI version and the number of steps, and returns the
seconds that stepping took, start-up not counted. The same work for all: the controller holds a constant speed (kp = 0).
Run in a process of its own, because libraries of others may crash: python master_runners.py RUNNER FOLDER FMI STEPS
"""

import ctypes
import gc
import os
import sys
import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from time import perf_counter
from typing import Any

STEP = 1e-4
START = {"controller": {"kp": 0.0, "v_d": 0.01}, "plant": {"speed": 0.01}}
WIRES = {"plant": ("tau", "q"), "controller": ("q", "tau")}
"""The input that is fed and the output that feeds the other one."""
RECORD = {name: f"plant.{name}" for name in ("q", "v", "friction", "applied")}
RECORD |= {"tau": "controller.tau", "measured": "controller.q"}
RECORDED = {"plant": ("q", "v", "friction", "applied"), "controller": ("tau",)}
"""What a C loop reads of each for these columns: the last one is the wire from q."""


class Side(ctypes.Structure):
    """One FMU as plain_loop.c wants it."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("instance", "set", "get", "step")),
        *((name, ctypes.c_uint32) for name in ("input", "output")),
        ("recorded", ctypes.c_uint32 * 4),
        ("columns", ctypes.c_size_t),
    )


def c(folder: Path, fmi: int, steps: int) -> float:
    return _in_c(folder, fmi, steps, kept=False)


def recording_c(folder: Path, fmi: int, steps: int) -> float:
    """The same with the six signals and the time of each tick kept in memory."""
    return _in_c(folder, fmi, steps, kept=True)


def _in_c(folder: Path, fmi: int, steps: int, kept: bool) -> float:
    import numpy as np

    from cosim.fmi.fmu import FmuComponent
    from pyfmi_models.export.build import FLAGS, compile_shared
    from pyfmi_models.export.platforms import PLATFORMS, host

    source = Path(__file__).with_name("plain_loop.c").read_bytes()
    platform = PLATFORMS[host()]
    library = ctypes.CDLL(str(compile_shared({"plain.c": source}, f"plain{platform.suffix}", platform.target, FLAGS)))
    with ExitStack() as stack:
        sides = []
        for name, ports in WIRES.items():
            component = stack.enter_context(FmuComponent(folder / f"{name}.fmu"))
            component.start(START[name])
            functions, references = component.functions, [component.ports[port].reference for port in ports]
            recorded = [component.ports[port].reference for port in RECORDED[name]]
            given = (functions.instance, functions.set, functions.get, functions.step, *references)
            sides.append(Side(*given, (ctypes.c_uint32 * 4)(*recorded), len(recorded)))
        run = getattr(library, f"{'recording' if kept else 'plain'}{fmi}")
        begun = perf_counter()
        room = [np.empty((steps, len(RECORD) + 1))] if kept else []
        rows = [one.ctypes.data_as(ctypes.c_void_p) for one in room]
        status = run(*map(ctypes.byref, sides), ctypes.c_double(STEP), ctypes.c_int64(steps), *rows)
        seconds = perf_counter() - begun
    assert status <= 1, status
    return seconds


def cosim(folder: Path, fmi: int, steps: int, compiled: bool = True, algorithm: Any = None) -> float:
    """All of `simulate` with six signals streamed to Parquet, file closed; minus the same for one step."""
    from cosim.fmi.fmu import FmuComponent
    from cosim.master.simulate import Options, simulate
    from cosim.system.algorithm import JACOBI
    from cosim.system.system import System
    from cosim.system.wire import Record, Wire

    wires = [Wire("controller.tau", "plant.tau"), Wire("plant.q", "controller.q")]
    told: dict[str, Any] = {"wires": wires, "records": {name: Record(one) for name, one in RECORD.items()}}
    told |= {"step": STEP, "parameters": START, "algorithm": algorithm or JACOBI}
    seconds = []
    with tempfile.TemporaryDirectory() as out, ExitStack() as stack:
        components = {name: stack.enter_context(FmuComponent(folder / f"{name}.fmu")) for name in WIRES}
        for ticks in (1, steps):
            gc.collect()  # what start-up left takes 20 ms, which else fall into either run as chance has it
            begun = perf_counter()
            path = Path(out) / f"{ticks}.parquet"
            simulate(System(components=components, ticks=ticks, **told), Options(path, compiled=compiled))
            seconds.append(perf_counter() - begun)
    return seconds[1] - seconds[0]


def gauss_seidel(folder: Path, fmi: int, steps: int) -> float:
    from cosim.system.algorithm import GaussSeidel

    return cosim(folder, fmi, steps, algorithm=GaussSeidel(kind="gauss-seidel"))


def interpreted(folder: Path, fmi: int, steps: int) -> float:
    return cosim(folder, fmi, steps, compiled=False)


def isolated(folder: Path, fmi: int, steps: int) -> float:
    """As `cosim`, in a process of its own; minus the same for one step, so its start is not counted either."""
    from cosim.master.isolated import run_isolated
    from cosim.master.simulate import Options
    from cosim.system.scenario import parse_scenario

    parameters = {name: ", ".join(f"{key} = {value}" for key, value in START[name].items()) for name in WIRES}
    parts = [f'[components.{name}]\nfmu = "{name}.fmu"\nparameters = {{ {parameters[name]} }}\n' for name in WIRES]
    wires = [("controller.tau", "plant.tau"), ("plant.q", "controller.q")]
    parts += [f'[[connections]]\nfrom = "{source}"\nto = "{target}"\n' for source, target in wires]
    parts += ["[record.signals]\n", *(f'{name} = "{signal}"\n' for name, signal in RECORD.items())]
    seconds = []
    with tempfile.TemporaryDirectory() as out:
        for ticks in (1, steps):
            text = f"step = {STEP}\nstop = {ticks * STEP}\n" + "".join(parts)
            scenario = parse_scenario(text, "isolated", folder.absolute())
            begun = perf_counter()
            run_isolated(scenario, Options(Path(out) / f"{ticks}.parquet"))
            seconds.append(perf_counter() - begun)
    return seconds[1] - seconds[0]


def fmpy(folder: Path, fmi: int, steps: int) -> float:
    """The loop that FMPy's users write: get, set and doStep of its slaves."""
    from cosim.fmi.fmu import FmuComponent

    with ExitStack() as stack:
        plant, controller = (stack.enter_context(FmuComponent(folder / f"{name}.fmu")) for name in WIRES)
        for one, name in ((plant, "plant"), (controller, "controller")):
            one.start(START[name])
        p, c = plant._fmu, controller._fmu
        (tau_in, q_out), (q_in, tau_out) = (
            [[one.ports[port].reference] for port in WIRES[name]]
            for one, name in ((plant, "plant"), (controller, "controller"))
        )
        get, put = ("getReal", "setReal") if fmi == 2 else ("getFloat64", "setFloat64")
        p_get, p_set, c_get, c_set = getattr(p, get), getattr(p, put), getattr(c, get), getattr(c, put)
        begun = perf_counter()
        for k in range(steps):
            q, tau = p_get(q_out), c_get(tau_out)
            p_set(tau_in, tau)
            c_set(q_in, q)
            p.doStep(k * STEP, STEP)
            c.doStep(k * STEP, STEP)
        return perf_counter() - begun


def ecospy(folder: Path, fmi: int, steps: int) -> float:
    """`step(N)`, which records nothing."""
    from ecospy import EcosSimulation, EcosSimulationStructure

    with EcosSimulationStructure() as structure:
        for name in WIRES:
            structure.add_model(name, str(folder / f"{name}.fmu"))
        structure.make_real_connection("controller::tau", "plant::tau")
        structure.make_real_connection("plant::q", "controller::q")
        values = {f"{name}::{key}": value for name, start in START.items() for key, value in start.items()}
        structure.add_parameter_set("start", values)
        with EcosSimulation(structure=structure, step_size=STEP) as simulation:
            simulation.init(parameter_set="start")
            begun = perf_counter()
            simulation.step(steps)
            return perf_counter() - begun


def libcosimpy(folder: Path, fmi: int, steps: int) -> float:
    """`step(N)` of the fixed-step algorithm, which records nothing."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimSlave import CosimLocalSlave

    from cosim.fmi.description import describe
    from cosim.fmi.variables import ports_of

    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_step_size(STEP * 1e9)
    references: dict[str, dict[str, int]] = {}
    index = {}
    for name in WIRES:
        path = folder / f"{name}.fmu"
        references[name] = {port.name: port.reference for port in ports_of(describe(path)).values()}
        execution.add_local_slave(CosimLocalSlave(str(path), name))
        index[name] = execution.slave_index_from_instance_name(name)
        for key, value in START[name].items():
            execution.real_initial_value(index[name], references[name][key], value)
    for source, target in (("controller", "plant"), ("plant", "controller")):
        ends = references[source][WIRES[source][1]], references[target][WIRES[target][0]]
        execution.connect_real_variables(index[source], ends[0], index[target], ends[1])
    execution.step(1)
    begun = perf_counter()
    execution.step(steps)
    return perf_counter() - begun


RUNNERS: dict[str, Callable[[Path, int, int], float]] = {
    one.__name__: one for one in (c, recording_c, cosim, gauss_seidel, isolated, interpreted, fmpy, ecospy, libcosimpy)
}

if __name__ == "__main__":
    runner, place, version, count = sys.argv[1:]
    print("seconds", RUNNERS[runner](Path(place), int(version), int(count)), flush=True)
    os._exit(0)  # some libraries of others crash when they are unloaded; the number is out
