"""Foreign code leaves the process as it found it: what it changed is put back, and named."""

import json
import os
import platform
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import ENVIRONMENT, call
from pyarrow.parquet import read_table
from rude_fmu import DEEDS, STAGES, rude_fmu
from small_loop import text_of

import cosim
from cosim.data.recording import Recording
from cosim.fmi.guard import Guard
from cosim.fmi.process import Variables

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="what the FMU of the test changes is there on Linux")
PROBE = Path(__file__).parents[1] / "tools" / "rude_probe.py"
NAMES = {
    "directory": "the working directory",
    "umask": "the umask",
    "locale": "the locale",
    "environment": "the environment variables KIND, RUDE",
    "ignore": "the handlers of SIGPIPE, SIGTERM",
    "alarm": "the alarm timer",
    "block": "the blocked signals",
    "close": "the standard output and the standard error",
    "redirect": "the standard output",
    "limit": "the limit of open files",
    "upward": "the rounding mode",
}
ON_X86 = {
    "flush": "the flush of subnormal numbers to zero",
    "traps": "the traps of floating-point errors",
    "precision": "the floating-point precision",
}
if platform.machine() == "x86_64":
    NAMES |= ON_X86
if len(os.sched_getaffinity(0)) > 1:
    NAMES["cores"] = "the cores of the thread"
FED = {"wires": {"rude.a": "other.y"}}
RING = FED | {"algorithm": {"kind": "iterated", "components": ["other", "rude"]}}


def one(path: Path, fmu: Path | None = None, **component: Any) -> Path:
    """Write a scenario of a component alone: an FMU, or what is said of it."""
    told = {"fmu": fmu} | component if fmu else component
    record = {"signals": {"y": "a.third" if fmu else "a.y"}}
    path.write_text(text_of({}, name="one", step=1e-3, stop=0.003, components={"a": told}, record=record))
    return path


def two(
    path: Path, fmu: Path, tiny: Path, output: str = "third", wires: Any = (), algorithm: Any = "jacobi", **rude: Any
) -> Path:
    """Write a scenario in which an FMU feeds another one."""
    both = {"other": {"fmu": tiny, "parameters": {"k": 0.1}}, "rude": {"fmu": fmu} | rude}
    wires = {"other.a": {"from": f"rude.{output}", "gain": 0.7}} | dict(wires)
    tables = {"components": both, "record": {"signals": {"y": "other.y", "wire": "other.a"}}, "algorithm": algorithm}
    path.write_text(text_of(wires, name="two", step=1e-3, stop=0.2, **tables))
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("rude")


def probed(*scenarios: Path) -> list[dict[str, Any]]:
    """Run scenarios one after the other in one process without isolation."""
    command, given = [sys.executable, PROBE, *scenarios], ENVIRONMENT | {"KIND": "own"}
    done = subprocess.run(command, env=given, cwd=scenarios[0].parent, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found: list[dict[str, Any]] = json.loads(done.stdout)
    return found


STAGES_ASKED = (
    *((2, one) for one in ("load", "instantiate", "setup", "initialise", "step", "terminate", "free")),
    (3, "step"),
)


def deeds(stage: str) -> list[str]:
    return [name for name in NAMES if stage != "load" or name in ("upward", "flush")]


@pytest.fixture(scope="module")
def answers(folder: Path, tiny: dict[int, Path]) -> dict[str, dict[str, Any]]:
    """What is left in a process by a run of each FMU, all one after the other in the same."""
    rude = [rude_fmu(folder, version, deed, stage) for version, stage in STAGES_ASKED for deed in deeds(stage)]
    rude.append(rude_fmu(folder, 2, "handle", "initialise"))
    asked = {fmu.name: one(fmu.with_suffix(".toml"), fmu) for fmu in rude}
    several = rude_fmu(folder, 2, "umask", "step")
    asked["two"] = two(folder / "several.toml", several, tiny[2])
    return dict(zip(asked, probed(*asked.values()), strict=True))


@pytest.mark.parametrize(("version", "stage"), STAGES_ASKED)
def test_what_an_fmu_changes_in_the_process_is_put_back_and_named(
    answers: dict[str, dict[str, Any]], version: int, stage: str
) -> None:
    for deed in deeds(stage):
        name = f"rude_{version}_CoSimulation_{deed}_{stage}.fmu"
        assert answers[name]["changed"] == [], name
        assert answers[name]["notes"] == [f"a ({name}) changed {NAMES[deed]}; restored."]


HANDLES = "rude_2_CoSimulation_handle_initialise.fmu"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        (HANDLES, f"a ({HANDLES}) handles SIGUSR1 itself until it is closed; then restored."),
        ("two", "One of the components (other, rude) that were started and stepped changed the umask; restored."),
    ],
)
def test_a_handler_stays_until_its_fmu_is_closed_and_of_several_all_are_named(
    answers: dict[str, dict[str, Any]], name: str, said: str
) -> None:
    assert answers[name] == {"changed": [], "notes": [said]}


