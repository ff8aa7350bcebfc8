"""EMPS as nonlinear_benchmarks judges it: position simulated in open loop from the force, 20 samples to start from.

The model may be made of the training run alone. On the test run (pulses) it gets all forces and the first 20 positions;
judged is the RMS of measured minus simulated position from sample 20 on, in mm. Nothing pulls the simulation back to
the measurement, so an error of the model adds up: this asks for more than a torque residual does.

Reference: Beintema, Schoukens et al., package nonlinear_benchmarks (function EMPS, state_initialization_window_length
20, submission example); nonlinearbenchmark.org.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from cosim.data.recording import Recording
from cosim.estimation.identify.machine import Machine
from pyfmi_models.mount import Mount

Array = npt.NDArray[np.float64]
GIVEN = 20
"""Positions that a model may look at."""
STEPS = 3
"""Corrections of position and speed at the start: friction turns where the speed does, so one is not enough."""


def open_loop(mount: Mount, force: Array, tick: float, first: Array) -> Array:
    """Positions of the plant under forces that are held for a tick each; it starts as fits its first positions best."""
    machine, forces = Machine(mount.model(), None, (), tick), np.asarray(force, float)[:, None]

    def moved(position: float, speed: float, ticks: int) -> Array:
        start = {"position": position, "speed": speed}
        return machine.run(np.zeros(0), forces[:ticks], start)[0][:, 0]

    position, speed = float(first[0]), 0.0
    t = tick * np.arange(len(first))
    for _ in range(STEPS):
        faster, further = np.polyfit(t, first - moved(position, speed, len(first)), 1)
        position, speed = position + float(further), speed + float(faster)
    return moved(position, speed, len(forces))


def position_error(mount: Mount, recordings: Sequence[Recording]) -> float:
    """RMS of measured minus simulated position after the given samples [mm], all recordings together."""
    left = []
    for run in recordings:
        measured = np.asarray(run["q"])
        found = open_loop(mount, np.asarray(run["tau"]), run.sample_time, measured[:GIVEN])
        left.append((measured - found)[GIVEN:])
    return 1e3 * float(np.sqrt(np.mean(np.concatenate(left) ** 2)))
