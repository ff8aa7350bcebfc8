"""On a machine the controller is the one of the co-simulation, and torque is zero on any doubt."""

import os
import signal
import subprocess
import sys
import textwrap
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny_fmu import described, description, tiny
from typer.testing import CliRunner

from cosim.cli import application
from cosim.cli_cache import with_fmus
from cosim.errors import HardwareError
from cosim.hardware.blackbox import HEADER, read_black_box, recording_of
from cosim.hardware.machine import Inject, Machine, parse_machine, read_machine
from cosim.hardware.replay import replay
from cosim.hardware.session import Session, run_session
from cosim.hardware.structures import RECORD
from cosim.hardware.words import FAULTS, LIMITS
from cosim.master import run
from cosim.recording import Recording
from cosim.scenario import Scenario, parse_scenario
from cosim.wiring import Record

__all__ = ["tiny"]
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the loop needs absolute sleeps")

SCENARIO = """
name = "hardware"
step = 1e-4
stop = 0.4
[components.mount]
card = "paper_mount"
part = "plant"
[components.controller]
card = "paper_mount"
part = "controller"
[signals.reference]
kind = "sine"
frequency = 1.0
max_velocity = 2e-3
smooth_start = 0.1
[[connections]]
from = "controller.tau"
to = "mount.tau"
[[connections]]
from = "mount.q"
to = "controller.q"
quantum = 1.4629180792671596e-9
[[connections]]
from = "reference.position"
to = "controller.q_d"
[[connections]]
from = "reference.velocity"
to = "controller.v_d"
[[connections]]
from = "reference.acceleration"
to = "controller.a_d"
[record]
signals = { tau = "mount.tau", q = "controller.q" }
"""
SIMULATED = read_machine("simulated")
AT = 0.2
"""Seconds after switching on at which a fault is injected; the axis moves then."""


def scenario(*changes: tuple[str, str]) -> Scenario:
    text = SCENARIO
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return with_fmus(parse_scenario(text, "hardware.toml", Path()))


def machine(**inject: Any) -> Machine:
    faults = (Inject(**({"at": AT} | inject)),) if inject else ()
    return SIMULATED.model_copy(update={"inject": faults})


def session(folder: Path, given: Machine = SIMULATED, what: Scenario | None = None, **options: Any) -> Session:
    return Session(what or scenario(), given, folder / "box", fast=True, **options)


def recorded(folder: Path) -> Recording:
    kept = read_black_box(folder / "box")
    assert kept.torn == 0
    return recording_of(kept, "box")


def simulated(what: Scenario) -> Recording:
    records = {"command": Record("controller.tau"), "acting": Record("mount.tau"), "q": Record("controller.q")}
    return run(replace(what, records=records)).recording


@pytest.mark.parametrize("quantum", ["1.4629180792671596e-9", "5e-14"])
def test_commands_are_those_of_the_co_simulation_bit_for_bit_also_where_the_encoder_wraps(
    tmp_path: Path, quantum: str
) -> None:
    what = scenario(("1.4629180792671596e-9", quantum))
    with session(tmp_path, what=what) as one:
        assert run_session(one)["completed"]
    machine, twin = recorded(tmp_path), simulated(what)
    stepped = machine["machine.notes"].astype(int) & 2 > 0
    wraps = np.abs(np.diff(machine["machine.counts"])).max() > 2**31
    assert wraps == (quantum == "5e-14")
    assert np.array_equal(machine["machine.command"][stepped][:-1], twin["command"][1:])
    assert np.array_equal(machine["q"][stepped], twin["q"])


def test_an_impulse_takes_as_many_ticks_to_the_motor_and_to_the_encoder_on_both(tmp_path: Path) -> None:
    sine = 'kind = "sine"\nfrequency = 1.0\nmax_velocity = 2e-3\nsmooth_start = 0.1'
    steps = 'kind = "steps"\ntimes = [0.05, 0.0501]\nvalues = [1e-4, 0.0]\nunit = "rad"'
    wires = SCENARIO[SCENARIO.index('[[connections]]\nfrom = "reference.velocity"') : SCENARIO.index("[record]")]
    what = scenario((sine, steps), (wires, ""), ("reference.position", "reference.value"))
    at = 500
    with session(tmp_path, what=what) as one:
        one.enable()
        one.track()
    machine, twin = recorded(tmp_path), simulated(what)
    first = int(np.flatnonzero(machine["machine.notes"].astype(int) & 1)[0])
    acting = np.concatenate(([0.0], machine["machine.order"][:-1]))[first:]
    delays = [
        [int(np.flatnonzero(signal)[0]) - at for signal in pair]
        for pair in ((acting, machine["q"][first:]), (twin["acting"], twin["q"]))
    ]
    assert delays[0] == delays[1]
    assert delays[0][0] == 1, "a command acts one tick after its sample"


