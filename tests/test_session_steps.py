"""A session cycle by cycle against a loop that only counts; what fits no machine; what a replay takes as it stands."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.hardware import look as looking
from cosim.hardware.look import look
from cosim.hardware.loops import Called, Forked, Threaded
from cosim.hardware.replay import LAST, _check_ticks, _exact
from cosim.hardware.session import Session, run_session
from cosim.hardware.structures import LIMITS as MANY
from cosim.hardware.virtual import parse_injection, plant_of
from cosim.hardware.wired import _ends, refuse_what_has_no_machine
from cosim.hardware.words import ASK_ENABLE, ASK_ESTOP, ASK_QUICK_STOP, ASK_RESET, LIMITS
from cosim.support.errors import HardwareError
from cosim.system.algorithm import GaussSeidel, Jacobi
from cosim.system.wire import Wire


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
    one.axis.running, one.axis.entered = 1, 0
    one.track(cycles)
    assert one._session.tick == last
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


WIRES = [
    Wire("k.tau", "m.tau"),
    Wire("m.q", "k.q", quantum=1e-6),
    Wire("r.position", "k.q_d"),
]


def scenario(**changes: Any) -> Any:
    plain: dict[str, Any] = {"path": "s.toml", "components": {"k": 1, "m": 2}, "every": {}, "algorithm": Jacobi()}
    return SimpleNamespace(**(plain | {"start": 0.0, "faults": (), "wires": WIRES} | changes))


@pytest.mark.parametrize(
    ("changes", "rule"),
    [
        ({"components": {"k": 1}}, "takes one controller and replaces one plant, and this has: k"),
        ({"components": {"k": 1, "m": 2, "x": 3}}, "and this has: k, m, x"),
        ({"every": {"k": 2}}, "both components step at each tick"),
        ({"algorithm": GaussSeidel(kind="gauss-seidel")}, "both components step at each tick"),
        ({"start": 0.5}, "a machine begins at 0 s, and this starts at 0.5 s"),
        ({"faults": ("one",)}, "faults on wires belong to a simulation"),
    ],
)
def test_what_a_simulation_can_do_and_a_machine_cannot_is_refused(changes: dict[str, Any], rule: str) -> None:
    refuse_what_has_no_machine(scenario())
    with pytest.raises(HardwareError, match=rule):
        refuse_what_has_no_machine(scenario(**changes))


def test_the_encoder_is_the_wire_with_a_quantum_and_the_torque_goes_the_other_way() -> None:
    encoder, command = _ends(scenario())
    assert (encoder.source, command.source) == ("m.q", "k.tau")


@pytest.mark.parametrize(
    ("wires", "rule"),
    [
        (WIRES[::2], "one wire must have the quantum of the encoder, and 0 have one"),
        ([*WIRES, Wire("m.v", "k.v", quantum=1.0)], "and 2 have one"),
        (WIRES[1:], "the plant gives one position to the controller and takes one torque from it"),
        ([*WIRES, Wire("m.v", "k.v")], "the plant gives one position to the controller"),
        ([*WIRES, Wire("k.x", "m.x")], "the plant gives one position to the controller"),
        ([*WIRES, Wire("r.velocity", "k.v_d", gain=2.0)], '"k.v_d" has a gain, offset, quantum or noise'),
        ([*WIRES, Wire("r.velocity", "k.v_d", offset=1e-9)], '"k.v_d" has a gain, offset, quantum or noise'),
        ([*WIRES, Wire("r.velocity", "k.v_d", noise="n")], '"k.v_d" has a gain, offset, quantum or noise'),
        ([*WIRES, Wire("r.velocity", "k.v_d", quantum=1e-9)], '"k.v_d" has a gain, offset, quantum or noise'),
        ([*WIRES, Wire("r.velocity", "m.disturbance")], '"m.disturbance" is fed by a signal, and a machine has no'),
    ],
)
def test_wires_that_no_machine_has_are_refused(wires: list[Wire], rule: str) -> None:
    with pytest.raises(HardwareError, match=rule):
        _ends(scenario(wires=wires))


@pytest.mark.parametrize("kind", [np.uint32, np.int64, np.uint64, np.float64])
def test_a_field_holds_whole_numbers_within_its_bounds_and_what_a_double_counts(kind: type) -> None:
    given = np.array([0.0, 7.0, 0.5, -1.0, 2.0**32 - 1, 2.0**32, 2.0**53, 2.0**53 + 2, np.nan, np.inf, -(2.0**63)])
    found = _exact(given, np.dtype(kind))
    if kind is np.float64:
        np.testing.assert_array_equal(found, given)
        return
    limits = np.iinfo(kind)
    holds = [np.isfinite(x) and x == int(x) and limits.min <= int(x) <= min(limits.max, LAST) for x in given]
    assert found.tolist() == [int(x) if held else 0 for x, held in zip(given, holds, strict=True)]
    assert LAST == 2**53


NOTHING = Recording("box", {"t": np.zeros(0)})


@pytest.mark.parametrize(
    ("ticks", "late", "rule"),
    [
        ([0, 1, 2], [0, 0, 0], ""),
        ([3, 4, 7], [3, 0, 2], ""),
        ([], [], "box has no cycles"),
        ([1, 2], [0, 0], "box begins at cycle 1: its black box had room for the end of the session only"),
        ([0, 1], [1, 0], "box begins at cycle 0"),
        ([0, 1, 3, 4], [0, 0, 0, 0], "was altered: cycle 3 follows cycle 1"),
        ([0, 1, 1], [0, 0, 0], "was altered: cycle 1 follows cycle 1"),
        ([0, 1, 2], [0, 1, 0], "was altered: cycle 1 follows cycle 0"),
    ],
)
def test_cycles_begin_with_the_session_and_follow_each_other_less_those_that_were_late(
    ticks: list[int], late: list[int], rule: str
) -> None:
    given = np.array(ticks, dtype=np.int64), np.array(late, dtype=np.uint32)
    if not rule:
        _check_ticks(NOTHING, *given)
        return
    with pytest.raises(HardwareError, match=rule):
        _check_ticks(NOTHING, *given)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("lost", {"kind": "lost", "at": 0.0}),
        ("lost:1.5", {"kind": "lost", "at": 1.5}),
        ("late:1:2:3", {"kind": "late", "at": 1.0, "lasts": 2.0, "size": 3.0}),
    ],
)
def test_an_injection_has_up_to_three_numbers(text: str, said: dict[str, object]) -> None:
    assert parse_injection(text) == said
    with pytest.raises(HardwareError, match=r"the form is KIND\[:AT\[:LASTS\[:SIZE\]\]\]"):
        parse_injection("late:1:2:3:4")


@pytest.mark.parametrize(
    ("tau", "q", "missing"), [("output", "output", 'input "tau"'), ("input", "input", 'output "q"')]
)
def test_a_plant_of_a_drive_takes_a_torque_and_gives_a_position(tau: str, q: str, missing: str) -> None:
    started = []
    ports = {"tau": SimpleNamespace(causality=tau), "q": SimpleNamespace(causality=q)}
    component: Any = SimpleNamespace(name="m", ports=ports, start=started.append)
    with pytest.raises(HardwareError, match=f"m is no plant of a drive: it has no {missing}"):
        plant_of(component)
    assert not started
    ports |= {"tau": SimpleNamespace(causality="input"), "q": SimpleNamespace(causality="output")}
    assert plant_of(component).position == "q"
    assert started == [{}]


def looked(monkeypatch: pytest.MonkeyPatch, table: dict[str, Any], seconds: float = 0.5, setpoint: float = 0.3) -> Any:
    """What a look says where a black box has these columns; also how many cycles it watched."""
    went: list[int] = []

    class Watched:
        wired = SimpleNamespace(inputs=("q", "q_d"), setpoints=np.array([[0.0, 0.0], [setpoint, 9.0]]))
        statistics: ClassVar[dict[str, float]] = {"cycles": 4, "worst_wake_up_us": 3.0, "secret": 1}

        def __init__(self, *_: Any) -> None: ...

        def __enter__(self) -> "Watched":
            return self

        def __exit__(self, *_: Any) -> None: ...

        advance = staticmethod(went.append)

    columns = {name: np.array(column, float) for name, column in table.items()}
    monkeypatch.setattr(looking, "Session", Watched)
    monkeypatch.setattr(looking, "read_black_box", lambda _: None)
    monkeypatch.setattr(looking, "recording_of", lambda *_: Recording("check", {"t": np.arange(4.0)} | columns))
    limits = SimpleNamespace(**(dict.fromkeys(LIMITS, 2.0) | {"following_error": 0.1}))
    machine: Any = SimpleNamespace(name="m", adapter="simulated", limits=limits)
    return look(SimpleNamespace(step=1e-3), machine, seconds), went  # type: ignore[arg-type]


SEEN = {"machine.read": [0, 1, 0, 0], "machine.encoder": [5, 9, 6, 7], "q": [0.2, 9.0, 0.26, 0.21]}


def test_a_look_tells_what_answered_and_what_is_within_reach(monkeypatch: pytest.MonkeyPatch) -> None:
    found, went = looked(monkeypatch, SEEN)
    assert went == [500]
    assert found["answered"] == "75.00% of 4 cycles"
    assert (found["position"], found["first_set_point"]) == (0.21, 0.3)
    assert found["moved_by"] == pytest.approx(0.06)
    assert found["within_reach"] is True
    assert found["limits"]["following_error"] == 0.1
    assert (found["cycles"], "secret" in found) == (4, False)
    assert looked(monkeypatch, SEEN, seconds=0.01, setpoint=0.32)[0]["within_reach"] is False
    assert looked(monkeypatch, SEEN, seconds=0.01)[1] == [100], "a tenth of that would tell nothing"
    assert looked(monkeypatch, SEEN, setpoint=0.1101)[0]["within_reach"] is True


@pytest.mark.parametrize(
    ("changes", "rule"),
    [
        ({"machine.read": [1, 1, 2, 1]}, "m does not answer"),
        ({"machine.encoder": [5, 9, 6, 5]}, "The encoder of m gives no new samples"),
    ],
)
def test_a_look_at_what_does_not_live_is_refused(
    changes: dict[str, Any], rule: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(HardwareError, match=rule):
        looked(monkeypatch, SEEN | changes)
