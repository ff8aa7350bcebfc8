"""What a machine file may hold, each number at its limits and beyond; what of a scenario fits a machine."""

from contextlib import nullcontext
from operator import attrgetter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from on_hardware import SIMULATED, altered

from cosim.data.recording import Recording
from cosim.hardware import look as looking
from cosim.hardware.look import look
from cosim.hardware.machine import Machine, read_machine
from cosim.hardware.replay import _check_ticks
from cosim.hardware.virtual import plant_of
from cosim.hardware.wired import _ends, refuse_what_has_no_machine
from cosim.hardware.words import LIMITS
from cosim.support.errors import HardwareError
from cosim.system.algorithm import GaussSeidel, Jacobi
from cosim.system.wire import Wire

LARGE, LONG = 1e12, 1e9
"""Greatest number of anything with a unit of its own, and longest time [ms] or count."""
POSITIVE = 1e-300
WAITED = ("ramp", "patience", "window", "heartbeat")
RANGES = {
    "watchdog_ms": ((POSITIVE, LONG), (0, LONG * 1.001)),
    "black_box_seconds": ((POSITIVE, 86_400), (0, 86_401)),
    **{f"limits.{name}": ((POSITIVE, LARGE), (0, -1.0, LARGE * 1.001)) for name in LIMITS},
    **{
        f"reactions.{one}_ms": ((POSITIVE, LONG), (0, LONG * 1.001))
        for one in ("ramp", "patience", "window", "heartbeat")
    },
    "reactions.stop_slew": ((POSITIVE, LARGE), (0, LARGE * 1.001)),
    **{f"reactions.{one}_cycles": ((0, 10**9), (-1, 10**9 + 1)) for one in ("lost", "stale", "mismatch")},
    "reactions.late_in_a_row": ((1, 10**9), (0, 10**9 + 1)),
    "reactions.late_in_window": ((1, 64), (0, 65)),
    "clock.spin_us": ((0, 1000), (-1, 1001)),
    "clock.answer_us": ((POSITIVE, 1e6), (0, 1.001e6)),
    "clock.answer_spin_us": ((0, 1000), (-1, 1001)),
    "encoder.apart": ((POSITIVE, LARGE), (0, LARGE * 1.001)),
    "encoder.eccentricity": ((0, 1e-3), (-1e-9,)),
}
"""By key: numbers that it takes, and those that it does not."""


def with_number(key: str, value: float) -> Machine:
    """The simulated machine with one number changed, read anew."""
    section, _, name = key.rpartition(".")
    return altered(**{section: {name: value}} if section else {name: value})


@pytest.mark.parametrize("key", RANGES)
def test_a_number_is_taken_up_to_its_limits_and_refused_beyond_them_by_its_key(key: str) -> None:
    good, bad = RANGES[key]
    for value in good:
        assert attrgetter(key)(with_number(key, value)) == value
    for value in bad:
        with pytest.raises(HardwareError, match=key.replace(".", r"\.")):
            with_number(key, value)


def test_what_a_file_does_not_say_is_what_the_documentation_says() -> None:
    """docs/hardware.md; a machine in use must not change its reactions with the next version."""
    plain = Machine(name="plain", adapter="simulated", limits=SIMULATED.limits)
    assert (plain.watchdog_ms, plain.black_box_seconds, plain.inject) == (2.0, 120.0, ())
    assert plain.clock.model_dump() == {"spin_us": 20.0, "answer_us": 60.0, "answer_spin_us": 50.0}
    assert plain.encoder.model_dump() == {"heads": 0, "apart": 1e-4, "eccentricity": 0.0}
    assert plain.reactions.model_dump() == {
        "ramp_ms": 20.0,
        "stop_slew": 5000.0,
        "patience_ms": 100.0,
        "lost_cycles": 2,
        "stale_cycles": 2,
        "mismatch_cycles": 10,
        "late_in_a_row": 3,
        "late_in_window": 10,
        "window_ms": 1000.0,
        "heartbeat_ms": 500.0,
    }


LIMITED = "\n[limits]\n" + "\n".join(f"{name} = 1.0" for name in LIMITS)
BEGUN = 'name = "x"\nadapter = "simulated"\n'


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (f"{BEGUN.replace('simulated', 'udp://there:1')}encoder.heads = 4{LIMITED}", "heads = 4, and only adapter ="),
        (BEGUN, '"limits" is missing'),
        (f'name = "x"\nadapter = "wireless"{LIMITED}', "adapter = 'wireless' breaks a rule"),
        *(
            (f'name = "x"\nadapter = "{url}"{LIMITED}', 'an adapter is "simulated" or "udp://HOST:PORT" or')
            for url in ("udp://127.0.0.1", "udp://:4020", "udp://127.0.0.1:x", "tcp://127.0.0.1:4020")
        ),
        (f"{BEGUN}heat = 1{LIMITED}", '"heat" is no key of a machine; keys there are: name'),
        (f"{BEGUN}[limits]\ntorque = 50.0", '"limits.slew" is missing'),
        ("name = ", "not valid TOML"),
        ('name = "\udc98"', r"m\.toml is not text in UTF-8 \(at byte 8\)"),
    ],
)
def test_a_file_that_is_no_machine_is_refused_in_a_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "m.toml").write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(HardwareError, match=sentence):
        read_machine(tmp_path / "m.toml")


# What of a scenario fits a machine, and what a replay and a look take as it stands.


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
def test_cycles_begin_with_the_session_and_follow_each_other_less_those_that_were_late(ticks, late, rule) -> None:
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
    watched = SimpleNamespace(
        wired=SimpleNamespace(inputs=("q", "q_d"), setpoints=np.array([[0.0, 0.0], [setpoint, 9.0]])),
        statistics={"cycles": 4, "worst_wake_up_us": 3.0, "secret": 1},
        advance=went.append,
    )
    columns = {name: np.array(column, float) for name, column in table.items()}
    monkeypatch.setattr(looking, "Session", lambda *_: nullcontext(watched))
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
