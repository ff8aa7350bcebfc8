"""On a machine the controller is the one of the co-simulation, within its limits; its encoder may have four heads."""

import ctypes
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from on_hardware import SCENARIO, SIMULATED, invoke, recorded, scenario, session, simulated

from cosim.data.recording import Recording
from cosim.hardware.blackbox import unwrapped
from cosim.hardware.library import library
from cosim.hardware.machine import Encoder, Inject, Machine
from cosim.hardware.replay import replay
from cosim.hardware.session import run_session
from cosim.hardware.structures import CFeedback, CHeads
from cosim.hardware.words import heads_of
from cosim.master.simulate import Options, run
from cosim.support.errors import HardwareError
from cosim.system.scenario import Scenario


@pytest.mark.parametrize("quantum", ["1.4629180792671596e-9", "5e-14"])
def test_commands_are_those_of_the_co_simulation_bit_for_bit_also_where_the_encoder_wraps(tmp_path, quantum) -> None:
    what = scenario(("1.4629180792671596e-9", quantum))
    with session(tmp_path, what=what) as one:
        assert run_session(one)["completed"]
    machine, twin = recorded(tmp_path), simulated(what)
    stepped = machine["machine.notes"].astype(int) & 2 > 0
    wraps = np.abs(np.diff(machine["machine.counts"])).max() > 2**31
    assert wraps == (quantum == "5e-14")
    assert np.array_equal(machine["machine.command"][stepped][:-1], twin["command"][1:])
    assert np.array_equal(machine["q"][stepped], twin["q"])


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


def test_a_scenario_that_fits_no_machine_is_refused_and_nothing_is_left_behind(tmp_path: Path) -> None:
    with pytest.raises(HardwareError, match=r'"controller" is sampled every 0\.0001 s and the loop every 0.0002 s'):
        session(tmp_path, what=scenario(("step = 1e-4", "step = 2e-4")))
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


# Four read heads: their mean forgets the disc's eccentricity, and one of them may fail.


QUANTUM, ECCENTRIC, APART = 1.4629180792671596e-9, 2e-5, 1e-4
FAST = (("max_velocity = 2e-3", "max_velocity = 0.15"), ("stop = 0.4", "stop = 1.0"), ("start = 0.1", "start = 0.3"))
AT = 0.5


def encoder(heads: int = 4, *inject: Inject, **changes: Any) -> Machine:
    limits = SIMULATED.limits.model_copy(update={"speed": 1.0, "following_error": 1e-2})
    given = Encoder(**({"heads": heads, "apart": APART, "eccentricity": ECCENTRIC} | changes))
    return SIMULATED.model_copy(update={"encoder": given, "inject": inject, "limits": limits})


def followed(folder: Path, machine: Machine, what: Scenario | None = None) -> tuple[dict[str, Any], Recording]:
    folder.mkdir(exist_ok=True)
    with session(folder, machine, what or scenario(*FAST)) as one:
        done = run_session(one)
    found = recorded(folder)
    assert replay(found).identical
    return done, found


def angle(found: Recording, head: int) -> np.ndarray:
    """What a head read [rad], without wraps, from the signed first reading on."""
    words = found[f"machine.head{head}"].astype(np.uint32)
    return unwrapped(words) * QUANTUM


def truth(found: Recording) -> np.ndarray:
    """The angle from what head 0 read, which the simulated disc misreads in a known way."""
    q = read = angle(found, 0)
    for _ in range(5):
        q = read - ECCENTRIC * (np.sin(q) + np.sin(2 * q) / 4 + np.sin(3 * q) / 8)
    return q


FAILURES = {"silent": "silent_head", "frozen": "frozen_head", "astray": "stray_head"}


@pytest.mark.parametrize(
    ("why", "head"), [("silent", 0), ("frozen", 0), ("astray", 0), ("silent", 1), ("frozen", 2), ("astray", 3)]
)
def test_one_head_that_fails_is_named_and_left_out_without_a_step(tmp_path: Path, why: str, head: int) -> None:
    inject = Inject(kind=FAILURES[why], at=AT, size=1e-3, head=head)
    done, found = followed(tmp_path, encoder(4, inject))
    assert done["completed"]
    assert done["heads_left_out"] == {head: why}
    reasons = found["machine.left_out"].astype(int)
    first = int(np.flatnonzero(reasons)[0])
    assert heads_of(reasons[first]) == {head: why}
    assert set(reasons[first:]) == {reasons[first]}
    late = found["machine.tick"][first] - round(AT / 1e-4)
    assert late == 0
    # The mean of four is free of eccentricity, which each alone is not; what is left of a pair is twice a turn.
    error = found["q"] - (truth(found) if head else shifted(found))
    assert np.ptp(angle(found, 1)[:first]) > 0.02
    assert np.abs(error[:first]).max() < 2 * QUANTUM
    assert np.abs(error).max() < ECCENTRIC / 2 + 2 * QUANTUM
    assert np.abs(np.diff(error)).max() < 1e-8


