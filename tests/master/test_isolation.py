"""A component that crashes, ends its process or never returns costs one sentence, and leaves nothing behind."""

import os
import pickle
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path
from typing import Any

import pytest
from commands import ENVIRONMENT, call
from mortal import marked

from cosim.data.recording import Recording
from cosim.master.isolated import run_isolated
from cosim.master.simulate import Options
from cosim.support.activity import SIZE
from cosim.support.errors import LostComponentError, OutputError
from cosim.support.files import replacing
from cosim.support.lock import claimed
from cosim.support.scratch import PREFIX
from cosim.system.scenario import read_scenario

FUNCTION = """
[components.odd]
python = "odd.py:odd"
inputs = { q = "rad" }
outputs = { seen = "rad" }
"""
ENDS = {
    signal.SIGINT: (130, "cosim: interrupted\n"),
    signal.SIGTERM: (143, "cosim: terminated\n"),
    signal.SIGKILL: (-9, ""),
}
"""Exit code and last word of a run that a signal ends."""
linux = pytest.mark.skipif(sys.platform != "linux", reason="signals and sessions as Linux has them")


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder for temporary files, for this test alone."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return folder


def written(scenario: Path, parameters: str, *more: str) -> Path:
    scenario.write_text(scenario.read_text().replace("k = 5.0", f"k = 5.0, {parameters}") + "".join(more))
    return scenario


def left(folder: Path) -> list[str]:
    return sorted(str(one.relative_to(folder)) for one in folder.rglob("*"))


@linux
@pytest.mark.parametrize(
    ("status", "sentence"),
    [
        (11, "crashed: SIGSEGV, segmentation fault, while it was stepped at tick 300 (0.3 s);"),
        (14, "ended its process with exit code 0 while it was stepped at tick 300 (0.3 s);"),
        (15, "crashed: SIGABRT, abort, while it was stepped at tick 300 (0.3 s);"),
        (12, "did not return within 0.5 s while it was stepped at tick 300 (0.3 s);"),
    ],
)
@pytest.mark.parametrize("loop", [[], ["--interpreted"]])
def test_an_fmu_that_ends_its_process_costs_a_sentence_and_leaves_nothing(
    scenario: Path, temporary: Path, capsys: pytest.CaptureFixture[str], status: int, sentence: str, loop: list[str]
) -> None:
    written(scenario, f"fail_at = 0.3, status = {status}")
    out = scenario.with_name("out")
    assert call("run", scenario, "--out", out, "--call-timeout", 0.5, *loop) == 2
    said = capsys.readouterr()
    assert said.out == ""
    last = said.err.splitlines()[-1]
    assert last.startswith("cosim: controller (")
    assert sentence in last
    assert last.endswith("Nothing was recorded.")
    assert left(temporary) == []
    assert not out.exists()


def command_of(scenario: Path, out: Path) -> list[str]:
    return [sys.executable, "-m", "cosim", "run", str(scenario), "--out", str(out)]


@linux
def test_what_an_fmu_started_ends_with_it(scenario: Path, tmp_path: Path) -> None:
    written(scenario, "fail_at = 0.3, status = 16")
    given = ENVIRONMENT | {"PYTHONPATH": f"{ENVIRONMENT['PYTHONPATH']}:{tmp_path}"}
    done = subprocess.run(command_of(scenario, tmp_path / "out"), env=given, capture_output=True, check=False)
    assert b"ended its process with exit code 3" in done.stderr
    assert marked(tmp_path) == []


