"""A sweep goes on where it was, however it was ended, and in a folder of its own only."""

import json
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pandas as pd
import pytest
from commands import ENVIRONMENT
from sweeps import SCENARIO, K, folder, run, written
from waiting import until

import cosim.support.cluster
from cosim.support.errors import OutputError, SweepError

__all__ = ["folder"]


def test_a_finished_or_killed_sweep_goes_on_where_it_was_and_with_failures_only_when_asked(folder: Path) -> None:
    path, journal = written(folder, (K, '"plant.k" = [-1.0, 1.0, 2.0]')), folder / "out" / "runs.jsonl"
    first, table = run(path)
    again, same = run(path)
    assert (first.done, again.done, again.found, again.failed) == (9, 0, 9, 3)
    pd.testing.assert_frame_equal(table, same)
    retried, _ = run(path, retry=True)
    assert (retried.done, retried.found, retried.failed) == (3, 6, 3)
    # What a kill leaves: the lines before, and one that was being written.
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join(lines[:5]) + lines[5][:20])
    first.table.unlink()
    rest, same = run(path)
    assert (rest.found, rest.done) == (5, 4)
    pd.testing.assert_frame_equal(table.drop(columns="seconds"), same.drop(columns="seconds"))


SPOILT: tuple[bytes | Callable[[bytes], bytes], ...] = (
    b"no row at all",
    b"[1, 2]",
    b'{"run": 1}',
    b'{"run": "1"}',
    b"[" * 100_000,
    b"\xff\x00",
    lambda line: line.replace(b'"status": "ok"', b'"status": 3'),
    lambda line: line.replace(b'"run": 2', b'"run": 9'),
    lambda line: line.replace(b'"run": 2', b'"run": true'),
    lambda line: line.replace(b'"plant.k"', b'"plant.j"'),
    lambda line: line.replace(b'"seconds": ', b'"seconds": "long", "was": '),
)