def test_a_head_that_freezes_at_rest_pulls_the_mean_by_a_quarter_of_its_limit_at_most(tmp_path: Path) -> None:
    slow = (("max_velocity = 2e-3", "max_velocity = 1.5e-3"), ("stop = 0.4", "stop = 1.0"))
    done, found = followed(tmp_path, encoder(4, Inject(kind="frozen_head", at=AT, head=2)), scenario(*slow))
    assert done["completed"]
    assert done["heads_left_out"] == {2: "frozen"}
    first = int(np.flatnonzero(found["machine.left_out"])[0])
    assert 100 < found["machine.tick"][first] - round(AT / 1e-4) < 4000
    error = np.abs(found["q"] - truth(found))
    assert 0.8 * APART / 4 < error.max() < APART / 4 + ECCENTRIC / 2


def shifted(found: Recording) -> np.ndarray:
    """As `truth`, from the mean of heads 1 and 3, where head 0 is the one that fails."""
    read = (angle(found, 1) + angle(found, 3)) / 2
    return read + ECCENTRIC * np.sin(2 * read) / 4


def test_a_second_head_that_fails_is_a_fault_that_a_reset_does_not_take_away(tmp_path: Path) -> None:
    two = (Inject(kind="silent_head", at=AT, head=1), Inject(kind="stray_head", at=AT + 0.1, size=1e-3, head=2))
    with session(tmp_path, encoder(4, *two), scenario(*FAST)) as one:
        done = run_session(one)
        assert done["faults"] == ["encoder_heads"]
        assert done["torque"] == 0
        assert done["heads_left_out"] == {1: "silent", 2: "astray"}
        assert "encoder_heads" in one.reset().faults
    found = recorded(tmp_path)
    first = int(np.flatnonzero(found["machine.faults"].astype(int) & 1 << 15)[0])
    assert found["machine.tick"][first] == round((AT + 0.1) / 1e-4)
    assert not found["machine.order"][first:].any()
    assert replay(found).identical


def combined(readings: np.ndarray, answered: np.ndarray | None = None, apart: int = 1000) -> tuple[np.ndarray, CHeads]:
    """Positions (as counts without wraps) for readings of shape (cycles, 4), by the C function itself."""
    combine = library().heads_combine
    combine.restype = ctypes.c_bool
    heads, found = CHeads(used=4, apart=apart, jump=apart), []
    for k, row in enumerate(readings):
        feedback = CFeedback(heads=15 if answered is None else int(answered[k]))
        feedback.head[:] = [int(one) % 2**32 for one in row]
        assert not combine(ctypes.byref(heads), ctypes.byref(feedback))
        found.append(feedback.counts)
    return np.unwrap(np.array(found, float), period=2**32), heads


def test_all_harmonics_but_each_fourth_cancel_across_the_wrap() -> None:
    turn = np.linspace(0, 2 * np.pi, 2000)
    way = 2**32 * turn / (2 * np.pi) * 0.9 + 2**31
    for harmonic in range(1, 9):
        error = [300 * np.sin(harmonic * (turn + k * np.pi / 2) + 0.3) for k in range(4)]
        found, heads = combined(np.round(np.stack([way + one for one in error], axis=1)))
        left = np.abs(found - way + way[0] - found[0]).max()
        assert heads.reasons == 0
        assert (left > 250) if harmonic % 4 == 0 else (left < 3), harmonic


def test_the_mean_goes_on_without_a_step_whichever_head_stops_answering_when() -> None:
    random = np.random.default_rng(5)
    for trial in range(40):
        lost, when = trial % 4, int(random.integers(1, 50))
        offsets = random.integers(-400, 400, 4)
        way = 2**32 - 1000 + np.arange(60) * int(random.integers(-500, 500))
        answered = np.where(np.arange(60) < when, 15, 15 & ~(1 << lost))
        found, heads = combined(way[:, np.newaxis] + offsets, answered)
        assert heads_of(heads.reasons) == {lost: "silent"}
        assert np.abs(np.diff(found) - np.diff(way)).max() <= 1


@pytest.mark.parametrize("at", [0, 1000, -1000, 2**31 - 2, 2**32 - 2])
@pytest.mark.parametrize("quarters", range(-9, 10))
def test_the_mean_is_rounded_to_the_nearest_count_wherever_the_axis_is_and_halves_up(at: int, quarters: int) -> None:
    """A mean that is cut towards zero would be half a count late in one direction and none in the other."""
    offsets = [quarters // 4 + (k < quarters % 4) for k in range(4)]
    assert sum(offsets) == quarters
    found, _ = combined(at + np.array([[0] * 4, offsets]))
    assert found[1] - found[0] == np.floor(quarters / 4 + 0.5)
