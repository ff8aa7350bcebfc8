"""Firmware computes the bits of its FMU, of what was learned too, fits in what is stated, gives no torque on doubt."""

import json
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import firmware_tools as tools
import numpy as np
import pytest
from commands import call
from firmware_tools import ENABLE, FAULT, INPUT, OFF, ON, OUTPUT, PERIOD, RESET
from on_hardware import recorded, session

from cosim.hardware.session import run_session
from pyfmi_models.card import Card, read_card
from pyfmi_models.effects.base import Motion
from pyfmi_models.effects.learned import LearnedFriction
from pyfmi_models.effects.learned_drive import LearnedDrive
from pyfmi_models.errors import ExportError
from pyfmi_models.export.build import compile_shared
from pyfmi_models.export.firmware import Project, firmware, target_of
from pyfmi_models.export.objects import footprint
from pyfmi_models.export.platforms import host
from pyfmi_models.model import Model, Variable

pytestmark = pytest.mark.skipif(not host().endswith("-linux"), reason="firmware for the host is for Linux")
TARGETS = ("host", "cortex-a9")


@cache
def paper() -> Card:
    return read_card("paper_mount")


@cache
def project(target: str) -> Project:
    return tools.project_of(paper(), target)


@cache
def program(target: str) -> Path:
    tools.need(target)
    return tools.program_of(project(target), target)


@cache
def rows(count: int = 20_002, frequency: float = 1.0) -> np.ndarray:
    """Times five outputs: 100 000 numbers."""
    return tools.samples(paper(), count, frequency)


@cache
def expected() -> np.ndarray:
    return tools.fmu_answers(paper(), rows())


@pytest.mark.parametrize("target", TARGETS)
def test_a_hundred_thousand_outputs_are_those_of_the_fmu_bit_for_bit(target: str) -> None:
    found = tools.answers(program(target), target, rows(), 5)
    assert found[2:, 2:].size == 100_000
    assert (found[:3, 0] == [FAULT, OFF, ON]).all()
    assert np.array_equal(found[2:, 2:], expected())
    assert np.array_equal(found[2:, 1], expected()[:, 0]), "the order is the command"
    wraps = np.abs(np.diff(rows()[:, 0])).max()
    assert wraps < 2**31 < rows()[:, 0].max(), "a number with sign wraps on the way, one without does not"


def test_the_encoder_wraps_without_a_step_in_the_position() -> None:
    given = rows().copy()
    given[:, 0] = np.mod(given[:, 0] + 2**31, 2**32)
    assert np.abs(np.diff(given[:, 0])).max() > 2**31
    found = tools.answers(program("host"), "host", given, 5)
    assert np.array_equal(found[2:, 2:], tools.fmu_answers(paper(), given))


@pytest.mark.parametrize("target", TARGETS)
def test_the_compiler_of_the_reader_makes_the_same_bits_without_a_warning(tmp_path: Path, target: str) -> None:
    line = target_of(target).command("gcc")
    compiler = line.split()[0]
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    tools.need(target)
    project(target).write(tmp_path)
    subprocess.run(line.replace("gcc ", "gcc -Wall -Wextra -Werror ", 1), shell=True, cwd=tmp_path, check=True)
    found = tools.answers(tmp_path / "controller", target, rows(), 5)
    assert np.array_equal(found[2:, 2:], expected())


def test_a_cycle_on_the_cortex_a9_takes_few_instructions_and_no_more_stack_than_was_worked_out() -> None:
    cycles, steps, stack = tools.effort(project("cortex-a9"), program("cortex-a9"), rows(152, 20.0))
    assert len(steps) == 150
    assert 300 < min(steps) <= max(steps) < 2000
    assert all(step < cycle < step + 300 for step, cycle in zip(steps, cycles, strict=True))
    assert 0.5 * project("cortex-a9").size.stack < stack <= project("cortex-a9").size.stack


def states(changes: dict[int, tuple[int, float]], count: int = 12) -> list[int]:
    """States after each cycle when numbers of samples (cycle: place, value) are changed; torque only where it is on."""
    given = rows()[:count].copy()
    for cycle, (place, value) in changes.items():
        given[cycle:, place] = value if place == 1 else given[cycle:, place]
        given[cycle, place] = value
    found = tools.answers(program("host"), "host", given, 5)
    assert (found[found[:, 0] != ON, 1] == 0).all()
    assert (found[found[:, 0] == ON, 1] != 0).all()
    return [int(one) for one in found[:, 0]]


UP = [FAULT, OFF, ON]


