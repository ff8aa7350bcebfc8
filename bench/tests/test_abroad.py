"""The benchmark abroad: what its page counts, and that a traceback is an answer that is wrong."""

from pathlib import Path
from typing import Any

import pytest

from bench import abroad, abroad_page


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