INJECTED = {
    "frame_lost": ({"kind": "lost"}, 3),
    "encoder_stale": ({"kind": "stale"}, 3),
    "encoder_jump": ({"kind": "jump", "size": 1e-5, "lasts": 1e-4}, 1),
    "overspeed": ({"kind": "jump", "size": 1e-4, "lasts": 1e-4}, 1),
    "torque_mismatch": ({"kind": "saturated", "size": 0.1}, 11),
    "drive_fault": ({"kind": "tripped", "lasts": 1e-4}, 1),
}
"""Fault of the simulated drive, and the cycles from its first one to the fault, that one counted."""


def assert_safe(found: Recording, fault: str, begun: int, within: int) -> None:
    bit = 1 << list(FAULTS).index(fault)
    tick, state = found["machine.tick"].astype(int), found["machine.state"].astype(int)
    seen = (found["machine.faults"].astype(int) & bit > 0) & (tick >= begun)
    assert seen.any(), f"{fault} was not found"
    first = int(np.flatnonzero(seen)[0])
    assert tick[first] - begun < within
    assert list(state[first : first + 3]) == [6, 7, 7], "fault reaction, then fault, and there it stays"
    assert not found["machine.order"][first:].any(), "torque is zero from the cycle of the fault on"
    assert found["machine.order"][:first].any(), "there was a torque to take away"


@pytest.mark.parametrize("fault", INJECTED)
def test_each_fault_of_the_drive_is_found_and_ends_in_fault_without_torque(tmp_path: Path, fault: str) -> None:
    inject, within = INJECTED[fault]
    with session(tmp_path, machine(**inject)) as one:
        done = run_session(one)
    assert not done["completed"]
    assert done["state"] == "fault"
    assert fault in done["faults"]
    found = recorded(tmp_path)
    assert_safe(found, fault, round(AT / 1e-4), within)
    assert replay(found).identical


def test_a_dead_drive_is_found_as_one_that_does_not_answer(tmp_path: Path) -> None:
    with session(tmp_path, machine(kind="dead")) as one:
        run_session(one)
    assert_safe(recorded(tmp_path), "frame_lost", round(AT / 1e-4), 3)


@pytest.mark.parametrize("kind", ["lost", "stale"])
def test_what_is_short_is_survived(tmp_path: Path, kind: str) -> None:
    with session(tmp_path, machine(kind=kind, lasts=2e-4)) as one:
        assert run_session(one)["completed"]


def tighten(name: str, value: float) -> Callable[[Session], None]:
    return lambda one: one.tighten(name, value)


PROVOKED: dict[str, Callable[[Session], Any]] = {
    "estop": lambda one: one.estop(),
    "heartbeat_lost": lambda one: one.run_alone(6000),
    "deadline": lambda one: one.lose(64),
    "following_error": tighten("following_error", 1e-12),
    "overspeed": tighten("speed", 1e-9),
    "encoder_jump": tighten("jump", 0.0),
}


@pytest.mark.parametrize("fault", PROVOKED)
def test_each_doubt_of_the_loop_ends_in_fault_without_torque(tmp_path: Path, fault: str) -> None:
    what = scenario(("stop = 0.4", "stop = 1.0"))
    with session(tmp_path, what=what) as one:
        one.enable()
        one.track(2000)
        begun = one.status.tick
        PROVOKED[fault](one)
        one.advance(50)
        assert fault in one.status.faults
        assert one.status.state == "fault"
        assert one.status.torque == 0
    found = recorded(tmp_path)
    assert_safe(found, fault, begun, 5002 if fault == "heartbeat_lost" else 100)
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


def test_the_adapter_may_say_itself_that_it_failed(tmp_path: Path) -> None:
    with session(tmp_path) as one:
        one.enable()
        one.track(2000)
        one.transport.drive.failed = 1
        begun = one.status.tick
        one.advance(4)
    assert_safe(recorded(tmp_path), "adapter_failed", begun, 1)