def test_torque_comes_only_by_the_edges_of_a_reset_and_of_an_enable() -> None:
    assert states({}) == UP + [ON] * 9
    assert states({0: (1, RESET)})[:2] == [FAULT, FAULT], "a reset that is there at the start is no edge"
    assert states({1: (1, RESET | ENABLE), 5: (1, ENABLE)}) == [FAULT] + [OFF] * 11
    assert states({5: (1, 0), 8: (1, ENABLE)}) == [*UP, ON, ON, OFF, OFF, OFF, ON, ON, ON, ON]


@pytest.mark.parametrize(
    ("place", "value"), [(0, np.nan), (2, 1.0), (4, np.nan), (4, np.inf)], ids=["read", "edge", "nan", "infinite"]
)
def test_a_failed_read_a_missed_edge_and_a_number_that_is_none_end_in_a_latched_fault(place: int, value: float) -> None:
    assert states({6: (place, value)}) == [*UP, ON, ON, ON] + [FAULT] * 6
    again = {6: (place, value), 7: (1, RESET), 8: (1, ENABLE)}
    assert states(again) == [*UP, ON, ON, ON, FAULT, OFF, ON, ON, ON, ON]


def test_entering_again_the_controller_starts_anew() -> None:
    given = rows()[:40].copy()
    given[20:23, 1] = 0
    found = tools.answers(program("host"), "host", given, 5)
    later = np.vstack((given[:2], given[23:]))
    later[:2, 0] = later[2, 0]
    assert np.array_equal(found[23:, 2:], tools.answers(program("host"), "host", later, 5)[2:, 2:])


@pytest.mark.parametrize("target", TARGETS)
def test_what_the_loop_on_a_machine_recorded_gives_the_same_commands_again(tmp_path: Path, target: str) -> None:
    with session(tmp_path) as one:
        assert run_session(one)["completed"]
    kept = recorded(tmp_path)
    stepped = np.flatnonzero(kept["machine.notes"].astype(int) & 2)
    rows = np.zeros((stepped[-1] + 1, 7))
    rows[:, 0] = kept["machine.counts"][: len(rows)]
    rows[:, 4:] = np.column_stack([kept[name][: len(rows)] for name in ("q_d", "v_d", "a_d")])
    rows[1, 1], rows[stepped[0] :, 1] = RESET, ENABLE
    found = tools.answers(program(target), target, rows, 5)
    assert (found[stepped, 0] == ON).all()
    assert np.array_equal(found[stepped, 2], kept["machine.command"][stepped])
    assert len(stepped) > 3000


C = """
extern int beyond(int);
static const int table[100] = {1, 2, 3};
static int memory[50];
static volatile int unused[1000];
__attribute__((noinline)) static int lower(int x) { volatile char room[1000]; room[x] = 1; return room[0] + table[x]; }
__attribute__((noinline)) static int upper(int x) { volatile char room[500]; room[x] = 1; return lower(x) + room[1]; }
int forgotten(void) { return unused[0]; }
int start(int x) { memory[x & 31] = x; return upper(x) + beyond(memory[x & 15]) + 1; }
"""


@pytest.mark.parametrize("name", TARGETS)
def test_the_deepest_chain_of_calls_and_what_is_reached_are_added_up(name: str) -> None:
    target = target_of(name)
    flags = ("-O1", "-c", "-g0", "-ffunction-sections", "-fdata-sections", "-fstack-size-section", *target.flags)
    objects = [compile_shared({"a.c": C.encode()}, "a.o", target.target, flags)]
    found = footprint(objects, "start")
    assert 1500 <= found.stack < 1700
    assert (found.constants, found.variables, found.outside) == (400, 200, ("beyond",))
    assert 0 < found.code < 1000
    detour = C.replace("return room[0]", "return x ? start(x - 1) : room[0]").replace(
        "extern", "int start(int); extern"
    )
    objects = [compile_shared({"a.c": detour.encode()}, "a.o", target.target, flags)]
    with pytest.raises(ValueError, match="calls itself, so no depth of the stack can be stated"):
        footprint(objects, "start")


