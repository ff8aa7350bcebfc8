"""The loop that asks the machine: it decides, it keeps to its limits, and a kill loses nothing."""

import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from shlex import split

import numpy as np
import pytest
from commands import call
from investigations import CABLE, LIMITS, STIFFENING, written

from cosim.data.recording import Recording
from cosim.support.errors import InputError, OutputError
from cosim.system.scenario import read_scenario
from cosim_investigation.design import torque_predicted
from cosim_investigation.investigate import investigate
from cosim_investigation.machine import CoSimulated
from cosim_investigation.motions import Motion
from cosim_investigation.page import write_page
from cosim_investigation.rounds import Rounds
from cosim_investigation.story import Answered, Moved, Story
from cosim_investigation.verb import seconds_of
from pyfmi_models.card import read_card


def test_one_answer_needs_no_further_motion(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scenario, card, machine = written(tmp_path, STIFFENING)
    words = ["investigate", scenario, "--card", card, "--machine", machine, "--out", str(tmp_path / "out")]
    assert call(*words, "--seconds", "10", "--budget", "1min", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["verdict"] == ["cable_wrap"]
    assert told["ended"] == "answered"
    assert told["further_motion_seconds"] == 0
    page = (tmp_path / "out" / "story.html").read_text("utf-8")
    assert "Cable wrap" in page
    assert "<script" not in page


def test_a_wrong_first_name_is_put_right_by_motion_and_a_kill_loses_nothing(tmp_path, monkeypatch) -> None:
    """Over a small part of a turn a cable is the same as a weight, until the axis goes further."""
    given, out = written(tmp_path, CABLE), tmp_path / "out"
    asked = {"machine": given[2], "budget": 42.5, "seconds": 10.0, "limits": LIMITS}
    record = CoSimulated.record

    def killed(self: CoSimulated, motion: object, number: int, path: Path) -> object:
        if number == 4:
            raise KeyboardInterrupt
        return record(self, motion, number, path)  # type: ignore[arg-type]

    monkeypatch.setattr(CoSimulated, "record", killed)
    with pytest.raises(KeyboardInterrupt):
        investigate(*given[:2], out, **asked)  # type: ignore[arg-type]
    kept = {path.name: path.read_bytes() for path in (out / "recordings").iterdir()}
    assert len(kept) == 3
    monkeypatch.setattr(CoSimulated, "record", record)
    done = investigate(*given[:2], out, **asked)  # type: ignore[arg-type]
    assert {name: (out / "recordings" / name).read_bytes() for name in kept} == kept
    assert done.story.first.verdict != ("cable_wrap",)
    assert done.missing == ("cable_wrap",)
    assert done.story.seconds <= 42.5
    again = investigate(*given[:2], out, **asked)  # type: ignore[arg-type]
    assert [one.number for one in again.story.steps] == [one.number for one in done.story.steps]
    planned = [one for one in done.story.steps if isinstance(one, Moved)][2:]
    assert planned
    assert all(one.random_nats is not None and one.random_nats <= one.nats for one in planned)
    assert all(one.random_ground is not None and one.random_ground < one.ground for one in planned)
    page = (out / "story.html").read_text("utf-8")
    assert f"{planned[0].nats:.1f} nats" in page
    assert f"{planned[0].random_nats:.1f} nats" in page
    sought = tuple(replace(one, nats=0.0) if one in planned else one for one in done.story.steps)
    page = write_page(tmp_path / "sought.html", replace(done.story, steps=sought), out, "").read_text("utf-8")
    assert f"{planned[0].ground:.0%} new ground" in page
    assert f"{planned[0].random_ground:.0%}" in page


def test_a_folder_of_another_investigation_is_refused(tmp_path: Path) -> None:
    given, out = written(tmp_path, CABLE), tmp_path / "out"
    out.mkdir()
    (out / "investigation.json").write_text('{"card": "another"}', "utf-8")
    with pytest.raises(OutputError, match="another investigation"):
        investigate(*given[:2], out)


def test_a_machine_that_leaves_a_limit_is_not_moved_again(tmp_path: Path) -> None:
    given = written(tmp_path, CABLE)
    own = CoSimulated(read_scenario(given[0])).own()
    expected = float(np.abs(torque_predicted(own, 0.0, read_card(given[1]).plant())).max())
    limit = f"{expected + 0.01:.3f}"  # the card keeps it, and the cable of the machine does not
    with pytest.raises(
        InputError, match=rf"limit on the set point of axis: torque \S+ beyond {limit}; --limits torque=\S+ would"
    ):
        investigate(*given[:2], tmp_path / "out", machine=given[2], limits={"torque": limit})
    assert len([*(tmp_path / "out" / "recordings").iterdir()]) == 1


def test_a_limit_left_on_the_way_is_the_end_is_said_and_is_kept(tmp_path, monkeypatch) -> None:
    given, out = written(tmp_path, CABLE), tmp_path / "out"
    record = CoSimulated.record

    def overshot(self: CoSimulated, motion: Motion, number: int, path: Path) -> Recording:
        found = record(self, motion, number, path)
        if number < 3:
            return found
        path.unlink()
        replace(found, table=found.table | {"q": 3 * found["q"]}).write(path)
        return Recording.read(path)

    monkeypatch.setattr(CoSimulated, "record", overshot)
    done = investigate(*given[:2], out, machine=given[2], budget=100, seconds=10, limits=LIMITS)
    assert done.story.ended == "limit left"
    last = done.story.steps[-1]
    assert (last.number, last.left.partition(" ")[0]) == (3, "position")
    assert (out / last.file).exists()
    assert "LEFT position" in str(done)
    again = investigate(*given[:2], out, machine=given[2], budget=100, seconds=10, limits=LIMITS)
    assert [one.number for one in again.story.steps if isinstance(one, Moved)] == [0, 1, 3]


OPTIONS = """--card a.toml --out o --machine m.toml --budget 2min --seconds 12.5 --limits position=-0.5:0.5
    --limits speed=0.2 --train 'run 1.csv' --train run2.csv --heldout run3.csv --seed 0"""
ON_A_DRIVE = "--card a.toml --out o --machine virtual --drive udp://127.0.0.1:9 --key k --move"


@pytest.mark.parametrize("options", [OPTIONS, ON_A_DRIVE])
def test_the_command_that_is_recorded_asks_for_the_same(options: str, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[dict[str, object]] = []

    def noted(*given: object, **options: object) -> None:
        asked.append({"given": given, **options, "on_progress": None, "on_step": None})
        raise InputError("enough")

    monkeypatch.setattr(sys.modules["cosim_investigation.investigate"], "investigate", noted)
    monkeypatch.setattr("cosim_investigation.verb.machine_of", lambda *given: given)
    call("investigate", "axis.toml", *split(options))
    recorded = str(asked[0]["command"])
    call(*split(recorded)[1:])
    assert asked[0] == asked[1]
    assert not [one for one in split(options) if one not in recorded]


@pytest.mark.parametrize(("text", "seconds"), [("300", 300), ("300s", 300), ("1.5min", 90), ("1 h", 3600)])
def test_a_budget_is_a_time(text: str, seconds: float) -> None:
    assert seconds_of(text) == seconds


@pytest.mark.parametrize("text", ["", "0", "-3s", "soon", "3 days", "9" * 400])
def test_a_budget_that_is_no_time_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="it is a time above 0"):
        seconds_of(text)


def test_a_recording_of_a_proof_is_another_one(tmp_path: Path) -> None:
    given, path = written(tmp_path, CABLE), tmp_path / "run.csv"
    t = np.arange(0, 20, 0.01)
    np.savetxt(path, np.c_[t, np.sin(t), np.cos(t)], delimiter=",", header="t,q,tau", comments="")
    with pytest.raises(InputError, match="run is held out and among the training recordings"):
        investigate(*given[:2], tmp_path / "out", train=path, heldout=path)


# Progress of an investigation: stages count up to at most so many, the best answer is kept, the time comes down.

DIAGNOSIS = ("refitting the base", "Delay (1 of 2)", "proving on the recording that was not fitted")


def answer(after: float, *names: str) -> Answered:
    return Answered(0, names, (), (), 0.8, after, 0.1, 1.0)


def lines(budget: float = 60.0) -> list[str]:
    """What is told of three rounds of two motions of 10 s; each call takes 2 s."""
    said: list[str] = []
    rounds = Rounds(said.append, budget, 10.0, lambda: 2.0 * len(said))
    for number, found in enumerate((answer(0.3, "cogging"), answer(0.2, "cogging", "delay"), answer(0.5))):
        for role in ("train", "heldout"):
            rounds("moving: a sweep")
            rounds.step(Moved(number, "x.parquet", role, "sweep", "a sweep", 10.0))
        for text in DIAGNOSIS:
            rounds(text)
        rounds.step(found)
        if number < 2:
            rounds("designing the next motion")
    return said


def test_stages_count_up_the_best_answer_so_far_stays_and_the_time_to_go_comes_down() -> None:
    said = lines()
    told = [re.match(r"stage (\d+) of (?:at most )?(\d+): ", line) for line in said]
    numbers, most = zip(*[(int(one[1]), int(one[2])) for one in told if one], strict=True)
    assert list(numbers) == sorted(numbers)
    assert set(most) == {8}  # three rounds: move, diagnose, design; the last ends with its diagnosis
    assert numbers[-1] == 8
    assert said[-1].startswith("stage 8 of 8: ")
    assert "of at most 17: " in lines(120.0)[0]
    # the best answer, when a worse one comes
    assert "best so far" not in said[0]
    assert "best so far: cogging, validation error 0.8 -> 0.3" in said[6]
    assert "best so far: cogging, delay, validation error 0.8 -> 0.2" in said[-1]
    # the time to go, in later rounds
    assert "left" not in said[0]
    left = [int(found[1]) for line in said if (found := re.search(r"at most about (\d+) s left", line))]
    assert left[-1] < left[0]
    assert 0 < left[-1] <= 6


def test_a_name_that_is_one_of_a_set_heads_nothing_alone() -> None:
    """The heading names the rivals; that a sure answer was not found twice is no rival."""
    first = answer(0.3, "cogging")
    rivals = Answered(
        1, ("cable_wrap",), ("cable wrap or gravity unbalance", "once more"), ("set", "unconfirmed"), 1, 1, 1, 1
    )
    assert Story((first, rivals), "budget spent").answer == "Cable wrap (open: cable wrap or gravity unbalance)"
    assert Story((rivals, first), "budget spent").answer == "Cogging"
