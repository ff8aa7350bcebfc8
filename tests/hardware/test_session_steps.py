"""A session cycle by cycle against a loop that only counts."""

import resource
from collections.abc import Callable
from contextlib import nullcontext
from time import monotonic, sleep
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from on_hardware import SIMULATED, scenario

from cosim.data.recording import Recording
from cosim.hardware import loops, move
from cosim.hardware.loops import Called, Forked, Threaded, bare_clock
from cosim.hardware.machine import Machine
from cosim.hardware.session import Session
from cosim.hardware.story import Story
from cosim.hardware.structures import LIMITS as MANY
from cosim.hardware.structures import CSession
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


def up(after: int, state: int = 4, faults: int = 0) -> Callable[[Any], None]:
    """The drive follows some cycles after it was asked to, into a state."""
    asked: list[int] = []

    def follow(one: Any) -> None:
        if one._session.request == ASK_RESET:
            one.axis.faults, one.axis.state = 0, 1
        if one._session.request == ASK_ENABLE:
            asked.append(one._session.tick)
            if len(asked) == after:
                one.axis.state, one.axis.faults, one.axis.running = state, faults, int(state == 4)
                one.axis.entered = one._session.tick

    return follow


@pytest.mark.parametrize(
    ("follow", "cycles", "sentence"),
    [
        (up(9), 9, ""),
        (up(24), 24, ""),
        (up(25), 24, r"test was not enabled: the drive did not follow \(state: switch on disab"),
        (up(1, 7, 0b101000), 1, r"was not enabled: encoder_stale, overspeed \(state: fault\)"),
    ],
    ids=["as soon as it follows", "the longest patience", "no longer", "a fault on the way"],
)
def test_to_enable_takes_a_reset_and_as_many_cycles_as_the_drive_needs(follow, cycles, sentence) -> None:
    """Its patience is four steps up to operation of five cycles each, and four cycles beside."""
    one = counting(follow)
    with pytest.raises(HardwareError, match=sentence) if sentence else nullcontext():
        assert one.enable().state == "operation enabled"
    assert one._session.tick == 4 + 2 + cycles, "four cycles to look, two for the edge of the reset"


@pytest.mark.parametrize(
    ("cycles", "leaves", "last"),
    [(None, 10**6, 4000), (0, 10**6, 0), (700, 10**6, 700), (2500, 10**6, 2500), (None, 1500, 2000)],
)
def test_set_points_are_followed_to_their_end_or_for_some_cycles_while_the_axis_is_in_operation(
    cycles: int | None, leaves: int, last: int
) -> None:
    """To leave operation is noticed after the thousand cycles that it went for."""

    def follow(one: Any) -> None:
        one.axis.running = int(one._session.tick < 40 + leaves)

    one = counting(follow)
    one._session.tick = one.axis.entered = 40
    one.axis.running = 1
    assert one.track(cycles).running == (leaves > last)
    assert one._session.tick == 40 + last
    assert max(one.loop.went, default=0) <= 1000, "somebody may want to know how far it is"


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
    with pytest.raises(HardwareError, match='"heat" is no limit; limits are: torque'):
        one.tighten("heat", 20.0)
    assert one._session.change == 0


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


# What moves, loops, sockets and drives wait for and ask, against stand-ins that note it; what a replay needs.


def moving(monkeypatch: pytest.MonkeyPatch, torques: list[float], inertias: list[float]) -> list[tuple[Any, ...]]:
    """Let each move of a test move need a torque and show an inertia; what was asked for."""
    asked: list[tuple[Any, ...]] = []
    need = iter(torques)

    def moved(what: Any, machine: Machine, way: float, needed: float, fast: bool) -> Recording:
        asked.append((what.ticks, machine.adapter, way, needed, fast))
        return Recording("move", {"t": np.zeros(2), "machine.order": np.array([0.0, -next(need)])})

    seen = iter(inertias)
    monkeypatch.setattr(move, "_moved", moved)
    monkeypatch.setattr(move, "_inertia", lambda *_: next(seen))
    return asked


def test_a_move_takes_a_fifth_of_the_following_error_and_a_quarter_of_the_torque(monkeypatch) -> None:
    """Needed at first: twice a quarter; so the way is halved, and then it stays."""
    limits = SIMULATED.limits
    quarter = limits.torque / 4
    asked = moving(monkeypatch, [2 * quarter, quarter, 0.9 * quarter], [30.0, 31.0])
    found = move.try_move(scenario(), SIMULATED)
    way = 0.2 * limits.following_error
    assert [one[2] for one in asked] == pytest.approx([way, way / 2, way / 2])
    assert [one[3] for one in asked] == pytest.approx([limits.torque, limits.torque, quarter])
    assert [one[4] for one in asked] == [True, True, False]
    assert {one[0] for one in asked} == {7000}, "six periods and one more at 10 Hz, 0.1 ms each"
    assert (found.way, found.expected, found.seen) == (pytest.approx(way / 2), 30.0, 31.0)
    assert found.torque == pytest.approx(0.9 * quarter)


