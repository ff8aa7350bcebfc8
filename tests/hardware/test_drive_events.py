"""What a virtual drive tells of itself: its states, and torques that its watchdog took away."""

from types import SimpleNamespace

import pytest
from on_hardware import SIMULATED
from over_udp import drive

from cosim.hardware.machine import changed
from cosim.hardware.virtual import Event, VirtualDrive
from cosim.hardware.words import STATES


def test_a_drive_tells_each_change_once_and_what_its_watchdog_took(monkeypatch: pytest.MonkeyPatch) -> None:
    there = object.__new__(VirtualDrive)
    there.drive = SimpleNamespace(state=0, held=0.0)  # type: ignore[assignment]
    there.virtual = SimpleNamespace(trips=0, silence=0, taken=0.0, let_go=0)  # type: ignore[assignment]
    waits: list[float] = []

    def later(seconds: float) -> None:
        """What happens between two looks: nothing, operation, a trip, nothing, another one in the same state."""
        waits.append(seconds)
        assert len(waits) < 9, "nothing more is told"
        if len(waits) == 2:
            there.drive.state, there.drive.held = 4, 1.5
        elif len(waits) in (3, 5):
            there.virtual.trips += 1
            there.virtual.silence, there.virtual.taken, there.virtual.let_go = 20_500_000 + len(waits), -2.5, 77
            there.drive.state, there.drive.held = 7, 0.0

    monkeypatch.setattr("cosim.hardware.virtual.sleep", later)
    told = there.events()
    found = [next(told) for _ in range(5)]
    assert found == [
        Event("state", STATES[0], {"torque": 0.0}),
        Event("state", STATES[4], {"torque": 1.5}),
        Event("watchdog", STATES[7], {"silence_ms": 20.500003, "torque_taken": -2.5, "clock_ns": 77}),
        Event("state", STATES[7], {"torque": 0.0}),
        Event("watchdog", STATES[7], {"silence_ms": 20.500005, "torque_taken": -2.5, "clock_ns": 77}),
    ]
    assert len(waits) == 5
    assert 0 < max(waits) <= 0.1


@pytest.mark.parametrize("lockstep", [True, False])
def test_a_drive_counts_in_the_units_of_its_clock(lockstep: bool) -> None:
    """Nanoseconds; a session is free after a second without an order, or the watchdog's time where that is longer."""
    patient = changed(SIMULATED, "test", watchdog_ms=1500.0)
    for machine, lease in ((SIMULATED, 1_000_000_000), (patient, 1_500_000_000)):
        with drive(machine, lockstep=lockstep) as there:
            assert there.virtual.period == (0 if lockstep else 100_000)
            assert there.virtual.watchdog == machine.watchdog_ms * 1_000_000
            assert there.virtual.lease == lease
            assert there.virtual.ahead == max(1000, there.drive.watchdog)
