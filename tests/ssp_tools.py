"""Run an SSP in another tool: python tests/ssp_tools.py TOOL FILE.ssp STEP STEPS OUT.npy (rows: 0, 1, ... STEPS steps).

Each tool has a process of its own: two of them are C++ libraries that log and fail in their own ways.
"""

import sys

import numpy as np

SIGNALS = ("mount.q", "mount.v", "mount.friction", "controller.tau", "reference.position")
TOOLS = {"fmpy": "fmpy", "ecos": "ecospy", "libcosim": "libcosimpy.CosimExecution"}
"""Tools and the Python modules that bring them."""


def run_fmpy(path: str, step: float, steps: int) -> np.ndarray:
    """FMPy shows outputs only from the first step on; before it they are those of rest, zero."""
    from fmpy.ssp.simulation import simulate_ssp

    rows = simulate_ssp(path, stop_time=(steps - 0.5) * step, step_size=step)
    return np.vstack([np.zeros(len(SIGNALS)), np.column_stack([rows[name] for name in SIGNALS])])


def run_ecos(path: str, step: float, steps: int) -> np.ndarray:
    from ecospy import EcosSimulation

    with EcosSimulation(ssp_path=path, step_size=step) as simulation:
        assert simulation.init(parameter_set="card")
        rows = [[simulation.get_real(name.replace(".", "::")) for name in SIGNALS]]
        for _ in range(steps):
            simulation.step()
            rows.append([simulation.get_real(name.replace(".", "::")) for name in SIGNALS])
        simulation.terminate()
    return np.array(rows)


def run_libcosim(path: str, step: float, steps: int) -> np.ndarray:
    """Libcosim takes the step from the archive."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver

    execution, observer = CosimExecution.from_ssp_file(path), CosimObserver.create_last_value()
    execution.add_observer(observer)
    places = []
    for owner, _, name in (signal.partition(".") for signal in SIGNALS):
        index = execution.slave_index_from_instance_name(owner)
        places += [(index, one.reference) for one in execution.slave_variables(index) if one.name.decode() == name]
    rows = [np.zeros(len(SIGNALS))]
    for _ in range(steps):
        assert execution.step()
        rows.append(np.array([observer.last_real_values(index, [place])[0] for index, place in places]))
    assert abs(execution.status().current_time - 1e9 * step * steps) < 1
    return np.array(rows)


if __name__ == "__main__":
    tool, path, step, steps, out = sys.argv[1:]
    np.save(out, globals()[f"run_{tool}"](path, float(step), int(steps)))
