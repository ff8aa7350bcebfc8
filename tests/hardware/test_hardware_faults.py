"""Torque is zero on any doubt: of the drive, the loop, the controller or the clock."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from on_hardware import AT, INJECTED, SCENARIO, assert_safe, machine, recorded, scenario, session
from tiny_fmu import described, description

from cosim.hardware.machine import Machine
from cosim.hardware.replay import replay
from cosim.hardware.session import Session, run_session
from cosim.hardware.words import FAULTS
from cosim.models.cache import with_fmus
from cosim.support.errors import HardwareError
from cosim.system.scenario import parse_scenario


@pytest.mark.parametrize(
    ("fault", "inject", "within"),
    [*((fault, *INJECTED[fault]) for fault in INJECTED), ("frame_lost", {"kind": "dead"}, 3)],
)
def test_each_fault_of_the_drive_is_found_and_ends_in_fault_without_torque(
    tmp_path: Path, fault: str, inject: dict[str, Any], within: int
) -> None:
    with session(tmp_path, machine(**inject)) as one:
        done = run_session(one)
    assert (done["completed"], done["state"]) == (False, "fault")
    assert fault in done["faults"]
    found = recorded(tmp_path)
    assert_safe(found, fault, round(AT / 1e-4), within)
    assert replay(found).identical


@pytest.mark.parametrize("kind", ["lost", "stale"])
def test_what_is_short_is_survived(tmp_path: Path, kind: str) -> None:
    with session(tmp_path, machine(kind=kind, lasts=2e-4)) as one:
        assert run_session(one)["completed"]


def failing(one: Session) -> None:
    one.transport.drive.failed = 1


PROVOKED: dict[str, tuple[Callable[[Session], Any], int]] = {
    "estop": (lambda one: one.estop(), 100),
    "heartbeat_lost": (lambda one: one.run_alone(6000), 5002),
    "deadline": (lambda one: one.lose(64), 100),
    "following_error": (lambda one: one.tighten("following_error", 1e-12), 100),
    "overspeed": (lambda one: one.tighten("speed", 1e-9), 100),
    "encoder_jump": (lambda one: one.tighten("jump", 0.0), 100),
    "adapter_failed": (failing, 1),
}
"""How a doubt comes up in a session, and the cycles within which it is a fault."""


@pytest.mark.parametrize("fault", PROVOKED)
def test_each_doubt_of_the_loop_ends_in_fault_without_torque(tmp_path: Path, fault: str) -> None:
    what, (doubt, within) = scenario(("stop = 0.4", "stop = 1.0")), PROVOKED[fault]
    with session(tmp_path, what=what) as one:
        one.enable()
        one.track(2000)
        begun = one.status.tick
        doubt(one)
        one.advance(50)
        assert fault in one.status.faults
        assert one.status.state == "fault"
        assert one.status.torque == 0
    found = recorded(tmp_path)
    assert_safe(found, fault, begun, within)
    assert replay(found).identical


@pytest.mark.parametrize(("what", "fault"), [("nan_at", "not_a_number"), ("fail_at", "controller_failed")])
def test_a_controller_that_fails_is_a_fault(tmp_path: Path, tiny: dict[int, Path], what: str, fault: str) -> None:
    xml = description(3).replace('name="a"', 'name="q_d"').replace('name="b"', 'name="q"')
    fmu = described(tiny[3], tmp_path / "controller.fmu", xml.replace('name="y"', 'name="tau"'))
    text = SCENARIO.replace('[components.controller]\ncard = "paper_mount"\npart = "controller"', "")
    text = text[: text.index('[[connections]]\nfrom = "reference.velocity"')] + text[text.index("[record]") :]
    text += f'[components.controller]\nfmu = "{fmu}"\nparameters = {{ mode = 1.0, k = 1e4, {what} = 0.1 }}\n'
    text = text.replace('to = "mount.tau"', 'to = "mount.tau"\nunit = "N.m"')
    given = with_fmus(parse_scenario(text, "tiny.toml", Path()))
    with session(tmp_path, what=given) as one:
        done = run_session(one)
    assert fault in done["faults"]
    assert_safe(recorded(tmp_path), fault, 1000, 30)


def test_a_loop_starts_in_fault_and_only_an_edge_leaves_it(tmp_path: Path) -> None:
    with session(tmp_path) as one:
        one._ask(1)
        one.advance(50)
        assert (one.status.state, one.status.faults) == ("fault", ("power_up",))
        one._ask(1 + 8)
        one.advance(50)
        assert one.status.state == "switch on disabled", "what was asked before the reset is forgotten"
        one.estop()
        one._ask(4 + 8)
        one.advance(50)
        assert one.status.state == "fault", "the emergency stop is still there"
        one._ask(8)
        one.advance(50)
        assert one.status.state == "fault", "a reset that is held is no edge"
        one._ask(0)
        one.advance(2)
        one._ask(8)
        assert one.advance(2).state == "switch on disabled"
    assert not recorded(tmp_path)["machine.order"].any()


def test_a_drive_without_orders_lets_go_by_its_own_watchdog(tmp_path: Path) -> None:
    with session(tmp_path) as one:
        one.enable()
        one.track(1000)
        one.lose(30)
        one.advance(31)
        assert one.transport.drive.held == 0
        assert "drive_fault" in one.status.faults


def test_a_session_that_is_left_in_operation_leaves_no_torque(tmp_path: Path) -> None:
    with session(tmp_path) as one:
        one.enable()
        one.track(2000)
        assert one.transport.drive.held != 0
    assert one.transport.drive.held == 0
    assert one.status.state == "switch on disabled"
    assert recorded(tmp_path)["machine.order"][-1] == 0


FAR = ('kind = "sine"\nfrequency = 1.0\nmax_velocity = 2e-3', 'kind = "ramp"\nstart = 0.01\nvelocity = 1e-3')


@pytest.mark.parametrize(
    ("given", "changes", "fault"),
    [(machine(kind="dead", at=0.0), (), "frame_lost"), (machine(), (FAR,), "following_error")],
    ids=["a drive that is not there", "an axis far from its set point"],
)
def test_what_would_be_a_fault_is_never_enabled(tmp_path: Path, given: Machine, changes: Any, fault: str) -> None:
    with session(tmp_path, given, scenario(*changes)) as one, pytest.raises(HardwareError, match=fault):
        one.enable()
    assert not recorded(tmp_path)["machine.order"].any()


def test_every_fault_is_provoked_and_documented() -> None:
    others = {"power_up", "not_a_number", "controller_failed", "drive_state", "encoder_heads"}
    assert set(FAULTS) == {*INJECTED, *PROVOKED, *others}
    page = (Path(__file__).parents[2] / "docs" / "hardware.md").read_text("utf-8")
    for number, (name, meaning) in enumerate(FAULTS.items(), 1):
        assert f"| {number} | `{name}` | {meaning}" in page
