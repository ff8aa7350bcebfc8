"""The simulated drive: a plant behind CiA 402 and an encoder, in the loop's own process."""

from dataclasses import dataclass

import numpy as np

from cosim.fmi.component import Component
from cosim.hardware.axis import cycles_of
from cosim.hardware.library import library, part_of
from cosim.hardware.machine import Inject, Machine
from cosim.hardware.structures import CAdapter, CDrive, CInjection
from cosim.hardware.wired import Wired
from cosim.hardware.words import INJECTIONS, OF_FRAMES
from cosim.support.errors import HardwareError
from cosim.support.plain import JsonObject
from cosim.system.scenario import Scenario


class SimulatedDrive:
    """A transport without a wire; `drive` is what it remembers.

    Raises:
        HardwareError: its plant does not start, or a fault of frames is to be injected, and it has none.
    """

    python = False

    def __init__(self, scenario: Scenario, machine: Machine, wired: Wired) -> None:
        framed = [one.kind for one in machine.inject if one.kind in OF_FRAMES]
        if framed:
            message = f'inject.kind = "{framed[0]}" is a fault of frames, and the drive in this process has none.'
            raise HardwareError(message, culprit="inject.kind", value=framed[0])
        self.adapter = CAdapter()
        plant = Plant(wired.plant, wired.torque, wired.position)
        self.drive, self._kept = make_drive(plant, machine, scenario.step, wired.quantum, self.adapter)

    def statistics(self) -> JsonObject:
        """Nothing: no frame is ever lost in a process."""
        return {}

    def close(self) -> None:
        """Nothing to let go of."""


@dataclass(frozen=True)
class Plant:
    """A component that has been started, and the names of its torque and position."""

    component: Component
    torque: str
    position: str


def make_drive(
    plant: Plant, machine: Machine, step: float, quantum: float, adapter: CAdapter
) -> tuple[CDrive, tuple[np.ndarray, ...]]:
    """Return a drive with a plant, and the arrays that must live as long as it.

    Args:
        plant: what it moves.
        machine: its limits, watchdog and faults.
        step: cycle in s.
        quantum: rad a count of its encoder.
        adapter: becomes the table of its functions.

    Raises:
        HardwareError: the plant does not start.
    """
    part, arrays = part_of(plant.component, [plant.torque], [plant.position])
    faults = [_injection(one, step) for one in machine.inject]
    drive = CDrive(
        plant=part,
        watchdog=cycles_of(machine.watchdog_ms, step),
        injections=len(faults),
        injection=(CInjection * len(faults))(*faults),
        step=step,
        quantum=quantum,
        torque=machine.limits.torque,
        slew=machine.limits.slew,
        speed=machine.limits.speed,
        heads=machine.encoder.heads,
        eccentricity=machine.encoder.eccentricity,
    )
    if not library().drive_open(drive, adapter):
        raise HardwareError(f"{machine.name}: the plant of the simulated drive does not start.")
    return drive, arrays


def _injection(one: Inject, step: float) -> CInjection:
    return CInjection(
        INJECTIONS.index(one.kind), round(one.at / step), round((one.at + one.lasts) / step), one.size, one.head
    )