def test_a_drive_that_leaves_operation_unasked_is_a_fault(tmp_path: Path) -> None:
    with session(tmp_path) as one:
        one.enable()
        one.track(2000)
        one.transport.drive.state = 3
        begun = one.status.tick
        one.transport.drive.control = 0
        one.axis.controlword = 7
        one.advance(4)
    assert_safe(recorded(tmp_path), "drive_state", begun, 2)


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


def test_after_a_fault_the_controller_starts_afresh_and_follows_again(tmp_path: Path) -> None:
    with session(tmp_path, what=scenario(("stop = 0.4", "stop = 0.1"))) as one:
        one.enable()
        one.track(200)
        one.estop()
        one._ask(0)
        one.enable()
        assert one.track().running
        one.disable()
        assert one.status.state == "switch on disabled"
    assert replay(recorded(tmp_path)).identical


def test_torque_grows_from_zero_and_leaves_by_a_ramp(tmp_path: Path) -> None:
    far = scenario(("smooth_start = 0.1", "smooth_start = 0.1\nphase = 0.2"))
    with session(tmp_path, what=far) as one:
        one.enable()
        one.track(1000)
        one.disable()
    found = recorded(tmp_path)
    first = int(np.flatnonzero(found["machine.notes"].astype(int) & 1)[0])
    order = found["machine.order"]
    ramp = 50.0 * np.arange(1, 201) / 200
    assert np.all(np.abs(order[first : first + 200]) <= ramp * (1 + 1e-12))
    stop = np.abs(order[found["machine.state"] == 5])
    assert np.all(np.diff(stop) <= 0)
    assert np.allclose(-np.diff(stop)[:-1], 0.5)


def entered(folder: Path, position: float) -> np.ndarray:
    """Return the orders of a session that enters operation with the axis at rest at a position, and follows a ramp."""
    sine = 'kind = "sine"\nfrequency = 1.0\nmax_velocity = 2e-3\nsmooth_start = 0.1'
    ramp = f'kind = "ramp"\nstart = {position}\nvelocity = 1e-4'
    what = scenario((sine, ramp), ('part = "plant"', f'part = "plant"\nparameters = {{ position = {position} }}'))
    with session(folder, what=what) as one:
        one.enable()
        one.track(1000)
    found = recorded(folder)
    return found["machine.order"][int(np.flatnonzero(found["machine.notes"].astype(int) & 1)[0]) :][:1000]


def test_entry_is_bumpless_wherever_the_axis_is(tmp_path: Path) -> None:
    at_zero, elsewhere = (entered(tmp_path / str(place), place) for place in (0.0, np.pi / 4))
    assert np.abs(at_zero[:50]).max() < 0.5, "the observer begins at the measured position"
    assert np.abs(at_zero).max() > 0.1
    assert np.allclose(elsewhere, at_zero, atol=1e-6), "what rounding does"


@pytest.mark.parametrize(("name", "value", "note"), [("torque", 1.0, 4), ("slew", 5.0, 8)])
def test_torque_and_slew_keep_to_limits_tightened_on_the_way(
    tmp_path: Path, name: str, value: float, note: int
) -> None:
    with session(tmp_path) as one:
        one.enable()
        one.track(500)
        one.tighten(name, value)
        tightened = one.status.tick
        one.track(1500)
    found = recorded(tmp_path)
    order, operating = found["machine.order"], found["machine.state"] == 4
    seen = operating & (found["machine.tick"] > tightened)
    measured = np.abs(order) if name == "torque" else np.abs(np.diff(order, prepend=0.0)) / 1e-4
    assert measured[seen].max() <= value * (1 + 1e-9)
    assert (found["machine.notes"][seen].astype(int) & note).any(), "the limit was met"
    assert replay(found).identical


def test_a_limit_is_never_loosened_while_enabled(tmp_path: Path) -> None:
    with session(tmp_path) as one:
        one.enable()
        one.track(100)
        with pytest.raises(HardwareError, match='"torque" is 50 and can be tightened, not set to 60'):
            one.tighten("torque", 60.0)
        with pytest.raises(HardwareError, match='"heat" is no limit; limits are: torque'):
            one.tighten("heat", 60.0)
        one._session.value, one._session.change = 60.0, 1 + LIMITS.index("torque")
        one.advance(2)
        assert one.axis.limit[0] == 50.0
        assert one.statistics["refused_limits"] == 1


