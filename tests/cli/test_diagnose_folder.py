"""A folder of machines: paired by name, gone on with after a kill, on a cluster too, and from Python."""

import json
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from commands import ENVIRONMENT, Refused, call
from mortal import marked, mortal
from waiting import until

import cosim
from cosim.api.machine_work import Options, Order
from cosim.api.machines import JOURNAL, MachineResult, machines_in
from cosim.support.errors import InputError, SweepError

LEVELS = {"north": 2.0, "south": 3.0}


def write(path: Path, level: float, seed: int) -> None:
    t = np.arange(1600) / 200
    q = 0.4 * np.sin(2 * t + seed) + 0.1 * np.sin(5 * t)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    tau = 3.0 * a + level * np.sign(v) + v + 0.02 * np.random.default_rng(seed).standard_normal(len(t))
    pd.DataFrame({"t": t, "tau": tau, "q": q}).to_csv(path, index=False)


@pytest.fixture
def fleet(tmp_path: Path) -> Path:
    (tmp_path / "all").mkdir()
    for machine, level in LEVELS.items():
        for run in (1, 2):
            write(tmp_path / "all" / f"{machine}_{run}.csv", level, run)
    return tmp_path


def test_a_folder_of_machines_is_diagnosed_line_by_line_and_gone_on_with(fleet: Path, capsys: Any) -> None:
    arguments = ("diagnose", "all", "--out", "found", "--quick", "--json", "--workers", "2")
    assert call(*arguments) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert sorted(one["machine"] for one in lines) == sorted(LEVELS)
    assert all(one["after_rms"] <= one["before_rms"] < 0.1 for one in lines)
    kept = (fleet / "found" / "south" / "diagnosis.json").stat().st_mtime_ns
    (fleet / "found" / "north" / "diagnosis.json").unlink()
    write(fleet / "all" / "north_1.csv", 2.0, 1)
    (fleet / "all" / "north_2.csv").write_text("t,tau,q\n1,2,3\n", "utf-8")
    assert call(*arguments) == 0
    again = {one["machine"]: one for one in map(json.loads, capsys.readouterr().out.splitlines())}
    assert (fleet / "found" / "south" / "diagnosis.json").stat().st_mtime_ns == kept
    assert "north_2.csv" in again["north"]["error"]
    assert call("diagnose", "all", "--heldout", "all/north_1.csv", "--out", "x") == 2
    assert "holds several: north, south" in capsys.readouterr().err


def test_what_was_done_before_a_kill_is_not_done_again(fleet: Path, monkeypatch: Any, capsys: Any) -> None:
    """Also where no folder for results is named."""
    monkeypatch.setenv("COSIM_OUT", "")
    words, out = ["diagnose", "all", "--quick", "--json", "--workers", "1"], fleet / "cosim_out" / "all-1"
    command = mortal(sys.executable, "-m", "cosim", *words)
    given = ENVIRONMENT | {"COSIM_OUT": "", "COSIM_MARK": str(fleet)}
    process = subprocess.Popen(command, env=given, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    first = json.loads(process.stdout.readline())["machine"]
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    until(lambda: not marked(f"COSIM_MARK={fleet}"), 30)  # no process of a machine outlives the kill
    kept = (out / first / "diagnosis.json").stat().st_mtime_ns
    with (out / "machines.jsonl").open("a") as journal:
        journal.write('{"machine": "sou')  # what a kill leaves half written
    assert call(*words) == 0
    said = capsys.readouterr()
    told = {one["machine"]: one for one in map(json.loads, said.out.splitlines())}
    assert "where they were begun" in said.err
    assert sorted(told) == sorted(LEVELS)
    assert not any("error" in one for one in told.values())
    assert (out / first / "diagnosis.json").stat().st_mtime_ns == kept
    before = {path: path.stat().st_mtime_ns for path in out.rglob("diagnosis.json")}
    assert call(*words) == 0
    assert before == {path: path.stat().st_mtime_ns for path in before}
    assert [one.name for one in out.parent.iterdir()] == ["all-1"]


def test_the_key_of_an_answer_changes_with_files_card_and_options(fleet: Path) -> None:
    (machine, _) = machines_in(fleet / "all")
    order = Order(machine, "", fleet / "out", Options())
    others = [
        replace(order, card="paper_mount"),
        replace(order, options=Options(quick=True)),
        replace(order, options=Options(columns=("tau=force",))),
        replace(order, machine=replace(machine, train=machine.train[:1], heldout=machine.train[1:])),
    ]
    keys = {one.key() for one in (order, *others)}
    write(fleet / "all" / "north_2.csv", 2.5, 1)
    assert len(keys | {order.key()}) == len(others) + 2
    assert replace(order, out=fleet / "elsewhere").key() == order.key()


def test_a_cluster_gives_the_same_answers(fleet: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip("distributed")
    (fleet / "all" / "south_2.csv").write_text("t,tau,q\n1,2,3\n", "utf-8")
    here = cosim.diagnose_folder("all", "here", quick=True)
    assert [one.earlier for one in here.machines] == [False] * 2
    assert here.frame()["machine"].tolist() == [one.name for one in here.machines]
    assert "2 machines" in repr(here)
    settings = {"n_workers": 1, "threads_per_worker": 2, "processes": False, "dashboard_address": None}
    with distributed.LocalCluster(**settings) as cluster:
        there = cosim.diagnose_folder("all", "there", quick=True, cluster=cluster.scheduler_address)
    assert there.missing == here.missing
    assert there.errors == here.errors
    assert "all/south_2.csv" in there.errors["south"]
    for name in there.missing:
        one, other = (fleet / where / name for where in ("here", "there"))
        assert sorted(path.name for path in one.iterdir()) == sorted(path.name for path in other.iterdir())
        held = [json.loads((folder / "diagnosis.json").read_text())["heldout"] for folder in (one, other)]
        assert held[0] == held[1]


def test_wrong_use_is_one_sentence(fleet: Path, refused: Refused) -> None:
    with pytest.raises(SweepError, match="is no address of a Dask scheduler"):
        cosim.diagnose_folder("all", "found", cluster="nowhere")
    with pytest.raises(InputError, match="no-such cannot be listed"):
        cosim.diagnose_folder("no-such", "found")
    (fleet / "empty").mkdir()
    with pytest.raises(InputError, match="empty holds no recordings of several machines"):
        cosim.diagnose_folder("empty", "found")
    said = refused("diagnose", "all/north_1.csv", "all/north_2.csv", "--cluster", "tcp://h:1", "--out", "x")
    assert "--cluster is for a folder of several machines" in said


def test_results_among_the_recordings_are_no_machine(fleet: Path) -> None:
    (fleet / "all" / "found").mkdir()
    (fleet / "all" / "found" / JOURNAL).touch()
    write(fleet / "all" / "found" / "run.csv", 1.0, 1)
    assert [one.name for one in machines_in(fleet / "all")] == sorted(LEVELS)


@pytest.mark.parametrize(("verdict", "said"), [([], "nothing missing"), (["backlash", "delay"], "backlash, delay")])
def test_the_line_of_a_machine_names_what_is_missing(verdict: list[str], said: str) -> None:
    errors = {"before_rms": 2.0, "after_rms": 1.0, "floor_rms": 0.9}
    one = MachineResult("north", Path("out"), {"heldout": errors, "verdict": verdict})
    assert str(one) == f"north: {said}; validation RMS 2 -> 1 (noise 0.9); out"
    assert not one.earlier
