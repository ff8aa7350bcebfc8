"""A virtual drive in this process, and a session that reaches it over UDP."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from on_hardware import SIMULATED, scenario

from cosim.hardware.machine import Machine, changed, read_machine
from cosim.hardware.session import Session
from cosim.hardware.simulated import Plant
from cosim.hardware.udp import UdpDrive
from cosim.hardware.virtual import VirtualDrive
from cosim.hardware.wired import wire_up

AT = 0.2


@contextmanager
def drive(
    given: Machine = SIMULATED, *, lockstep: bool = True, scale: float = 1.0, **options: Any
) -> Iterator[VirtualDrive]:
    with ExitStack() as stack:
        what = scenario()
        wired = wire_up(what, stack)
        plant = Plant(wired.plant, wired.torque, wired.position)
        yield stack.enter_context(
            VirtualDrive(
                plant, given, options.pop("step", what.step), wired.quantum * scale, lockstep=lockstep, **options
            )
        )


def over(url: str, given: Machine = SIMULATED, **changes: Any) -> Machine:
    return changed(given, "test", adapter=url, **changes)


def faulty(**inject: Any) -> Machine:
    return changed(SIMULATED, "test", inject=[{"at": AT} | inject])


def session(folder: Path, url: str, given: Machine = SIMULATED, **options: Any) -> Session:
    return Session(scenario(), over(url, given), folder / "box", **({"fast": True} | options))


def impatient(one: Session, milliseconds: int = 10) -> Session:
    """Wait for an answer that does not come for so long only."""
    assert isinstance(one.transport, UdpDrive)
    one.transport.udp.patience = milliseconds * 1_000_000
    return one


LATER = {"heartbeat_ms": 500.0, "late_in_a_row": 1000, "window_ms": 5.0}
PATIENT = changed(read_machine("virtual"), "test", reactions=read_machine("virtual").reactions.model_dump() | LATER)
"""A machine whose reactions wait for a computer that has more to do."""
