"""What a virtual drive tells of itself: its states, and torques that its watchdog took away."""

from types import SimpleNamespace

import pytest

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