@linux
def test_a_library_that_is_cut_short_is_named(
    scenario: Path, tiny: dict[int, Path], temporary: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cut = tmp_path / "cut.fmu"
    with zipfile.ZipFile(tiny[2]) as good, zipfile.ZipFile(cut, "w") as bad:
        for name in good.namelist():
            content = good.read(name)
            bad.writestr(name, content[: len(content) // 3] if name.startswith("binaries") else content)
    scenario.write_text(scenario.read_text().replace(str(tiny[2]), str(cut), 1))
    assert call("run", scenario, "--out", tmp_path / "out") == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert re.search(r"cut\.fmu\) crashed: SIG|cut\.fmu cannot be instantiated: ", last)
    assert left(temporary) == []


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("def odd(t, q): raise SystemExit(0)", 'odd returned an error at tick 0 (0 s); it said "SystemExit: 0"'),
        ("def odd(t, q): raise KeyboardInterrupt", "KeyboardInterrupt"),
        ("import os\ndef odd(t, q): os._exit(0)", "ended its process with exit code 0 while it was stepped at tick 0"),
        ("import os\nos._exit(0)", "odd.py ended its process with exit code 0 while it was loaded;"),
        ("import sys\nsys.exit(0)", "the file cannot be run: SystemExit: 0."),
        ("def odd(t, q):\n  while True: pass", "odd.py:odd) did not return within 0.5 s while it was stepped"),
        ("while True: pass", "odd.py did not return within 0.5 s while it was loaded;"),
        ("class odd:\n  def __init__(self): raise OSError('no')", "odd cannot be made: OSError: no."),
        ("class odd:\n  def __init__(self): raise SystemExit", "odd cannot be made: SystemExit: SystemExit."),
    ],
)
def test_a_function_that_ends_its_process_costs_a_sentence(
    scenario: Path, temporary: Path, capsys: pytest.CaptureFixture[str], text: str, sentence: str
) -> None:
    scenario.with_name("odd.py").write_text(text + "\n")
    written(scenario, "nan_at = 1e9", FUNCTION)
    assert call("run", scenario, "--out", scenario.with_name("out"), "--call-timeout", 0.5) == 2
    assert sentence in capsys.readouterr().err.splitlines()[-1]
    assert left(temporary) == []
    assert "run.json" not in left(scenario.parent)


@pytest.mark.parametrize(("parameters", "code", "rows"), [("nan_at = 1e9", 0, 250), ("fail_at = 0.3", 2, 151)])
def test_isolated_or_not_the_rows_and_the_sentences_are_the_same(
    scenario: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], parameters: str, code: int, rows: int
) -> None:
    written(scenario, parameters)
    found, said = [], []
    for name in ("isolate", "no-isolate"):
        assert call("run", scenario, "--out", tmp_path / name, f"--{name}", "--no-page") == code
        said.append([one for one in capsys.readouterr().err.splitlines() if one.startswith("cosim: ")])
        found.append(Recording.read(tmp_path / name / "recording.parquet", required=()))
    one, other = found
    assert len(one) == len(other) == rows
    assert all((one[name] == other[name]).all() for name in one)
    assert one.origin["complete"] is (code == 0)
    assert said[0] == said[1]


@linux
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
@pytest.mark.parametrize("hang", [False, True])
def test_a_signal_ends_both_processes_and_leaves_nothing_half_written(
    scenario: Path, temporary: Path, tmp_path: Path, number: int, hang: bool
) -> None:
    written(scenario, "fail_at = 0.3, status = 12" if hang else "nan_at = 1e9")
    scenario.write_text(scenario.read_text().replace("stop = 0.5", "stop = 3e4"))
    environment = ENVIRONMENT | {"TMPDIR": str(temporary)}
    command = command_of(scenario, tmp_path / "out")
    process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 30
    while time.monotonic() < until and not list((tmp_path / "out").glob(".*.partial")):
        time.sleep(0.02)
    time.sleep(0.3)
    process.send_signal(number)
    _, said = process.communicate(timeout=20)
    code, word = ENDS[number]
    assert process.returncode == code
    assert said.endswith(word)
    assert "Traceback" not in said
    until = time.monotonic() + 10
    while time.monotonic() < until and marked(temporary):
        time.sleep(0.05)
    assert marked(temporary) == []
    assert left(temporary) == []
    files = [name for name in left(tmp_path / "out") if name != ".cosim.lock"]
    assert files == ["recording.parquet"] or (hang and files == [])  # a late computer interrupts before it hangs
    if files and number != signal.SIGKILL:
        assert Recording.read(tmp_path / "out" / files[0], required=()).origin["complete"] is False


