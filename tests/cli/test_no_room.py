"""A disk that is full, a folder that cannot be written, a long name, a system without letters: a sentence each."""

import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
from commands import ENVIRONMENT, Refused, cache
from on_hardware import SCENARIO

from cosim.data.recording import Recording
from cosim.support.cell import Cell
from cosim.support.system_errors import surroundings

__all__ = ["cache"]

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits and folders of Linux")
LONG = "x" * 300


@contextmanager
def room(size: int) -> Iterator[None]:
    """No file may be longer, as if the disk were full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def sentence(said: str) -> str:
    (one,) = [line for line in said.splitlines() if line.startswith("cosim: ")]
    return one


def left(folder: Path) -> list[str]:
    return sorted(str(one.relative_to(folder)) for one in folder.rglob("*") if one.is_file())


@pytest.mark.parametrize("isolate", ["--isolate", "--no-isolate"])
def test_a_run_without_room_for_its_recording_leaves_nothing(scenario: Path, refused: Refused, isolate: str) -> None:
    scenario.write_text(scenario.read_text().replace("stop = 0.5", "stop = 50.0"))
    with room(70_000):  # more than the board of a process, less than the recording
        assert "file too large" in sentence(refused("run", scenario, "--out", "out", isolate)).lower()
    assert left(Path()) == ["loop.toml"]


def test_a_run_without_room_for_temporary_files_says_so(scenario: Path, refused: Refused, monkeypatch: Any) -> None:
    Path("tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", "tmp")
    with room(10_000):
        assert "file too large" in sentence(refused("run", scenario, "--out", "out")).lower()
    assert left(Path()) == ["loop.toml"]
    monkeypatch.setattr(tempfile, "tempdir", "nowhere")
    assert "no such file or directory" in sentence(refused("run", scenario, "--out", "out"))


def test_no_machine_without_room_for_its_black_box_starts(tmp_path: Path, refused: Refused, monkeypatch: Any) -> None:
    monkeypatch.undo()  # the FMUs of the usual cache
    (tmp_path / "s.toml").write_text(SCENARIO)
    with room(1_000_000):
        said = refused("hardware", "run", tmp_path / "s.toml", "--fast", "--out", tmp_path / "out")
    assert "file too large" in sentence(said).lower()
    assert left(tmp_path) == ["s.toml"]


@pytest.mark.parametrize("out", [f"/tmp/{LONG}", "/sys/cosim/out", "/dev/null/out", "/proc/self/cosim"])
@pytest.mark.parametrize("verb", ["run", "export"])
def test_a_place_that_cannot_be_is_one_sentence(scenario: Path, refused: Refused, verb: str, out: str) -> None:
    what = {"run": scenario, "export": "paper_mount"}[verb]
    assert out[:20] in sentence(refused(verb, what, "--out", out))


@pytest.mark.parametrize(
    "command",
    [
        ("run", LONG, "--out", "out"),
        ("run", f"{LONG}.toml", "--out", "out"),
        ("show", LONG),
        ("show", f"{LONG}.csv"),
        ("show", f"{LONG}.fmu"),
        ("show", f"{LONG}.ssp"),
        ("show", f"{LONG}.toml"),
        ("export", f"{LONG}.toml", "--out", "out"),
        ("identify", f"{LONG}.csv", "--card", "paper_mount", "--out", "out"),
        ("diagnose", f"{LONG}.csv", "--heldout", f"{LONG}.csv", "--card", "paper_mount", "--out", "out"),
        ("sweep", f"{LONG}.toml", "--out", "out"),
        ("hardware", "replay", f"{LONG}.parquet"),
        ("hardware", "run", f"{LONG}.toml", "--out", "out"),
        ("hardware", "check", "sidereal", "--machine", f"{LONG}.toml"),
        ("hardware", "virtual-drive", "paper_mount", "--port", "0", "--key", LONG),
        ("hardware", "virtual-drive", LONG),
    ],
    ids=lambda command: " ".join(one[:9] for one in command),
)
def test_a_name_that_is_too_long_is_one_sentence(command: tuple[str, ...], refused: Refused) -> None:
    assert len(sentence(refused(*command))) < 1500
    assert left(Path()) == []


@pytest.mark.parametrize(
    "command",
    [
        ("demo", "--out", ""),
        ("export", "paper_mount", "-o", ""),
        ("run", "sidereal", "--out="),
        ("run", "sidereal", "--force", "--out", " \t"),
        ("sweep", "", "--out", "out"),
        ("show", ""),
        ("prove", "--out", "out", "--decks", ""),
        ("diagnose", "a.csv", "--heldout", "b.csv", "--card", "paper_mount", "--out", "out", "--propose", ""),
        ("hardware", "run", "two_axis", "--out", ""),
    ],
    ids=" ".join,
)
def test_an_empty_name_is_not_the_folder_that_one_stands_in(command: tuple[str, ...], refused: Refused) -> None:
    place = next(k for k, one in enumerate(command) if not one.rpartition("=")[2].strip())
    name = "--out" if command[place] == "--out=" else command[place - 1]
    assert sentence(refused(*command)).startswith(f'cosim: {name} "')
    assert list(Path().iterdir()) == []


def in_c(*arguments: object) -> "subprocess.CompletedProcess[bytes]":
    """Call the command where the system's language has ASCII alone."""
    environment = ENVIRONMENT | {"LC_ALL": "C", "PYTHONUTF8": "0"}
    command = [sys.executable, "-m", "cosim", *map(str, arguments)]
    return subprocess.run(command, env=environment, capture_output=True, check=False)