@pytest.mark.parametrize(("edges", "state"), [(1, "operation enabled"), (3, "fault"), (64, "fault")])
def test_one_late_cycle_is_held_more_stop_the_axis(tmp_path: Path, edges: int, state: str) -> None:
    slow = SIMULATED.model_copy(update={"watchdog_ms": 100.0})
    with session(tmp_path, slow if edges < 64 else SIMULATED) as one:
        one.enable()
        one.track(1000)
        one.lose(edges)
        one.advance(1 + edges)
        if edges == 3:
            assert one.status.state == "quick stop active"
            one._ask(0)
            one.advance(500)
            assert one.status.state == "switch on disabled"
        else:
            one.advance(3)
            assert one.status.state == state
    assert replay(recorded(tmp_path)).identical


def test_late_cycles_that_are_few_but_many_in_a_window_are_a_fault(tmp_path: Path) -> None:
    with session(tmp_path) as one:
        one.enable()
        for _ in range(9):
            one.lose(1)
            one.track(50)
        assert one.status.running
        one.lose(1)
        one.track(50)
        assert "deadline" in one.status.faults


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


def test_a_drive_that_is_not_there_is_never_enabled(tmp_path: Path) -> None:
    with session(tmp_path, machine(kind="dead", at=0.0)) as one, pytest.raises(HardwareError, match="frame_lost"):
        one.enable()
    assert not recorded(tmp_path)["machine.order"].any()


def test_an_axis_far_from_its_set_point_is_never_enabled(tmp_path: Path) -> None:
    sine = 'kind = "sine"\nfrequency = 1.0\nmax_velocity = 2e-3'
    far = scenario((sine, 'kind = "ramp"\nstart = 0.01\nvelocity = 1e-3'))
    with session(tmp_path, what=far) as one, pytest.raises(HardwareError, match="following_error"):
        one.enable()
    assert not recorded(tmp_path)["machine.order"].any()


def test_every_fault_is_provoked_and_documented() -> None:
    others = {"power_up", "not_a_number", "controller_failed", "adapter_failed", "drive_state", "encoder_heads"}
    assert set(FAULTS) == {*INJECTED, *PROVOKED, *others}
    page = (Path(__file__).parents[1] / "docs" / "hardware.md").read_text("utf-8")
    for number, (name, meaning) in enumerate(FAULTS.items(), 1):
        assert f"| {number} | `{name}` | {meaning}" in page


def test_the_recording_is_one_that_a_diagnosis_reads(tmp_path: Path) -> None:
    with session(tmp_path) as one:
        run_session(one)
    path = recorded(tmp_path).write(tmp_path / "r.parquet")
    read = Recording.read(path)
    assert {"tau", "q", "q_d"} <= set(read)
    what = scenario()
    twin = run(replace(what, records={"tau": Record("mount.tau", "mean")})).recording
    first = int(np.flatnonzero(read["machine.notes"].astype(int) & 1)[0])
    assert np.allclose(read["tau"][first:][1:3999], twin["tau"][1:3999], rtol=1e-15, atol=1e-15)
    assert replay(read).identical


def test_a_replay_notices_a_single_changed_bit(tmp_path: Path) -> None:
    with session(tmp_path) as one:
        run_session(one)
    found = recorded(tmp_path)
    order = found["machine.order"].copy()
    order[2000] = np.nextafter(order[2000], 1e9)
    done = replay(replace(found, table=found.table | {"machine.order": order}))
    assert (done.identical, done.first, done.different["machine.order"]) == (False, 2000, 1)
    counts = found["machine.counts"].copy()
    counts[2000] += 1
    done = replay(replace(found, table=found.table | {"machine.counts": counts}))
    assert (done.identical, done.first) == (False, 2000)


def test_a_torn_record_is_known(tmp_path: Path) -> None:
    with session(tmp_path) as one:
        one.advance(100)
    path = tmp_path / "box"
    raw = bytearray(path.read_bytes())
    raw[HEADER + 50 * RECORD.itemsize + 20] ^= 1
    path.write_bytes(raw)
    kept = read_black_box(path)
    assert (len(kept.records), kept.torn) == (99, 1)


def test_a_ring_that_is_full_keeps_the_end_and_says_that_the_beginning_is_gone(tmp_path: Path) -> None:
    short = SIMULATED.model_copy(update={"black_box_seconds": 0.05})
    with session(tmp_path, short) as one:
        one.advance(1234)
    found = recorded(tmp_path)
    assert np.array_equal(found["machine.tick"], np.arange(734, 1234))
    with pytest.raises(HardwareError, match="begins at cycle 734"):
        replay(found)