@pytest.fixture
def made(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A finished sweep; what is asked again is refused at its folder, before any process is started."""
    path = written(folder)
    run(path)
    monkeypatch.setattr("cosim_sweeps.conduct.warm", lambda _: None)
    monkeypatch.setattr("cosim_sweeps.conduct._units", lambda _: {"seconds": "s"})
    return path


def test_a_journal_that_another_hand_changed_is_a_sentence_and_stays_as_it_is(made: Path) -> None:
    journal = made.parent / "out" / "runs.jsonl"
    lines = sorted(journal.read_bytes().splitlines(), key=lambda line: json.loads(line)["run"])
    for spoilt in SPOILT:
        line = spoilt if isinstance(spoilt, bytes) else spoilt(lines[2])
        assert line != lines[2]
        journal.write_bytes(b"\n".join([*lines[:2], line, *lines[3:], b""]))
        before = journal.read_bytes()
        with pytest.raises(OutputError, match=r"runs.jsonl: line 3 is no row of a sweep; mend or remove that line"):
            run(made)
        assert journal.read_bytes() == before, line[:80]
    journal.write_bytes(b"\n".join([*lines[:2], *lines[3:], b""]))
    again, _ = run(made)
    assert (again.done, again.found) == (1, 8)


def test_an_identity_that_is_no_json_is_a_sentence(made: Path) -> None:
    for spoilt in (b"", b"{", b"[]", b"\xff", b"[" * 100_000):
        (made.parent / "out" / "sweep.json").write_bytes(spoilt)
        with pytest.raises(OutputError, match=r"sweep.json is damaged: it is no JSON; give another --out, or --force"):
            run(made)


@pytest.fixture
def started(folder: Path) -> Iterator[Callable[[], "subprocess.Popen[str]"]]:
    """Start a sweep that takes long."""
    written(folder, (K, '"plant.k" = { low = 1.0, high = 9.0, count = 100000 }'))
    command = [sys.executable, "-m", "cosim", "sweep", "sweep.toml", "--out", "out", "--workers", "2"]
    processes = []

    def start() -> "subprocess.Popen[str]":
        process = subprocess.Popen(command, env=ENVIRONMENT, cwd=folder, stderr=subprocess.PIPE, text=True)
        processes.append(process)
        return process

    yield start
    for process in processes:
        if process.poll() is None:
            process.kill()
            process.communicate()


def children(process: "subprocess.Popen[str]") -> list[int]:
    found = Path(f"/proc/{process.pid}/task").glob("*/children")
    return [int(one) for path in found for one in path.read_text().split()]


def wait_for(path: Path, lines: int) -> None:
    until(lambda: path.exists() and path.read_bytes().count(b"\n") >= lines)


def wait_for_the_end(pids: list[int]) -> None:
    until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in pids), 10)


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="it looks for processes as Linux shows them")
def test_kill_9_and_ctrl_c_lose_nothing_that_was_done(
    folder: Path, started: Callable[[], "subprocess.Popen[str]"]
) -> None:
    process, journal = started(), folder / "out" / "runs.jsonl"
    wait_for(journal, 5)
    with pytest.raises(OutputError, match=r"Another sweep is writing to .*out; wait for it, or end it"):
        run(folder / "sweep.toml")
    workers = children(process)
    process.kill()
    process.communicate()
    assert len(workers) == 2
    wait_for_the_end(workers)  # they see their parent's end
    before = journal.read_bytes().count(b"\n")
    process = started()
    wait_for(journal, before + 5)
    workers = children(process)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert said.endswith("the same command goes on from there\ncosim: interrupted\n")
    assert "Traceback" not in said
    wait_for_the_end(workers)
    table = pd.read_parquet(folder / "out" / "table.parquet")
    assert table["run"].is_unique
    assert len(table) >= before + 5
    assert set(table["status"]) == {"ok"}


@pytest.mark.parametrize(
    ("file", "change", "named"),
    [
        ("sweep.toml", lambda text: text.replace(b"low = 0.5", b"low = 0.6"), "sweep file"),
        ("loop.toml", lambda text: text + b"decimation = 2\n", "scenario"),
        ("tiny.fmu", lambda text: text + b"more", "file of components.plant"),
    ],
)
def test_a_folder_of_another_sweep_is_refused(
    folder: Path, tiny: dict[int, Path], file: str, change: Callable[[bytes], bytes], named: str
) -> None:
    shutil.copy(tiny[3], folder / "tiny.fmu")
    (folder / "loop.toml").write_text(SCENARIO.replace("{fmu}", "tiny.fmu"))
    run(folder / "sweep.toml")
    (folder / file).write_bytes(change((folder / file).read_bytes()))
    rule = f"out holds another sweep: its {named} changed since; give another --out, or --force to start over."
    with pytest.raises(OutputError, match=re.escape(rule)):
        run(folder / "sweep.toml")
    assert run(folder / "sweep.toml", force=True)[0].done == 9


def test_force_removes_what_a_sweep_made_and_nothing_else(folder: Path) -> None:
    (folder / "out").mkdir()
    (folder / "out" / "notes.txt").write_text("mine")
    run(written(folder, ("[vary]", "record = true\n[vary]")))
    assert len(list((folder / "out" / "recordings").iterdir())) == 9
    run(written(folder), force=True)
    assert not (folder / "out" / "recordings").exists()
    assert (folder / "out" / "notes.txt").read_text() == "mine"
    (folder / "out" / "sweep.json").unlink()
    with pytest.raises(OutputError, match="exists already; give --force"):
        run(folder / "sweep.toml")


def test_a_cluster_gives_the_same_table_and_survives_a_crash(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip("distributed")
    scenario = (folder / "loop.toml").read_text()
    (folder / "loop.toml").write_text(scenario.replace("[signals.r]", "parameters = { status = 11 }\n[signals.r]"))
    path = written(folder, (K, '"plant.fail_at" = [1e9, 0.3]'))
    _, here = run(path)
    monkeypatch.setenv("MOUNT_COSIM_CACHE", str(folder / "cache"))
    settings = {"n_workers": 1, "threads_per_worker": 2, "processes": False, "dashboard_address": None}
    with distributed.LocalCluster(**settings) as cluster:
        _, there = run(path, force=True, address=cluster.scheduler_address, workers=None)
    pd.testing.assert_frame_equal(here.drop(columns="seconds"), there.drop(columns="seconds"))
    assert there["status"].tolist() == ["ok"] * 3 + ["crashed"] * 3


def test_a_cluster_that_is_not_there_is_one_sentence(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr(cosim.support.cluster, "PATIENCE", 0.5)
    with pytest.raises(SweepError, match=r"No Dask scheduler answers at tcp://127.0.0.1:9; give its address as"):
        run(folder / "sweep.toml", address="tcp://127.0.0.1:9", workers=None)
    with pytest.raises(SweepError, match=r"record = true keeps files on this machine; it does not go with --cluster"):
        run(written(folder, ("[vary]", "record = true\n[vary]")), address="tcp://127.0.0.1:9", workers=None)
