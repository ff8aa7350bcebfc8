"""A session cycle by cycle against a loop that only counts."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from cosim.hardware.loops import Called, Forked, Threaded
from cosim.hardware.session import Session, run_session
from cosim.hardware.structures import LIMITS as MANY
from cosim.hardware.words import ASK_ENABLE, ASK_ESTOP, ASK_QUICK_STOP, ASK_RESET, LIMITS
from cosim.support.errors import HardwareError


class Counting:
    """A loop that passes its cycles and lets the axis go on as a test says."""

    def __init__(self, session: Any, follow: Callable[[Any], None]) -> None:
        self.session, self.follow, self.went = session, follow, []

    def go(self, cycles: int) -> None:
        self.went.append(cycles)
        for _ in range(cycles):
            self.session._session.tick += 1
            self.follow(self.session)


def counting(follow: Callable[[Any], None] = lambda _: None, heartbeat: int = 10**6, setpoints: int = 4000) -> Any:
    one = object.__new__(Session)
    one.machine = SimpleNamespace(name="test")  # type: ignore[assignment]
    one.axis = SimpleNamespace(  # type: ignore[assignment]
        faults=1, state=7, running=0, torque=0.0, entered=0, ran=0, patience=5, limit=[50.0] * MANY
    )
    one._session = SimpleNamespace(  # type: ignore[assignment]
        tick=0, heartbeat=0, heartbeat_limit=heartbeat, request=0, value=0.0, change=0, setpoints=setpoints
    )
    one.loop = Counting(one, follow)  # type: ignore[assignment]
    return one


@pytest.mark.parametrize(("limit", "went"), [(1, [1] * 7), (2, [1] * 7), (6, [3, 3, 1]), (7, [3, 3, 1]), (40, [7])])
def test_a_sign_of_life_is_given_twice_in_the_time_that_it_may_take(limit: int, went: list[int]) -> None:
    one = counting(heartbeat=limit)
    assert one.advance(7).tick == 7
    assert one.loop.went == went
    assert one._session.heartbeat == len(went)


def up(after: int) -> Callable[[Any], None]:
    """The drive follows some cycles after it was asked to."""
    asked: list[int] = []

    def follow(one: Any) -> None:
        if one._session.request == ASK_RESET:
            one.axis.faults, one.axis.state = 0, 1
        if one._session.request == ASK_ENABLE:
            asked.append(one._session.tick)
            if len(asked) == after:
                one.axis.state, one.axis.running, one.axis.entered = 4, 1, one._session.tick

    return follow


def test_to_enable_takes_a_reset_and_as_many_cycles_as_the_drive_needs() -> None:
    one = counting(up(9))
    assert one.enable().running
    assert one._session.tick == 4 + 2 + 9, "four cycles to look, two for the edge of the reset"
    assert one.status.state == "operation enabled"


@pytest.mark.parametrize(("after", "comes"), [(24, True), (25, False)])
def test_a_drive_may_be_patient_four_times_and_no_longer(after: int, comes: bool) -> None:
    """Four steps up to operation of five cycles each, and four cycles beside."""
    one = counting(up(after))
    if comes:
        assert one.enable().running
        return
    with pytest.raises(HardwareError, match=r"test was not enabled: the drive did not follow \(state: switch on disab"):
        one.enable()
    assert one._session.tick == 4 + 2 + 24


def test_a_fault_on_the_way_ends_it_at_once_with_its_name() -> None:
    def follow(one: Any) -> None:
        if one._session.request == ASK_RESET:
            one.axis.faults, one.axis.state = 0, 1
        if one._session.request == ASK_ENABLE:
            one.axis.state, one.axis.faults = 7, 0b101000

    one = counting(follow)
    with pytest.raises(HardwareError, match=r"was not enabled: encoder_stale, overspeed \(state: fault\)"):
        one.enable()
    assert one._session.tick == 4 + 2 + 1


@pytest.mark.parametrize(("cycles", "last"), [(None, 4000), (0, 0), (700, 700), (2500, 2500)])
def test_set_points_are_followed_to_their_end_or_for_some_cycles(cycles: int | None, last: int) -> None:
    one = counting()
    one._session.tick = one.axis.entered = 40
    one.axis.running = 1
    one.track(cycles)
    assert one._session.tick == 40 + last
    assert max(one.loop.went, default=0) <= 1000, "somebody may want to know how far it is"


def test_who_leaves_operation_follows_no_further() -> None:
    def follow(one: Any) -> None:
        one.axis.running = int(one._session.tick < 1500)

    one = counting(follow)
    one.axis.running = 1
    assert not one.track().running
    assert one._session.tick == 2000, "noticed after the thousand cycles that it went for"


def test_to_disable_lasts_as_long_as_the_ramp_and_two_cycles() -> None:
    def follow(one: Any) -> None:
        if one._session.request == ASK_QUICK_STOP:
            one.axis.state = 5 if one._session.tick < 30 else 1

    one = counting(follow)
    one.axis.state = 4
    one.disable()
    assert (one._session.tick, one._session.request) == (32, 0)
    one.estop()
    assert (one._session.tick, one._session.request) == (35, ASK_ESTOP)


@pytest.mark.parametrize(("value", "good"), [(50.0, True), (0.0, True), (20.0, True), (50.001, False), (-1e-9, False)])
def test_a_limit_may_be_made_smaller_down_to_nothing(value: float, good: bool) -> None:
    one = counting()
    if good:
        one.tighten("speed", value)
        assert (one._session.value, one._session.change) == (value, LIMITS.index("speed") + 1)
        return
    with pytest.raises(HardwareError, match='The limit "speed" is 50 and can be tightened, not set to'):
        one.tighten("speed", value)
    assert one._session.change == 0


@pytest.mark.parametrize("breaks", [False, True])
def test_a_whole_session_says_how_it_ended(breaks: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    rises = up(3)

    def follow(one: Any) -> None:
        rises(one)
        if one._session.request == ASK_QUICK_STOP:
            one.axis.state, one.axis.running = 1, 0
        elif breaks and one._session.tick == 100:
            one.axis.state, one.axis.running, one.axis.faults = 7, 0, 0b100

    monkeypatch.setattr(Session, "statistics", property(lambda _: {"cycles": 1}))
    told = run_session(counting(follow, setpoints=500))
    assert (told["completed"], told["cycles"], told["torque"]) == (not breaks, 1, 0.0)
    assert (told["state"], told["faults"]) == (("fault", ["frame_lost"]) if breaks else ("switch on disabled", []))
    assert told["seconds"] >= 0


@pytest.mark.parametrize(
    ("fast", "python", "kind"), [(True, True, Called), (False, True, Threaded), (False, False, Forked)]
)
def test_a_loop_is_called_a_thread_or_a_process(fast: bool, python: bool, kind: type) -> None:
    one = counting()
    one._fast, one.transport = fast, SimpleNamespace(python=python)
    assert one._kind() is kind


@pytest.mark.parametrize(("code", "how"), [(0, "by itself"), (3, "by itself"), (-9, "by signal SIGKILL")])
def test_a_loop_whose_process_is_gone_says_how_it_ended(code: int, how: str) -> None:
    loop = Forked(None, None)  # type: ignore[arg-type]
    loop._ended = code
    assert not loop.alive
    with pytest.raises(HardwareError, match=f"The process of the loop has ended {how}; the drive's watchdog") as caught:
        loop.go(1)
    assert caught.value.value == code