@linux
def test_the_second_of_two_runs_into_one_folder_is_refused_while_the_first_lives(
    scenario: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    long = tmp_path / "long.toml"
    long.write_text(scenario.read_text().replace("stop = 0.5", "stop = 3e4"))
    first = subprocess.Popen(command_of(long, tmp_path / "out"), env=ENVIRONMENT, stderr=subprocess.DEVNULL)
    until = time.monotonic() + 120
    while time.monotonic() < until and first.poll() is None and not list((tmp_path / "out").glob(".*.partial")):
        time.sleep(0.02)
    assert first.poll() is None, "the first run ended before the second began"
    for force in ((), ("--force",)):
        assert call("run", scenario, "--out", tmp_path / "out", *force) == 2
        sentence = f"Another run is writing to {tmp_path / 'out'}; wait for it, end it, or give another --out."
        assert sentence in capsys.readouterr().err
    first.terminate()
    assert first.wait(20) == 143
    assert call("run", scenario, "--out", tmp_path / "out") == 2
    assert "exists already" in capsys.readouterr().err
    assert call("run", scenario, "--out", tmp_path / "out", "--force") == 0
    assert left(tmp_path / "out") == ["recording.parquet", "run.html", "run.json"]


def test_a_file_that_came_into_being_meanwhile_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "card.toml"

    def write() -> None:
        with replacing(path) as partial:
            partial.write_text("ours")
            path.write_text("theirs")

    with pytest.raises(OutputError, match="exists already"):
        write()
    assert path.read_text() == "theirs"
    assert left(tmp_path) == ["card.toml"]


def test_a_program_of_its_own_can_run_isolated_too(scenario: Path, tmp_path: Path) -> None:
    assert len(run_isolated(read_scenario(scenario), Options(tmp_path / "a.parquet")).recording) == 250
    written(scenario, "fail_at = 0.1, status = 14")
    with pytest.raises(LostComponentError) as lost:
        run_isolated(read_scenario(scenario), Options(tmp_path / "b.parquet"))
    assert (lost.value.component, "code 0" in lost.value.reason) == ("controller", True)


# A process whose parent, folder or lock is gone ends without a trace, and what a killed one left goes.


@linux
def test_what_a_killed_process_left_half_written_goes_with_the_next_run(tmp_path: Path) -> None:
    ended = subprocess.Popen([sys.executable, "-c", "pass"])
    ended.wait()
    for name in (f".a.parquet.{ended.pid}.partial", f".a.parquet.{os.getpid()}.partial", ".x.partial"):
        (tmp_path / name).touch()
    with claimed(tmp_path, "run"):
        pass
    assert left(tmp_path) == [f".a.parquet.{os.getpid()}.partial", ".x.partial"]


def test_a_lock_survives_the_file_being_removed(tmp_path: Path) -> None:
    with claimed(tmp_path / "out", "run"):
        with pytest.raises(OutputError, match="Another run is writing"), claimed(tmp_path / "out", "run"):
            pass
        shutil.rmtree(tmp_path / "out")
    with claimed(tmp_path / "out", "run"):
        assert left(tmp_path) == ["out", "out/.cosim.lock"]
    assert left(tmp_path) == []


def child(board: Path, parent: int, call: bytes | None = None) -> "subprocess.Popen[bytes]":
    """Start a process for work whose parent has a number; without a call its input stays open."""
    command = [sys.executable, "-m", "cosim.support.child", str(board), str(parent)]
    pipes: dict[str, Any] = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    process = subprocess.Popen(command, env=ENVIRONMENT, start_new_session=True, **pipes)
    assert process.stdin is not None
    if call is not None:
        process.stdin.write(call)
        process.stdin.flush()
    return process


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """A folder with a board, as a parent makes it for its child."""
    folder = tmp_path / f"{PREFIX}own"
    folder.mkdir()
    (folder / "board").write_bytes(bytes(SIZE))
    return folder


@linux
@pytest.mark.parametrize("call", [b"", b"\x80\x05\x95\xff\xff", pickle.dumps((print, ("heard",)))[:-5]])
@pytest.mark.parametrize("orphan", [False, True])
def test_a_process_whose_parent_is_gone_in_the_middle_of_a_call_ends_without_a_trace(
    own: Path, call: bytes, orphan: bool
) -> None:
    """An orphan's parent ended before its child had begun."""
    assert child(own / "board", 1 if orphan else os.getpid(), call).communicate(timeout=60)[1] == b""
    assert not own.exists()


@linux
def test_a_process_whose_parent_was_gone_before_it_began_does_not_work_on(own: Path) -> None:
    with child(own / "board", 1, pickle.dumps((time.sleep, (600.0,)))) as process:
        process.wait(60)
    assert not own.exists()


def test_a_process_whose_folder_is_gone_before_it_is_ready_ends_without_a_word(tmp_path: Path) -> None:
    """Ctrl-C may come so early that the parent has tidied up when its process looks for what they share."""
    process = child(tmp_path / "gone" / "activity", os.getpid())
    assert process.communicate(timeout=60) == (b"", b"")
    assert process.returncode == 0