LIVE = """
import sys
from pathlib import Path
sys.path.insert(0, {tests!r})
from test_hardware import SIMULATED, scenario
from cosim.hardware.session import Session
with Session(scenario(("stop = 0.4", "stop = 30.0")), SIMULATED, Path({box!r}), fast=True) as one:
    one.enable()
    one.track(1000)
    print("on", flush=True)
    one.track()
"""


def test_a_killed_process_leaves_a_black_box_without_a_torn_record(tmp_path: Path) -> None:
    code = textwrap.dedent(LIVE).format(tests=str(Path(__file__).parent), box=str(tmp_path / "box"))
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
    assert process.stdout is not None
    with process.stdout:
        assert process.stdout.readline() == b"on\n"
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    found = recorded(tmp_path)
    assert found["machine.order"].any()
    assert np.array_equal(np.diff(found["machine.tick"]), np.ones(len(found) - 1))
    assert replay(found).identical


def test_in_real_time_whatever_the_clock_does_the_recording_replays(tmp_path: Path) -> None:
    what = scenario(("stop = 0.4", "stop = 0.2"))
    with Session(what, SIMULATED, tmp_path / "box") as one:
        try:
            done = run_session(one)
        except HardwareError:  # this computer was too late before there was any torque
            done = {"completed": False}
    found = recorded(tmp_path)
    assert done["completed"] or found["machine.order"][-1] == 0
    assert replay(found).identical


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("quantum = 1.4629180792671596e-9", "", "one wire must have the quantum of the encoder, and 0 have one"),
        ("step = 1e-4", "step = 2e-4", '"controller" is sampled every 0.0001 s and the loop every 0.0002 s'),
        ('to = "controller.v_d"', 'to = "controller.v_d"\ngain = 2.0', '"controller.v_d" has a gain'),
        ('to = "controller.q_d"', 'to = "mount.disturbance"', "the plant gives one position|fed by a signal"),
    ],
)
def test_a_scenario_that_fits_no_machine_is_refused_in_a_sentence(
    tmp_path: Path, old: str, new: str, sentence: str
) -> None:
    with pytest.raises(HardwareError, match=sentence):
        session(tmp_path, what=scenario((old, new)))
    assert not (tmp_path / "box").exists()


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ('name = "x"\nadapter = "simulated"', '"limits" is missing'),
        ('name = "x"\nadapter = "wireless"', "adapter = 'wireless' breaks a rule"),
        ('name = "x"\nadapter = "simulated"\nheat = 1', '"heat" is no key of a machine; keys there are: name'),
        ('name = "x"\nadapter = "simulated"\n[limits]\ntorque = 50.0', '"limits.slew" is missing'),
        ("name = ", "not valid TOML"),
    ],
)
def test_a_machine_without_limits_is_refused_in_a_sentence(text: str, sentence: str) -> None:
    if "heat" in text or "wireless" in text:
        text += "\n[limits]\n" + "\n".join(f"{name} = 1.0" for name in LIMITS)
    with pytest.raises(HardwareError, match=sentence):
        parse_machine(text, "x.toml")


def invoke(*arguments: str) -> Any:
    return CliRunner().invoke(application(["hardware", *arguments]), ["hardware", *arguments])


def test_the_command_runs_replays_and_says_no(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text(SCENARIO, "utf-8")
    done = invoke("run", str(path), "--fast", "--out", str(tmp_path / "out"))
    assert done.exit_code == 0, done.output
    again = invoke("run", str(path), "--fast", "--out", str(tmp_path / "out"))
    assert again.exit_code == 2
    recording = tmp_path / "out" / "recording.parquet"
    assert invoke("replay", str(recording)).exit_code == 0
    found = Recording.read(recording, required=())
    order = found["machine.order"] + 1e-12
    bad = replace(found, table=found.table | {"machine.order": order}).write(tmp_path / "bad.parquet")
    assert invoke("replay", str(bad)).exit_code == 1
    simulation = tmp_path / "simulation.parquet"
    run(scenario(), simulation)
    assert invoke("replay", str(simulation)).exit_code == 2
    looked = invoke("check", str(path), "--seconds", "0.05")
    assert looked.exit_code == 0, looked.output
    assert "worst wake up us" in looked.output
