"""What keeps an axis safe, cycle by cycle: the torque that it orders, and what takes that away."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from axis_bench import QUANTUM, STATUSWORDS, STEP, Bench
from on_hardware import AT, INJECTED, MOVING, SCENARIO, assert_safe, machine, recorded, scenario, session
from tiny_fmu import described, description

from cosim.hardware.machine import Machine
from cosim.hardware.replay import replay
from cosim.hardware.session import Session, run_session
from cosim.hardware.words import ASK_ENABLE, ASK_ESTOP, ASK_QUICK_STOP, ASK_RESET, FAULTS, LIMITED, LIMITS, SLEWED
from cosim.models.cache import with_fmus
from cosim.support.errors import HardwareError
from cosim.system.scenario import parse_scenario

NAN = float("nan")
BIT = {name: 1 << place for place, name in enumerate(FAULTS)}
"""What stands for a fault in the word of faults."""


def torques(bench: Bench, cycles: int, request: int = ASK_ENABLE) -> list[float]:
    return [bench.cycle(request).torque for _ in range(cycles)]


def commanding(torque: float, limits: dict[str, float] | None = None, **changes: object) -> Bench:
    """An axis in operation whose controller commands a torque; the cycle that entered is over."""
    bench = Bench(limits, **changes)
    bench.command = lambda _: torque
    return bench.enabled()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_whatever_is_commanded_the_torque_after_enabling_grows_from_zero_along_the_ramp(sign: float) -> None:
    bench = Bench({"torque": 40.0}, ramp=8)
    bench.command = lambda _: sign * 1e4
    bench.enabled()
    assert torques(bench, 10) == [sign * 5.0 * n for n in (*range(1, 9), 8, 8)]


def test_the_ramp_begins_anew_with_each_entry_into_operation() -> None:
    bench = commanding(1e4, {"torque": 40.0}, ramp=8)
    torques(bench, 20)
    bench.cycle(ASK_ESTOP)
    assert torques(bench, 3, 0) == [0.0] * 3
    bench.cycle(ASK_RESET)
    while bench.axis.state != 4:
        assert bench.axis.torque == 0
        bench.cycle()
    assert torques(bench, 4) == [5.0, 10.0, 15.0, 20.0]
    assert bench.restored == 2, "and the controller with its state from before its first tick"
    assert bench.stepped == pytest.approx(3 * STEP)


@pytest.mark.parametrize(("command", "ramp"), [(10.0, 1), (10.000001, 1), (1e300, 1), (-10.000001, 1), (1.0, 8)])
def test_the_torque_never_exceeds_its_limit_and_a_command_below_it_is_ordered_as_it_is(command, ramp) -> None:
    record = commanding(command, {"torque": 10.0}, ramp=ramp).cycle()
    assert record.torque == max(-10.0, min(10.0, command))
    assert record.notes & (LIMITED | SLEWED) == (LIMITED if abs(command) > 10 else 0)


def test_the_torque_changes_by_the_slew_limit_a_cycle_at_most_but_a_limit_tightened_below_it_holds_at_once() -> None:
    bench = commanding(10.0, {"slew": 3.0 / STEP})
    assert torques(bench, 5) == pytest.approx([3, 6, 9, 10, 10])
    assert bench.cycle(change=LIMITS.index("torque") + 1, value=2.0).torque == 2.0
    assert torques(bench, 2) == [2.0, 2.0]
    bench = commanding(10.0, {"slew": 3.0 / STEP})
    torques(bench, 5)
    bench.command = lambda _: -10.0
    record = bench.cycle()
    assert record.notes & SLEWED
    assert [record.torque, *torques(bench, 2)] == pytest.approx([7, 4, 1])


@pytest.mark.parametrize("request_", [ASK_ENABLE | ASK_QUICK_STOP, 0], ids=["a quick stop", "no wish to enable"])
def test_what_ends_operation_takes_the_torque_to_zero_along_its_own_slew_and_then_leaves(request_: int) -> None:
    bench = commanding(10.0, stop_slew=3.0 / STEP)
    torques(bench, 2)
    found = [bench.cycle(request_) for _ in range(6)]
    assert [one.torque for one in found] == pytest.approx([7, 4, 1, 0, 0, 0])
    assert [one.state for one in found] == [5, 5, 5, 5, 1, 1]
    if request_:
        assert torques(bench, 5) == [0.0] * 5, "what was asked before is forgotten: enable needs an edge"


def test_an_axis_starts_in_fault_which_only_an_edge_of_the_reset_leaves_and_then_only_an_edge_enables() -> None:
    bench = Bench()
    for request, state, faults in (
        (ASK_ENABLE | ASK_RESET, 7, BIT["power_up"]),  # what is asked from the beginning is no edge
        (ASK_ENABLE, 7, BIT["power_up"]),
        (ASK_ENABLE | ASK_RESET, 1, 0),  # what was asked before the reset is forgotten
        (ASK_ESTOP | ASK_RESET, 7, BIT["estop"]),
        (ASK_RESET, 7, BIT["estop"]),  # a reset that is held is no edge
        (0, 7, BIT["estop"]),
        (ASK_RESET, 1, 0),
        (ASK_ENABLE, 4, 0),
    ):
        found = [bench.cycle(request) for _ in range(10)]
        assert (found[-1].state, found[-1].faults) == (state, faults)
        assert not any(one.torque for one in found)


def test_an_axis_goes_up_one_state_a_cycle_and_waits_for_its_drive_in_each() -> None:
    bench = Bench(patience=4)
    for request in (0, 0, ASK_RESET, ASK_ENABLE):
        bench.cycle(request)
    stuck = {"statusword": STATUSWORDS[1]}
    assert bench.axis.state == 2
    states = [bench.cycle(feedback=stuck).state for _ in range(6)]
    assert states == [2, 2, 2, 2, 6, 7], "within its patience it waits, then that is a fault"
    assert bench.axis.faults == BIT["drive_state"]


FAILURES = {
    "estop": {"request": ASK_ENABLE | ASK_ESTOP},
    "overspeed": {"feedback": {"counts": 11}},
    "encoder_jump": {"feedback": {"counts": 6}},
    "following_error": {"reference": 21 * QUANTUM},
    "drive_fault": {"feedback": {"statusword": STATUSWORDS[7]}},
    "drive_state": {"feedback": {"statusword": STATUSWORDS[3]}},
    "adapter_failed": {"status": 1},
    "heartbeat_lost": {"request": ASK_ENABLE | 16},
    "not_a_number": {"command": NAN},
    "controller_failed": {"failed": 3},
}
NARROW = {"speed": 10.5 * QUANTUM / STEP, "jump": 5.5 * QUANTUM, "following_error": 20.5 * QUANTUM}


@pytest.mark.parametrize("fault", FAILURES)
def test_each_fault_takes_the_torque_away_in_the_cycle_in_which_it_is_seen(fault: str) -> None:
    narrow = NARROW | {"jump": 1.0} if fault == "overspeed" else NARROW
    bench = commanding(10.0, narrow)
    assert torques(bench, 3) == [10.0] * 3
    failure = dict(FAILURES[fault])
    command, bench.status = failure.pop("command", 10.0), failure.pop("failed", 0)
    bench.command = lambda _: command
    record = bench.cycle(**failure)
    assert (record.torque, record.state, record.controlword) == (0.0, 6, 0)
    assert record.faults == BIT[fault] | (BIT["drive_state"] if fault == "drive_fault" else 0)
    assert torques(bench, 5) == [0.0] * 5
    assert bench.axis.state == 7


@pytest.mark.parametrize(
    "well", [{"feedback": {"counts": 5}}, {"reference": 20 * QUANTUM}, {"feedback": {"torque": 11.0}}, {"read": 1}]
)
def test_what_is_just_within_its_limit_takes_nothing_away(well: dict[str, object]) -> None:
    bench = commanding(10.0, NARROW | {"torque_mismatch": 1.0})
    torques(bench, 3)
    assert bench.cycle(**well).torque == 10.0  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("fault", "bad", "limit"),
    [
        ("frame_lost", {"read": 1}, "lost_limit"),
        ("encoder_stale", {"feedback": {"encoder": 0}}, "stale_limit"),
        ("torque_mismatch", {"feedback": {"torque": 11.1}}, "mismatch_limit"),
    ],
)
@pytest.mark.parametrize("most", [0, 3])
def test_what_may_last_some_cycles_is_a_fault_in_the_next_one(fault, bad, limit, most) -> None:
    bench = commanding(10.0, {"torque_mismatch": 1.0}, **{limit: most})
    torques(bench, 3)
    bench.cycle(feedback={"encoder": 0})
    found = [bench.cycle(**bad) for _ in range(most + 1)]  # type: ignore[arg-type]
    assert [one.torque for one in found] == [10.0] * most + [0.0]
    assert found[-1].faults == BIT[fault]


@pytest.mark.parametrize("name", LIMITS)
def test_a_limit_is_only_tightened_in_operation_and_set_freely_at_rest(name: str) -> None:
    place = LIMITS.index(name)
    bench = Bench()
    before = bench.axis.limit[place]
    bench.cycle(0, change=place + 1, value=2 * before)
    assert (bench.axis.limit[place], bench.axis.refused) == (2 * before, 0)
    bench.enabled()
    for value, expected, refused in (
        (3 * before, 2 * before, 1),
        (2 * before, 2 * before, 1),
        (before, before, 1),
        (-1.0, before, 2),
        (NAN, before, 3),
        (0.0, 0.0, 3),
    ):
        bench.cycle(change=place + 1, value=value)
        assert (bench.axis.limit[place], bench.axis.refused) == (expected, refused)


def test_a_late_cycle_holds_the_torque_and_as_many_as_the_limit_in_a_row_stop_the_axis() -> None:
    bench = commanding(10.0, stop_slew=3.0 / STEP, late_limit=64)
    bench.cycle()
    assert [bench.cycle(late=1).torque, bench.cycle(late=0).torque, bench.cycle(late=2).torque] == [10.0] * 3
    assert bench.cycle(late=1).torque == pytest.approx(7.0), "three in a row: a quick stop"
    assert bench.axis.state == 5


@pytest.mark.parametrize(("apart", "fault"), [(33, False), (32, True)])
def test_late_cycles_within_the_window_are_a_fault(apart: int, fault: bool) -> None:
    bench = commanding(10.0, late_limit=4, late_window=98)
    for _ in range(3):
        bench.cycle(late=1)
        torques(bench, apart - 1)
    record = bench.cycle(late=1)
    assert bool(record.faults & BIT["deadline"]) == fault


def test_the_controller_reads_the_position_in_radians_of_this_very_cycle() -> None:
    bench = commanding(0.0)
    bench.command = lambda position: position
    bench.counts = 3
    assert bench.cycle().command == pytest.approx(3 * QUANTUM)
    bench.counts = -2
    assert bench.cycle().command == pytest.approx(-2 * QUANTUM)


# In a session: torque is zero on any doubt, of the drive, the loop, the controller or the clock.


@pytest.mark.parametrize(
    ("fault", "inject", "within"),
    [*((fault, *INJECTED[fault]) for fault in INJECTED), ("frame_lost", {"kind": "dead"}, 3)],
)
def test_each_fault_of_the_drive_is_found_and_ends_in_fault_without_torque(tmp_path, fault, inject, within) -> None:
    with session(tmp_path, machine(**inject)) as one:
        done = run_session(one)
    assert (done["completed"], done["state"]) == (False, "fault")
    assert fault in done["faults"]
    found = recorded(tmp_path)
    assert_safe(found, fault, round(AT / 1e-4), within)
    assert replay(found).identical


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
    text += f'[components.controller]\nfmu = "{fmu}"\nparameters = {{ mode = 1.0, k = 1e4, {what} = 0.1 }}\n'
    text = text.replace('to = "mount.tau"', 'to = "mount.tau", unit = "N.m"').replace(MOVING, "")
    given = with_fmus(parse_scenario(text, "tiny.toml", Path()))
    with session(tmp_path, what=given) as one:
        done = run_session(one)
    assert fault in done["faults"]
    assert_safe(recorded(tmp_path), fault, 1000, 30)


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