def test_the_command_writes_a_project_that_names_its_size_and_overwrites_nothing(tmp_path: Path, capsys: Any) -> None:
    words = ("hardware", "firmware", "paper_mount", "--target", "host", "--out", str(tmp_path / "out"))
    assert call(*words, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["variables"] < 1000 < found["code"]
    assert not [name for name in found["outside"] if "alloc" in name or name == "free"]
    page = (tmp_path / "out" / "README.md").read_text("utf-8")
    assert f"| stack, deepest chain of calls | {found['stack']} |" in page
    assert target_of("host").command("zig") in page
    assert call(*words) == 2
    assert "exists already; give --force" in capsys.readouterr().err
    assert call(*words, "--force") == 0


BLIND = '[mount]\ninertia = 1.0\n[friction]\nmodel = "none"\n[controller]\nkp = 1.0\nkd = 1.0\n'


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("emps",), "there is no [controller] section"),
        (("blind.toml",), "[encoder] counts_per_rev is missing; a firmware reads counts"),
        (("paper_mount", "--target", "vax"), 'firmware target "vax" is unknown; there are: cortex-a9, host'),
    ],
)
def test_what_cannot_be_firmware_is_refused_in_one_sentence(
    words: tuple[str, ...], sentence: str, tmp_path: Path, capsys: Any, monkeypatch: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("blind.toml").write_text(BLIND)
    assert call("hardware", "firmware", *words, "--out", "out") == 2
    assert sentence in " ".join(capsys.readouterr().err.split())
    assert not Path("out").exists()


def test_a_model_that_is_not_sampled_or_lacks_the_encoder_is_refused() -> None:
    plant, controller, host_target = paper().plant().model(), paper().controller_model(), target_of("host")
    given = {"quantum": 1.0, "command": "tau", "origin": ""}
    with pytest.raises(ExportError, match="is not sampled, so there is no step for a firmware"):
        firmware(plant, host_target, encoder="q", **given)
    with pytest.raises(ExportError, match='has no input "angle"; there are: q, q_d, v_d, a_d'):
        firmware(controller, host_target, encoder="angle", **given)


# What was learned: friction and a drive's curve, sampled.

FRICTION = LearnedFriction(over="position", seen=(-0.02, 0.02), level_change=(0.1, 0.3, -0.2, 0.05))
DRIVE = LearnedDrive(command_seen=(-20.0, 20.0), missing=(0.0, 0.4, 0.1, -0.05))
QUANTUM, LEVEL = 1e-8, 3.0


def ahead() -> Model:
    """The torque that a drive gives of what friction takes at a set point: both as they were learned."""
    t, x, u, p = (ca.SX.sym(name, size) for name, size in (("t", 1), ("x", 0), ("u", 4), ("p", 0)))
    level = FRICTION.level(LEVEL, Motion(t, u[0], u[2], u[0])) * ca.tanh(u[2] / 0.01)
    given = ca.vertcat(DRIVE.applied((), level), level)
    inputs, outputs = (
        tuple(Variable(name=name, unit="1", description=name) for name in names)
        for names in ((INPUT, "position_d", "velocity_d", "acceleration_d"), (OUTPUT, "level"))
    )
    equations = ca.Function("equations", [t, x, u, p], [ca.SX(0, 1), given])
    kinds = {"inputs": inputs, "parameters": (), "states": (), "outputs": outputs}
    return Model(name="ahead", description="Friction ahead", equations=equations, period=PERIOD, **kinds)


def beyond() -> np.ndarray:
    """A reset, a start, then a sine over half as much again as what was seen."""
    t = PERIOD * np.arange(4000)
    q, v = 0.03 * np.sin(20 * t), 0.6 * np.cos(20 * t)
    counts, request = np.round(q / QUANTUM), np.full(t.size, ENABLE)
    request[0], request[1] = 0, RESET
    columns = (np.mod(counts, 2**32), request, 0 * t, counts, q, v, -20 * v)
    return np.ascontiguousarray(np.column_stack(columns), float)


@pytest.mark.parametrize("target", TARGETS)
def test_what_was_learned_gives_the_bits_of_the_fmu_on_a_board(target: str) -> None:
    tools.need(target)
    model, fed = ahead(), beyond()
    program = tools.program_of(tools.project_of_model(model, QUANTUM, target), target)
    found = tools.answers(program, target, fed, 2)[2:, 2:]
    expected = tools.model_answers(model, QUANTUM, fed)
    assert np.array_equal(found, expected)
    assert np.ptp(np.abs(expected[:, 1])) > 1.0, "the table is seen"
    q = QUANTUM * np.round(fed[2:, 4] / QUANTUM)
    waves = np.cos(np.pi * np.outer(np.arange(4), (np.clip(q, -0.02, 0.02) + 0.02) / 0.04))
    told = LEVEL * np.exp(FRICTION.level_change @ waves) * np.tanh(fed[2:, 5] / 0.01)
    np.testing.assert_allclose(expected[:, 1], told, rtol=1e-12, atol=1e-12)