CALLS = [
    ("CoSimulation", 2, "step", "third", {}),
    ("CoSimulation", 2, "set", "third", FED),
    ("CoSimulation", 2, "set", "third", FED | {"step": 4e-3}),
    ("CoSimulation", 2, "get", "third", {}),
    ("CoSimulation", 3, "step", "third", {}),
    ("CoSimulation", 3, "get", "third", {}),
    ("CoSimulation", 2, "get", "shown", {"wires": {"rude.flag": "rude.shown"}}),
    ("CoSimulation", 2, "save", "third", RING),
    ("ModelExchange", 2, "rates", "x", {}),
]
ARITHMETIC = ["upward", *(["flush"] if platform.machine() == "x86_64" else [])]


@pytest.mark.parametrize("deed", ARITHMETIC)
@pytest.mark.parametrize("rude", CALLS, ids=["-".join(map(str, one[:4])) for one in CALLS])
@pytest.mark.parametrize("compiled", [True, False])
def test_arithmetic_that_an_fmu_changes_in_its_calls_changes_no_bit_of_others(
    folder: Path, tiny: dict[int, Path], deed: str, rude: tuple[Any, ...], compiled: bool
) -> None:
    kind, version, stage, output, more = rude
    rows = {}
    for what in ("nothing", deed):
        fmu = rude_fmu(folder, version, what, stage, kind)
        done = cosim.run(two(folder / "two.toml", fmu, tiny[2], output, **more), compiled=compiled)
        rows[what] = done.recording
    for name in rows["nothing"]:
        np.testing.assert_array_equal(rows[deed][name], rows["nothing"][name])
    assert any(NAMES[deed] in note and "rude" in note for note in done.statistics["notes"])
    assert 1.0 + 2.0**-53 == 1.0  # and this process rounds to nearest
    assert 5e-324 * 1.0 > 0.0


@pytest.mark.parametrize("deed", ["hang", "exit", "crash"])
@pytest.mark.parametrize("stage", ["terminate", "free"])
def test_an_fmu_that_does_not_come_back_when_it_is_closed_costs_a_note_and_no_row(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], deed: str, stage: str
) -> None:
    fmu = rude_fmu(folder, 2, deed, stage)
    scenario = one(tmp_path / "late.toml", fmu)
    assert call("run", scenario, "--out", tmp_path / "out", "--call-timeout", 0.5) == 0
    recording = Recording.read(tmp_path / "out" / "recording.parquet", required=())
    assert (len(recording), recording.origin["complete"]) == (3, True)
    (note,) = json.loads((tmp_path / "out" / "run.json").read_text())["notes"]
    assert note.startswith(f"a ({fmu}) ")
    assert "while it was closed" in note
    assert note.endswith("The recording is complete.")
    assert note in capsys.readouterr().err


