"""What of a scenario fits a machine, and what a replay and a look take as it stands."""

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.hardware import look as looking
from cosim.hardware.look import look
from cosim.hardware.replay import _check_ticks
from cosim.hardware.virtual import plant_of
from cosim.hardware.wired import _ends, refuse_what_has_no_machine
from cosim.hardware.words import LIMITS
from cosim.support.errors import HardwareError
from cosim.system.algorithm import GaussSeidel, Jacobi
from cosim.system.wire import Wire

WIRES = [Wire("k.tau", "m.tau"), Wire("m.q", "k.q", quantum=1e-6), Wire("r.position", "k.q_d")]


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


NEITHER = '"k.v_d" has a gain, offset, quantum or noise'


@pytest.mark.parametrize(
    ("wires", "rule"),
    [
        (WIRES[::2], "one wire must have the quantum of the encoder, and 0 have one"),
        ([*WIRES, Wire("m.v", "k.v", quantum=1.0)], "and 2 have one"),
        (WIRES[1:], "the plant gives one position to the controller and takes one torque from it"),
        ([*WIRES, Wire("m.v", "k.v")], "the plant gives one position to the controller"),
        ([*WIRES, Wire("k.x", "m.x")], "the plant gives one position to the controller"),
        ([*WIRES, Wire("r.velocity", "k.v_d", gain=2.0)], NEITHER),
        ([*WIRES, Wire("r.velocity", "k.v_d", offset=1e-9)], NEITHER),
        ([*WIRES, Wire("r.velocity", "k.v_d", noise="n")], NEITHER),
        ([*WIRES, Wire("r.velocity", "k.v_d", quantum=1e-9)], NEITHER),
        ([*WIRES, Wire("r.velocity", "m.disturbance")], '"m.disturbance" is fed by a signal, and a machine has no'),
    ],
)
def test_wires_that_no_machine_has_are_refused(wires: list[Wire], rule: str) -> None:
    assert [one.source for one in _ends(scenario())] == ["m.q", "k.tau"], "the encoder has a quantum, and the command"
    with pytest.raises(HardwareError, match=rule):
        _ends(scenario(wires=wires))


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
    with pytest.raises(HardwareError, match=rule) if rule else nullcontext():
        _check_ticks(NOTHING, np.array(ticks, dtype=np.int64), np.array(late, dtype=np.uint32))


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
    assert (found["answered"], found["cycles"], went, "secret" in found) == ("75.00% of 4 cycles", 4, [500], False)
    assert (found["position"], found["first_set_point"], found["within_reach"]) == (0.21, 0.3, True)
    assert found["moved_by"] == pytest.approx(0.06)
    assert found["limits"]["following_error"] == 0.1
    far, went = looked(monkeypatch, SEEN, seconds=0.01, setpoint=0.32)
    assert (far["within_reach"], went) == (False, [100]), "a tenth of that would tell nothing"
    assert looked(monkeypatch, SEEN, setpoint=0.1101)[0]["within_reach"] is True
    for changes, rule in (
        ({"machine.read": [1, 1, 2, 1]}, "m does not answer"),
        ({"machine.encoder": [5, 9, 6, 5]}, "The encoder of m gives no new samples"),
    ):
        with pytest.raises(HardwareError, match=rule):
            looked(monkeypatch, SEEN | changes)
