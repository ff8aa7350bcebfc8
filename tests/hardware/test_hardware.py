"""On a machine the controller is the one of the co-simulation, within its limits."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from on_hardware import SCENARIO, invoke, recorded, scenario, session, simulated

from cosim.data.recording import Recording
from cosim.hardware.replay import replay
from cosim.hardware.session import run_session
from cosim.hardware.words import LIMITS
from cosim.master.simulate import Options, run
from cosim.support.errors import HardwareError


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


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (("quantum = 1.4629180792671596e-9", ""), "one wire must have the quantum of the encoder, and 0 have one"),
        (("step = 1e-4", "step = 2e-4"), '"controller" is sampled every 0.0001 s and the loop every 0.0002 s'),
    ],
)
def test_a_scenario_that_fits_no_machine_is_refused_and_nothing_is_left_behind(
    tmp_path: Path, change: tuple[str, str], sentence: str
) -> None:
    with pytest.raises(HardwareError, match=sentence):
        session(tmp_path, what=scenario(change))
    assert not (tmp_path / "box").exists()


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
    run(scenario(), Options(path=simulation))
    assert invoke("replay", str(simulation)).exit_code == 2
    looked = invoke("check", str(path), "--seconds", "0.05")
    assert looked.exit_code == 0, looked.output
    assert "worst wake up us" in looked.output