@pytest.mark.parametrize(("seen", "good"), [(1.49, True), (0.67, True), (1.51, False), (0.66, False)])
def test_a_move_is_right_up_to_a_factor_of_one_and_a_half(seen, good, monkeypatch) -> None:
    moving(monkeypatch, [1.0] * 3, [1.0, seen])
    if good:
        assert move.try_move(scenario(), SIMULATED, fast=True).scale == pytest.approx(1 / seen)
        return
    with pytest.raises(HardwareError, match=f"as if its encoder had about {1 / seen:.2g} times the counts"):
        move.try_move(scenario(), SIMULATED, fast=True)


def test_a_loop_in_a_thread_runs_until_it_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[Any] = []
    session = SimpleNamespace(stop=0)

    def run(*given: Any) -> None:
        while not session.stop:
            sleep(0.001)
        sleep(0.05)  # its last cycle
        calls.append(("hardware_run", *given[1:]))

    def release(*given: Any) -> None:
        calls.append("released")

    made = SimpleNamespace(hardware_run=run, hardware_release=release)
    monkeypatch.setattr(loops, "library", lambda: made)
    one = Threaded(session, "sample")  # type: ignore[arg-type]
    one.start()
    one.go(3)
    one.stop()
    assert session.stop == 1
    assert calls == [("hardware_run", "sample", 2**62), "released"], "no torque once its last cycle is over"


def test_a_bare_clock_is_asked_in_nanoseconds_and_answers_in_microseconds(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []

    def bare(session: CSession, edges: int) -> None:
        asked.append((session.period, session.spin, edges))
        session.tick, session.late, session.worst = edges, 3, 12_500

    monkeypatch.setattr(loops, "library", lambda: SimpleNamespace(hardware_bare=bare))
    assert bare_clock(1.0, 20.0, 30.4) == (30, 3, 12.5)
    assert asked == [(1_000_000_000, 20_000, 30)]


def test_a_clock_sleeps_between_its_edges_and_is_not_early() -> None:
    """20 cycles of 10 ms, awake for the last 20 us of each: one that spins gives its processor up 4 times in all."""
    bare_clock(0.001, 0.0, 0.001)  # what is loaded once
    began, before = monotonic(), resource.getrusage(resource.RUSAGE_SELF)
    edges, late, _ = bare_clock(0.01, 20.0, 0.2)
    slept = resource.getrusage(resource.RUSAGE_SELF).ru_nvcsw - before.ru_nvcsw
    assert edges + late >= 20
    assert monotonic() - began >= 0.01 * 19
    assert slept >= edges / 2


STORY: dict[str, Any] = {
    "step": 1e-3,
    "quantum": 1e-6,
    "inputs": ["q", "q_d"],
    "encoder": "q",
    "output": "tau",
    "units": {},
    "machine": SIMULATED.model_dump(),
    "controller": {"sha256": "0" * 64},
}


@pytest.mark.parametrize(
    ("changes", "good"),
    [
        ({}, True),
        ({"quantum": 1e-30}, True),
        ({"quantum": 1e30}, True),
        ({"quantum": 0.99e-30}, False),
        ({"quantum": 1.01e30}, False),
        ({"inputs": ["q_d", *(f"i{k}" for k in range(6)), "q"]}, True),
        ({"inputs": ["q_d", *(f"i{k}" for k in range(7)), "q"]}, False),
        ({"inputs": ["q_d"], "encoder": "q_d"}, True),
        ({"inputs": []}, False),
        ({"encoder": "p"}, False),
        ({"inputs": ["q", "p"]}, False),
        ({"controller": {"sha256": "0" * 63}}, False),
        ({"controller": {"sha256": "G" * 64}}, False),
        ({"more": 1}, True),
    ],
)
def test_a_story_has_what_a_replay_needs(changes: dict[str, Any], good: bool) -> None:
    if good:
        assert Story.model_validate(STORY | changes).encoder == changes.get("encoder", "q")
        return
    with pytest.raises(ValueError, match="validation error"):
        Story.model_validate(STORY | changes)
