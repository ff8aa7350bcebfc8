"""The virtual drive and the scenarios that the benchmark of the hardware drives it with."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim.hardware.blackbox import read_black_box, recording_of
from cosim.hardware.machine import Machine, changed, read_machine
from cosim.hardware.replay import replay
from cosim.hardware.simulated import Plant
from cosim.hardware.virtual import VirtualDrive
from cosim.hardware.wired import wire_up
from cosim.models.cache import with_fmus
from cosim.system.scenario import Scenario, read_scenario

STEP = 1e-4
PATIENT = read_machine("virtual")
STRICT = read_machine("simulated")


def sidereal(seconds: float) -> Scenario:
    return with_fmus(replace(read_scenario("sidereal"), ticks=round(seconds / STEP)))


@contextmanager
def drive(given: Machine, *, lockstep: bool, port: int = 0) -> Iterator[VirtualDrive]:
    """A virtual drive in a thread of this process; its C holds no lock of Python."""
    with ExitStack() as stack:
        wired = wire_up(sidereal(1.0), stack)
        plant = Plant(wired.plant, wired.torque, wired.position)
        yield stack.enter_context(VirtualDrive(plant, given, STEP, wired.quantum, port=port, lockstep=lockstep))


def over(url: str, given: Machine = PATIENT) -> Machine:
    return changed(given, "benchmark", adapter=url)


def kept(box: Path) -> dict[str, Any]:
    """Say how the black box of a session is, and whether its orders come again, bit for bit."""
    found = read_black_box(box)
    numbers = found.records["sequence"].astype(np.int64)
    again = replay(recording_of(found, "box"))
    return {
        "records": len(numbers),
        "torn": found.torn,
        "gaps": int(np.count_nonzero(np.diff(numbers) != 1)) + int(numbers[0] != 1),
        "replayed_bit_for_bit": again.identical,
        "controller_steps": again.stepped,
    }


def lively(seconds: float = 1.0) -> Scenario:
    """Return a scenario in which something happens within half a second."""
    scenario = sidereal(seconds)
    sine = {"frequency": 1.0, "max_velocity": 2e-3, "smooth_start": 0.1}
    (name, signal), *_ = scenario.signals.items()
    return replace(scenario, signals={name: signal.model_copy(update=sine)})
