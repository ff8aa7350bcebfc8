"""What carries orders and answers between the loop and a drive: the choice of a machine file's `adapter`."""

from typing import Protocol

from cosim.hardware.machine import Machine, plugged
from cosim.hardware.python_adapter import PythonTransport, load_adapter
from cosim.hardware.simulated import SimulatedDrive
from cosim.hardware.structures import CAdapter
from cosim.hardware.udp import UdpDrive
from cosim.hardware.wired import Wired
from cosim.support.plain import JsonObject
from cosim.support.plugins import TRANSPORTS, loaded
from cosim.system.scenario import Scenario


class Transport(Protocol):
    """A way to a drive: the table of functions that the loop calls, and what is known of the way."""

    adapter: CAdapter
    python: bool
    """Whether its functions need the interpreter, so that the loop must be a thread of this process."""

    def statistics(self) -> JsonObject:
        """Return what was counted on the way."""

    def close(self) -> None:
        """Let go of it; no cycle comes any more."""


def open_transport(scenario: Scenario, machine: Machine, wired: Wired, fast: bool) -> Transport:
    """Open the way to the drive that a machine file names.

    Raises:
        HardwareError: it does not lead to a drive that fits.
    """
    if machine.adapter.startswith("udp://"):
        return UdpDrive(machine, scenario.step, fast)
    if ".py:" in machine.adapter:
        return PythonTransport(load_adapter(machine.adapter, scenario.step))
    if name := plugged(machine.adapter):
        return PythonTransport(loaded(TRANSPORTS, name)(machine, scenario.step))
    return SimulatedDrive(scenario, machine, wired)
