"""Run an SSP in another tool: python bench/ssp_tools.py TOOL FILE.ssp STEP STEPS OUT.npy [SIGNAL ...]

The file has rows after 0, 1, ... STEPS steps, and a column for each signal; those of SIGNALS where none is named.
Each tool has a process of its own: two of them are C++ libraries that log and fail in their own ways.
"""

import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np

SIGNALS = ("mount.q", "mount.v", "mount.friction", "controller.tau", "reference.position")
TOOLS = {"fmpy": "fmpy", "ecos": "ecospy", "libcosim": "libcosimpy.CosimExecution"}
"""Tools and the Python modules that bring them."""
PARAMETER = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}Parameter"


def run_fmpy(path: str, step: float, steps: int, signals: Sequence[str]) -> np.ndarray:
    """FMPy shows outputs only from the first step on; before it they are those of rest, zero."""
    from fmpy.ssp.simulation import simulate_ssp

    rows = simulate_ssp(path, stop_time=(steps - 0.5) * step, step_size=step, parameter_set=values_in(path))
    return np.vstack([np.zeros(len(signals)), np.column_stack([rows[name] for name in signals])])


def values_in(path: str) -> SimpleNamespace:
    """What FMPy takes for a parameter set: those of all components in one; it does not read an archive's own."""
    found = []
    with zipfile.ZipFile(path) as archive:
        for file in (name for name in archive.namelist() if name.endswith(".ssv")):
            for one in ElementTree.fromstring(archive.read(file)).iter(PARAMETER):
                name, number = f"{Path(file).stem}.{one.get('name')}", one[0].get("value")
                found.append(SimpleNamespace(name=name, value=float(number or 0)))
    return SimpleNamespace(parameters=found)


def run_ecos(path: str, step: float, steps: int, signals: Sequence[str]) -> np.ndarray:
    from ecospy import EcosSimulation

    with EcosSimulation(ssp_path=path, step_size=step) as simulation:
        assert simulation.init(parameter_set="card")
        rows = [[simulation.get_real(name.replace(".", "::")) for name in signals]]
        for _ in range(steps):
            simulation.step()
            rows.append([simulation.get_real(name.replace(".", "::")) for name in signals])
        simulation.terminate()
    return np.array(rows)


def run_libcosim(path: str, step: float, steps: int, signals: Sequence[str]) -> np.ndarray:
    """Libcosim takes the step from the archive."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver

    execution, observer = CosimExecution.from_ssp_file(path), CosimObserver.create_last_value()
    execution.add_observer(observer)
    places = []
    for owner, _, name in (signal.partition(".") for signal in signals):
        index = execution.slave_index_from_instance_name(owner)
        places += [(index, one.reference) for one in execution.slave_variables(index) if one.name.decode() == name]
    rows = [np.zeros(len(signals))]
    for _ in range(steps):
        assert execution.step()
        rows.append(np.array([observer.last_real_values(index, [place])[0] for index, place in places]))
    assert abs(execution.status().current_time - 1e9 * step * steps) < 1
    return np.array(rows)


if __name__ == "__main__":
    tool, path, step, steps, out, *named = sys.argv[1:]
    np.save(out, globals()[f"run_{tool}"](path, float(step), int(steps), named or SIGNALS))