def test_where_the_language_has_ascii_alone_everything_is_read_and_shown(tmp_path: Path) -> None:
    card = tmp_path / "Höhe.toml"
    card.write_text('[mount]\nname = "Höhe −90°"\ninertia = 3.0\n[friction]\nmodel = "none"\n', "utf-8")
    shown = in_c("show", card)
    assert (shown.returncode, shown.stderr) == (0, b"")
    assert b"H\\xf6he \\u221290\\xb0" in shown.stdout
    asked = in_c("show", card, "--json")
    assert json.loads(asked.stdout)["name"] == "Höhe −90°"
    refused = in_c("show", tmp_path / "größer.csv")
    assert refused.returncode == 2
    assert refused.stderr.startswith(b"cosim: ")
    assert "größer.csv".encode() in refused.stderr, "the file's own name, byte for byte"


@pytest.mark.parametrize(
    ("closed", "shown", "code", "said"),
    [
        (">/dev/full", "paper_mount", 2, "cosim: no space left on device.\n"),
        (">&-", "paper_mount", 2, "cosim: bad file descriptor.\n"),
        ("<&-", "paper_mount", 0, ""),
        ("2>&-", "paper_mount", 0, ""),
        ("2>&-", "nothing", 2, ""),
        ("<&- >&- 2>&-", "nothing", 2, ""),
    ],
)
def test_a_standard_file_that_is_closed_or_full_is_no_traceback(closed: str, shown: str, code: int, said: str) -> None:
    shell = ["sh", "-c", f'exec "$@" {closed}', "sh", sys.executable, "-m", "cosim", "show", shown]
    done = subprocess.run(shell, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (code, said)
    assert bool(done.stdout) == (code == 0)


def test_a_run_whose_standard_files_are_closed_records_whole(scenario: Path) -> None:
    command = [sys.executable, "-m", "cosim", "run", str(scenario), "--out", "out"]
    shell = ["sh", "-c", 'exec "$@" <&- 2>&-', "sh", *command]
    assert subprocess.run(shell, env=ENVIRONMENT, check=False, capture_output=True).returncode == 0
    assert len(Recording.read("out/recording.parquet")) == 250


def test_what_the_system_refuses_is_a_sentence_with_its_culprit() -> None:
    assert surroundings(OSError(28, "No space left on device", "a.txt")) == "a.txt: no space left on device."
    assert surroundings(OSError("Detail: [errno 28] full")) == "detail: [errno 28] full."
    assert surroundings(MemoryError()) == "There is not enough memory for this."
    assert len(surroundings(OSError(36, "File name too long", "x" * 9999))) < 400


def test_an_error_of_the_system_in_a_process_of_its_own_reaches_who_called() -> None:
    with closing(Cell()) as cell, pytest.raises(FileNotFoundError, match="nowhere"):
        cell.call(os.stat, "/nowhere")