def test_rows_before_a_failure_are_kept_though_the_fmu_does_not_come_back_when_it_is_closed(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fmu = rude_fmu(folder, 2, "hang", "free")
    fails = {"deed": DEEDS.index("fail"), "stage": STAGES.index("step")}
    scenario = one(tmp_path / "late.toml", fmu, parameters=fails)
    assert call("run", scenario, "--out", tmp_path / "out", "--call-timeout", 0.5) == 2
    said = capsys.readouterr().err
    assert "a returned an error at tick 0 (0 s)" in said
    assert f"what was recorded until then is in {tmp_path / 'out' / 'recording.parquet'}" in said
    assert read_table(tmp_path / "out" / "recording.parquet").num_rows == 1


@pytest.mark.parametrize("option", ["--isolate", "--no-isolate"])
def test_an_fmu_that_leaves_a_thread_keeps_its_library(folder: Path, tmp_path: Path, option: str) -> None:
    fmu = rude_fmu(folder, 2, "thread", "initialise")
    scenario = one(tmp_path / "thread.toml", fmu)
    command = [sys.executable, "-m", "cosim", "run", str(scenario), "--out", str(tmp_path / "out"), option]
    done = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert f"a ({fmu.name}) left 1 thread running; its library stays loaded." in done.stderr
    assert len(Recording.read(tmp_path / "out" / "recording.parquet", required=())) == 3


def test_an_isolated_fmu_that_reads_its_standard_input_finds_nothing(folder: Path, tmp_path: Path) -> None:
    fmu = rude_fmu(folder, 2, "read", "step")
    scenario = one(tmp_path / "read.toml", fmu)
    assert call("run", scenario, "--out", tmp_path / "out", "--call-timeout", 5) == 0
    assert len(Recording.read(tmp_path / "out" / "recording.parquet", required=())) == 3


def test_a_function_that_changes_the_process_is_named_too(tmp_path: Path) -> None:
    (tmp_path / "moves.py").write_text("import os\ndef moves(t):\n    os.chdir('/')\n    return {'y': t}\n")
    moves = {"python": "moves.py:moves", "inputs": {}, "outputs": {"y": "s"}}
    (answer,) = probed(one(tmp_path / "function.toml", **moves))
    assert answer["changed"] == []
    assert "a (moves.py:moves) changed the working directory; restored." in answer["notes"]


@pytest.mark.parametrize("option", ["--isolate", "--no-isolate"])
def test_a_recording_lies_where_out_says_though_an_fmu_changes_the_working_directory(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, option: str
) -> None:
    for stage in ("setup", "step", "free"):
        fmu = rude_fmu(folder, 2, "directory", stage)
        one(tmp_path / "moves.toml", fmu)
        monkeypatch.chdir(tmp_path)
        assert call("run", "moves.toml", "--out", stage, option) == 0
        made = sorted(str(one.relative_to(tmp_path)) for one in (tmp_path / stage).iterdir())
        assert made == [f"{stage}/{name}" for name in ("recording.parquet", "run.html", "run.json")]


@pytest.mark.parametrize("through_python", [True, False])
def test_the_local_time_is_that_of_the_time_zone_that_is_put_back(through_python: bool) -> None:
    """C and Python keep what TZ said when they last looked; here it is a zone that no computer is in."""
    here, environment = time.timezone, Variables()
    before = environment.read()
    try:
        if through_python:
            os.environ["TZ"] = "ELSE+3:21"
        else:
            os.putenv("TZ", "ELSE+3:21")
        time.tzset()
        assert time.timezone == 3 * 3600 + 21 * 60
        environment.restore(before)
        assert time.timezone == here
        assert environment.read() == before
    finally:
        os.environ.pop("TZ", None)
        os.environ.update({"TZ": before[b"TZ"].decode()} if b"TZ" in before else {})
        time.tzset()


def test_what_another_thread_sets_in_the_environment_meanwhile_is_no_change_of_a_component(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("COSIM_TEST_GONE", "1")
    inside, changed, found = threading.Event(), threading.Event(), []

    def simulate() -> None:
        guard = Guard()
        with guard.kept():
            inside.set()
            changed.wait(10)
        found.extend(guard.notes())

    thread = threading.Thread(target=simulate)
    thread.start()
    assert inside.wait(10)
    monkeypatch.setenv("COSIM_TEST_NEW", "1")
    monkeypatch.delenv("COSIM_TEST_GONE")
    changed.set()
    thread.join(10)
    assert found == []
    assert os.environ["COSIM_TEST_NEW"] == "1"
    assert "COSIM_TEST_GONE" not in os.environ
