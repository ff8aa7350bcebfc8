"""The benchmark abroad: skipped with a reason, resumed where it ended, scored by the generator's own script."""

import json
import sys
from pathlib import Path
from typing import Any

import pytest

from bench import abroad, abroad_page
from cosim_studies.proof.ledger import listed

GENERATOR = """
import argparse, json, pathlib
from cosim_studies.proof.generator import make_case, to_toml
FAMILIES = ["none", "torque_offset"]
if __name__ == "__main__":
    ap = argparse.ArgumentParser()
    for name in ("seed", "n-per-family"): ap.add_argument("--" + name, type=int)
    ap.add_argument("--families"); ap.add_argument("--out")
    a = ap.parse_args()
    truth = pathlib.Path(a.out + "_truth"); truth.mkdir()
    for k in range(a.n_per_family):
        effects = [] if a.families == "none" else [a.families]
        case = make_case(a.seed + k, effects, duration=6.0, rate_hz=200)
        folder = pathlib.Path(a.out) / f"case_{k:04d}"; folder.mkdir(parents=True)
        for name, table in zip(("train_1", "train_2", "heldout"), (*case.train, case.heldout)):
            table.to_csv(folder / f"{name}.csv.gz", index=False)
        (folder / "model.toml").write_text(to_toml(case.card))
        told = {"case": folder.name, "family": a.families, "effects": effects}
        (truth / f"{folder.name}.json").write_text(json.dumps(told))
"""
SCORE = """
import argparse, json, pathlib
ap = argparse.ArgumentParser()
for name in ("truth", "results", "json"): ap.add_argument("--" + name)
ap.add_argument("--quiet", action="store_true")
a = ap.parse_args()
rows = []
for path in sorted(pathlib.Path(a.truth).glob("*.json")):
    t = json.loads(path.read_text()); r = json.loads((pathlib.Path(a.results) / path.name).read_text())
    said = r.get("verdict", []) or ["none"]
    row = {"level": "strong" if t["effects"] else "none", "friction": "lugre"}
    row["closed_lib"] = 1.0 if t["effects"] else None
    rows.append(t | row | {"verdict": said, "correct": said[0] in (t["effects"] or ["none"])})
pathlib.Path(a.json).write_text(json.dumps({"rows": rows}))
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A generator that writes cases of this project, and a numba that is none."""
    data = tmp_path / "theirs"
    data.mkdir()
    for name, text in (("make_cases.py", GENERATOR), ("score.py", SCORE), ("numba.py", "")):
        (data / name).write_text(text)
    root = Path(__file__).parents[2]
    monkeypatch.setenv("PYTHONPATH", f"{root}:{data}")
    return data


def run(monkeypatch: pytest.MonkeyPatch, *words: str) -> None:
    monkeypatch.setattr(sys, "argv", ["abroad.py", *words])
    abroad.main()


def test_two_cases_are_made_diagnosed_and_scored_and_a_second_run_only_scores(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, work, decks = tmp_path / "out", tmp_path / "work", tmp_path / "decks.md"
    words = ["--data", str(folder), "--cases", "1", "--nulls", "1", "--seed", "8", "--jobs", "1", "--purpose", "tuning"]
    words += ["--work", str(work), "--out", str(out), "--decks", str(decks)]
    run(monkeypatch, *words)
    found = json.loads((out / "abroad.json").read_text())
    assert found["played"] == 2
    assert [row["family"] for row in found["rows"]] == ["none", "torque_offset"]
    assert not any("crashed" in row["answer"] for row in found["rows"])
    assert (found["seed"], found["purpose"]) == (8, "tuning")
    assert "| one effect, strong: the first name is right |" in (out / "README.md").read_text()
    answers = sorted(work.glob("answers-*/*/case_0000.json"))
    before = [path.stat().st_mtime_ns for path in answers]
    run(monkeypatch, *words)
    assert [path.stat().st_mtime_ns for path in answers] == before
    assert [(one.generator, one.cases, one.purpose) for one in listed(decks)] == [("abroad", 2, "tuning")]


def test_without_the_generator_or_its_numba_it_is_skipped_with_the_reason(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    run(monkeypatch, "--data", str(tmp_path / "nowhere"), "--seed", "1", "--out", str(out))
    assert capsys.readouterr().out == f"skipped: {tmp_path / 'nowhere'} holds no make_cases.py\n"
    (folder / "numba.py").write_text("raise ImportError\n")
    run(monkeypatch, "--data", str(folder), "--seed", "1", "--out", str(out))
    assert "has no numba, which the generator needs" in capsys.readouterr().out
    assert not out.exists()


def test_a_traceback_is_an_answer_that_is_wrong(tmp_path: Path) -> None:
    case = tmp_path / "case_0000"
    case.mkdir()
    (case / "model.toml").write_text("[mount]\n")
    assert abroad.answer(case, tmp_path / "answers") == "answers case_0000: crashed"
    assert "inertia is missing" in abroad.kept(tmp_path / "answers" / "case_0000.json")["crashed"]


def row(family: str, effects: list[str], verdict: list[str], level: str = "strong", **more: Any) -> dict[str, Any]:
    offered = [{"effect": name, "answer": "found", "probability": 0.9} for name in verdict if name != "unknown"]
    answer = {"verdict": verdict, "ambiguous_with": more.get("groups", []), "effects": offered, "wall_seconds": 2.0}
    judged = {"verdict": verdict or ["none"], "correct": (verdict or ["none"])[0] in (effects or ["none"])}
    return {
        "family": family,
        "effects": effects,
        "level": level,
        "answer": answer,
        "closed_lib": more.get("closed"),
    } | judged


def test_scores_are_what_one_counts() -> None:
    rows = [
        row("delay", ["delay"], ["delay"], closed=0.9),
        row("delay", ["delay"], ["actuator_lag"], "medium", groups=[["actuator_lag", "delay"]], closed=0.5),
        row("cogging", ["cogging"], [], "subtle"),
        row("none", [], []),
        row("none", [], ["unknown"]) | {"correct": False},
        row("unknown", ["unknown"], ["unknown"], "medium"),
        row("unknown", ["unknown"], ["cogging"], "subtle"),
        row("pairs", ["delay", "cogging"], ["delay", "stribeck"]),
    ]
    found = {one["key"]: one for one in abroad_page.scores(rows)}
    expected = {"strong": 1.0, "medium": 0.0, "subtle": 0.0, "first": 1 / 3, "in_set": 2 / 3, "set_size": 1.5}
    expected |= {"none_said": 1 / 3, "false_alarms": 1 / 2, "unknown": 1.0, "unknown_all": 1 / 2, "crashed": 0.0}
    expected |= {"precision": 1 / 2, "recall": 1 / 2, "closed": 0.7, "seconds": 2.0}
    assert {key: found[key]["value"] for key in expected} == pytest.approx(expected)
    assert (found["first"]["met"], found["first"]["sure"]) == (False, True)
    assert found["strong"]["sure"] is False
    families = {one["family"]: one for one in abroad_page.by_family(rows)}
    assert families["delay"]["said"] == "actuator_lag, delay"
    assert families["pairs"]["right"]["value"] == 0.0
