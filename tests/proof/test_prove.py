"""A proof is honest: sealed before, opened after, scored as stated, and the same for a seed."""

import json
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import call
from imports import imports
from prove_rows import ROWS, cautious, crashing, row
from report_example import diagnosis

from cosim.support.errors import OutputError, ProofError
from cosim.support.journal import RUNS
from cosim_studies.proof import baselines, marks, power, score
from cosim_studies.proof.cases import SIZES, TOGETHER, cases_of
from cosim_studies.proof.conduct import Benchmark, conduct
from cosim_studies.proof.generator import FAMILIES, OUTSIDE
from cosim_studies.proof.intervals import mean, ratio, share
from cosim_studies.proof.ledger import enlist, listed
from cosim_studies.proof.outside import SHAPED
from cosim_studies.proof.page import page, proof
from cosim_studies.proof.seal import Seals, canonical, salt_of, seal
from cosim_studies.proof.tool import scored
from cosim_studies.verbs.prove import _line


def test_a_deck_is_drawn_from_its_seed_alone_a_longer_one_begins_alike_and_sizes_are_even_in_their_logarithm() -> None:
    assert cases_of(3, 40) == cases_of(3, 40)
    assert cases_of(3, 90)[:40] == cases_of(3, 40)
    assert cases_of(4, 40) != cases_of(3, 40)
    sizes = np.log([hand.size for hand in cases_of(4, 400)])
    low, high = np.log(SIZES)
    assert low < sizes.min() < low + 0.02
    assert high - 0.02 < sizes.max() < high
    assert np.histogram(sizes, 4, (low, high))[0] == pytest.approx([100] * 4, abs=25)


def test_kinds_come_in_their_shares_and_families_in_fair_rotation() -> None:
    hands = cases_of(11, 420)
    kinds = [hand.kind for hand in hands]
    assert [kinds.count(kind) for kind in ("none", "one", "several", "outside")] == [105, 168, 84, 63]
    alone = [hand.effects[0] for hand in hands if hand.kind == "one"]
    assert {alone.count(name) for name in FAMILIES} == {8}
    assert {[h.effects[0] for h in hands if h.kind == "outside"].count(name) for name in OUTSIDE} <= {4, 5}
    sizes = [len(hand.effects) for hand in hands if hand.kind == "several"]
    assert (sizes.count(2), sizes.count(3)) == (63, 21)
    assert not any(len(group & set(hand.effects)) > 1 for hand in hands for group in TOGETHER)
    assert len({hand.seed for hand in hands}) == len(hands)


def test_a_list_of_decks_keeps_every_line_and_says_what_is_not_fresh(tmp_path: Path) -> None:
    path = tmp_path / "decks.md"
    enlist(path, "home", 5, 60, "tuning", "a" * 64)
    enlist(path, "home", 5, 90, "tuning", "a" * 64)  # made longer
    enlist(path, "home", 5, 90, "scoring", "b" * 64)
    enlist(path, "abroad", 5, 30, "scoring", "b" * 64)
    assert [(one.generator, one.cases, one.purpose, one.fresh) for one in listed(path)] == [
        ("home", 90, "tuning", "yes"),
        ("home", 90, "scoring", "no"),
        ("abroad", 30, "scoring", "yes"),
    ]
    with pytest.raises(ProofError, match="--purpose play: it must be one of tuning, scoring"):
        enlist(path, "home", 6, 60, "play", "b" * 64)
    kept = listed(Path(__file__).parents[2] / "results" / "decks.md")
    assert {one.purpose for one in kept} == {"tuning", "scoring"}


def test_neither_a_truth_nor_an_answer_can_be_changed_without_breaking_its_seal(tmp_path: Path) -> None:
    assert canonical({"b": 1, "a": [1.5]}) == canonical({"a": [1.5], "b": 1}) == '{"a":[1.5],"b":1}'
    truth = {"verdict": ["cogging"], "effects": [{"amplitude": 0.1 + 0.2}]}
    salt = salt_of(5, 0)
    seals = Seals(tmp_path / "seals.jsonl")
    seals.write(0, seal(truth, salt))
    opened = {"run": 0, "salt": salt, "truth": json.loads(json.dumps(truth))}
    Seals(tmp_path / "seals.jsonl").check([opened])
    for change in ({"truth": truth | {"verdict": []}}, {"salt": salt_of(6, 0)}):
        with pytest.raises(ProofError, match="Case 0: what stands as its truth is not the truth that was sealed"):
            seals.check([opened | change])
    with pytest.raises(ProofError, match=r"Case 1: .* has no seal"):
        seals.check([opened | {"run": 1}])
    with pytest.raises(ProofError, match="Case 0 was sealed before with another truth"):
        seals.write(0, seal(truth, salt_of(6, 0)))
    with (tmp_path / "seals.jsonl").open("a") as file:
        file.write('{"run": 1, "se')  # cut short: it is written again
    Seals(tmp_path / "seals.jsonl").write(1, "b" * 64)
    assert Seals(tmp_path / "seals.jsonl").known == {0: seal(truth, salt), 1: "b" * 64}
    row = {"run": 0, "answer": {"verdict": ["cogging"], "share": 0.1 + 0.2, "gap": float("nan")}, "status": "ok"}
    Seals(tmp_path / "seals.jsonl").write_answer(row)
    seals = Seals(tmp_path / "seals.jsonl")
    seals.check_answers([json.loads(json.dumps(row))])
    for change in ({"answer": []}, {"status": "failed"}, {"answer": row["answer"] | {"verdict": []}}):
        with pytest.raises(ProofError, match="Case 0: its answer is not the answer that was sealed; remove its line"):
            seals.check_answers([row | change])
    with pytest.raises(ProofError, match="Case 1: its answer has no seal"):
        seals.check_answers([row | {"run": 1}])


def test_what_makes_cases_shares_nothing_with_what_is_tested() -> None:
    seen, rest = set(), {"cosim_studies.proof.make"}
    while rest:
        name = rest.pop()
        seen.add(name)
        rest |= {other for other in imports(name) if other.startswith(("cosim", "pyfmi_models"))} - seen
    assert "cosim_studies.proof.truth" in seen
    assert not [name for name in seen if name.startswith(("pyfmi_models", "cosim.diagnosis", "cosim.estimation"))]


def test_what_a_diagnosis_says_is_what_is_scored() -> None:
    found = diagnosis("two")
    said = json.loads(json.dumps(scored(found), allow_nan=False))
    case = row("several", ["cogging", "friction_asymmetry"], []) | {"answer": said}
    assert (marks.exact(case), marks.hits(case), marks.verdict(case)) == (True, 2, found.verdict)
    offered = [(one.probability, one.effect) for one in found.findings if one.answer in ("found", "ambiguous")]
    assert [p for p, _ in marks.probabilities(case)] == [p for p, _ in offered]
    assert marks.gain(case, "cosim") == pytest.approx(1 - 0.18 / 0.37)
    assert set(said["windows"]) == {"run1", "run2", "run3"}
    assert set(baselines.compared(found.traces, names=("refit", "kernel"))) == {"refit", "kernel"}


def test_a_proof_goes_on_where_it_ended_leaves_complete_files_and_those_of_others_alone(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))  # the tool's process imports what stands in for it
    told: list[str] = []
    wanted = {"workers": 1, "tool": cautious, "on_seal": told.append}
    out = tmp_path / "proof"
    first = conduct(Benchmark(5, 1, 10.0), out, **wanted)
    before = (out / RUNS).read_text()
    whole = conduct(Benchmark(5, 2, 10.0), out, **wanted)
    assert (first["played"], whole["played"]) == (1, 2)
    assert (out / RUNS).read_text().startswith(before)
    assert [one["seal"] in line for one, line in zip(whole["rows"], told, strict=True)] == [True, True]
    assert json.loads((out / "proof.json").read_text()) == json.loads(json.dumps(whole))
    assert (out / "README.md").read_text() == page(whole)
    lines = (out / "cases.csv").read_text().splitlines()
    assert len(lines) == 3
    assert all((out / f"{name}.svg").read_text().startswith("<?xml") for name in ("confusion", "calibration", "gap"))
    with pytest.raises(OutputError, match="holds another proof: its seed"):
        conduct(Benchmark(6, 2, 10.0), out, **wanted)
    (out / RUNS).write_text((out / RUNS).read_text().replace('"blend": ', '"blend": 1', 1))
    with pytest.raises(ProofError, match="is not the truth that was sealed"):
        conduct(Benchmark(5, 2, 10.0), out, **wanted)
    crashed = conduct(Benchmark(5, 1, 10.0), tmp_path / "crashed", workers=1, tool=crashing)["rows"][0]
    assert (crashed["status"], "code 3" in crashed["reason"]) == ("crashed", True)  # a row, and not the end
    (mine := tmp_path / "mine").mkdir()
    (mine / "README.md").write_text("mine")
    with pytest.raises(OutputError, match=r"README.md exists already; give --force"):
        conduct(Benchmark(5, 1, 10.0), mine)
    assert [path.name for path in mine.iterdir()] == ["README.md"]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (["--cases", "0"], "--cases 0: it must be at least 1"),
        (["--seconds", "5"], "--seconds 5: a recording must last 10 s at least"),
        (["--workers", "0"], "--workers 0: it must be at least 1"),
        (["--workers", str(2**64)], "--workers 18446744073709551616: 1,024 are the most"),
        (["--seed", "-1"], "--seed -1: it must be at least 0"),
        (["--seconds", "nan"], "--seconds nan: it must be a finite number"),
    ],
)
def test_wrong_wishes_end_with_one_sentence(wrong, message, tmp_path, capsys) -> None:
    assert call("prove", "--out", tmp_path / "out", "--decks", tmp_path / "decks.md", *wrong) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"cosim: {message}")
    assert said.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("met", "sure", "said"),
    [(True, True, "met"), (True, False, "inconclusive"), (False, True, "missed"), (False, False, "inconclusive")],
)
def test_the_terminal_says_whether_more_cases_could_turn_a_bar(met: bool, sure: bool, said: str) -> None:
    score = {"title": "right", "value": 0.9, "low": 0.8, "high": 1.0, "asked": ">= 0.9", "met": met, "sure": sure}
    assert _line(score).endswith(f">= 0.9   {said}")


def test_the_page_says_every_score_and_every_miss() -> None:
    rows = [one | {"run": k} for k, one in enumerate(ROWS)]
    facts = {"command": "cosim prove", "seed": 1, "cases": 13, "seconds": 60.0, "version": "0", "code": "c" * 64}
    text = page(proof(rows, facts))
    assert (
        "| nothing concealed: something is said to be missing | 0.5 [0.15, 0.85] | 4 | <= 0.02 | **missed** |" in text
    )
    missed = [line for line in text.splitlines() if line.startswith(tuple(f"| {k} | 1 |" for k in range(13)))]
    assert len(missed) == sum(not marks.exact(one) for one in ROWS)


# Scores are what one counts by hand, with the intervals of the textbook.


def scores(rows: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    return {one["key"]: one for one in score.scored(rows)}


def test_power_rises_with_size_and_is_read_off_what_was_found() -> None:
    rng = np.random.default_rng(2)
    sizes = np.exp(rng.uniform(np.log(0.2), 0.0, 300))
    found = rng.random(300) < 1 / (1 + np.exp(-(4 + 5 * np.log(sizes))))
    a, b = power.curve(sizes, found)
    assert (a, b) == (pytest.approx(4, abs=0.8), pytest.approx(5, abs=1.2))
    rows = [
        row("one", ["cogging"], ["cogging"] if one else []) | {"size": size}
        for size, one in zip(sizes, found, strict=True)
    ]
    (told,) = power.powers(rows)
    assert sum(one["cases"] for one in told["bins"]) == 300
    assert sum(one["right_first"] for one in told["bins"]) == found.sum()
    assert told["at"] == sorted(told["at"])
    assert told["at"][-1] == pytest.approx(1 / (1 + np.exp(-a)))
    few = power.curve([0.3], [True])
    assert 0.3 < power.probability(0.3, *few) < 0.95  # one case says little


def test_levels_are_those_of_the_true_structure_and_a_rejected_fit_has_none() -> None:
    rows = [row("one", ["delay"], ["delay"], best=best) for best in (1.99, 1.7, 1.2, 0.5)] + [row("one", ["delay"], [])]
    told = {one["level"]: one["cases"] for one in power.by_level(rows)}
    assert told == {"nothing to gain": 1, "subtle": 1, "medium": 1, "strong": 1, "no ceiling": 1}
    assert scores(rows)["no_gap"]["value"] == pytest.approx(2 / 5)


def test_what_is_outside_is_told_with_each_effect_left_out() -> None:
    rubs, quiet, runs = row("outside", ["rubbing"], ["unknown"]), row("outside", ["run_in"], []), ["run_in"]
    rows = [rubs, quiet, row("outside", runs, ["unknown"])]
    told = {one["effect"]: one for one in power.outside(rows, tuple(SHAPED))}
    assert told["run_in"]["unknown"]["value"] == 1 / 2
    assert told["run_in"]["without"]["value"] == 1
    assert (told["with a shape"]["cases"], told["without one"]["cases"]) == (1, 2)
    assert (told["rubbing"]["shape"], told["run_in"]["shape"]) == (True, False)


def test_intervals_are_those_of_the_textbook() -> None:
    half, none = share([True] * 5 + [False] * 5), share([False] * 100)
    assert (half.low, half.high) == pytest.approx((0.2366, 0.7634), abs=1e-4)
    assert (none.value, none.low, none.high) == pytest.approx((0, 0, 0.0370), abs=1e-4)
    values = np.random.default_rng(1).standard_normal(400).tolist()
    found = mean(values)
    assert found.high - found.low == pytest.approx(2 * 1.96 * np.std(values) / 20, rel=0.06)
    assert ratio([(1, 2), (3, 4)]).value == pytest.approx(4 / 6)
    assert ratio([(0, 0)]).value is None


def test_scores_of_hand_made_answers_are_what_one_counts() -> None:
    found = scores(ROWS)
    expected = {
        **{"false_alarms": 2 / 4, "right_first": 2 / 5, "in_set": 3 / 5, "wrong_single": 1 / 5, "exact": 2 / 5},
        **{"set_size": (2 + 1 + 2 + 1) / 4, "precision": 3 / 4, "recall": 3 / 5},
        **{"unknown": 1 / 2, "named_outside": 1 / 2, "seconds": 9.0, "gap_closed": 0.92},
    }
    assert {key: found[key]["value"] for key in expected} == pytest.approx(expected)
    assert found["false_alarms"]["met"] is False
    assert found["gap_closed"]["met"] is True
    assert (found["gap_closed"]["sure"], found["false_alarms"]["sure"]) == (False, True)
    assert found["exact"]["met"] is None
    case = row("one", ["cogging"], ["cogging"], after=1.0, best=1.0)
    one, many = (scores([case] * count)["gap_closed"] for count in (1, 20))
    assert (one["met"], one["sure"], many["sure"]) == (True, False, True)
    assert all(found[key]["low"] <= found[key]["value"] <= found[key]["high"] for key in expected)


def test_an_effect_can_be_found_where_its_own_structure_predicts_better_than_the_base() -> None:
    ceilings = ({"heldout_rms": 1.0, "base_rms": 2.0}, {"heldout_rms": 2.0, "base_rms": 2.0}, {"reason": "no fit"})
    rows = [row("one", ["delay"], [name]) | {"ceiling": best} for name in ("delay", "lag") for best in ceilings]
    found = scores([*rows, row("none", [], [])])
    assert (found["findable_first"]["value"], found["findable_first"]["n"]) == (0.5, 2)
    assert found["findable_in_set"]["value"] == 0.5


def test_of_several_effects_those_count_without_which_the_true_structure_predicts_worse() -> None:
    best = {"heldout_rms": 1.0, "base_rms": 2.0, "without": {"delay": 1.5, "lag": 0.9}}
    several = [row("several", ["delay", "lag"], [name]) | {"ceiling": best} for name in ("delay", "lag", "cogging")]
    found = scores([*several, row("several", ["delay", "lag"], []) | {"ceiling": {"reason": "no fit"}}])
    assert (found["recall"]["value"], found["findable_recall"]["value"]) == (2 / 8, 1 / 3)


def test_a_tool_that_crashed_is_wrong_and_raises_no_alarm() -> None:
    crashed = row("one", ["delay"], ["delay"]) | {"status": "crashed"}
    quiet = row("none", [], []) | {"status": "crashed"}
    found = scores([crashed, quiet])
    assert (found["right_first"]["value"], found["false_alarms"]["value"], found["in_set"]["value"]) == (0, 0, 0)
    assert score.confusion([crashed, quiet]) == {"delay": {"crashed": 1}, "none": {"crashed": 1}}


def test_calibration_error_is_the_distance_from_the_diagonal() -> None:
    rows = [row("one", ["delay"], [name]) for name in ("delay", "delay", "delay", "cogging")]
    assert scores(rows)["calibration_error"]["value"] == pytest.approx(0.9 - 0.75)
    shaken = [row("outside", [name], ["broadband_disturbance"]) for name in ("wind", "wind", "wind", "rubbing")]
    assert scores(shaken)["calibration_error"]["value"] == pytest.approx(0.9 - 0.75)  # rubbing is no random disturbance
    chance = scores(rows * 250)["calibration_by_chance"]  # p = .9 a thousand times: half a percent by chance
    assert chance["value"] == pytest.approx(sqrt(2 / pi * 0.9 * 0.1 / 1000), rel=0.15)
    assert chance["low"] < chance["value"] < chance["high"] < 0.03
    (only,) = score.bins([(0.9, True), (0.94, True), (0.92, False)])
    assert (only["printed"], only["true"], only["n"]) == (pytest.approx(0.92), pytest.approx(2 / 3), 3)


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        ([[0, 2]], [[1, 3]], 1 / 3),
        ([[0, 1], [2, 3]], [[0, 3]], 2 / 3),
        ([[0, 1]], [[2, 3]], 0),
        ([[0, 1], [0.5, 2]], [[0, 2]], 1),
        ([], [], 0),
    ],
)
def test_overlap_is_intersection_over_union(one: Any, other: Any, expected: float) -> None:
    assert marks.iou(one, other) == pytest.approx(expected)
    assert marks.iou(other, one) == pytest.approx(expected)


def test_places_count_only_where_the_tool_looked_and_zero_where_it_gave_none() -> None:
    spans = {"train_1": [[1, 5]], "heldout": [[20, 30]]}
    local = row("outside", ["rubbing"], ["unknown"], intervals={"train_1": [[2, 5]], "heldout": [[25, 30]]})
    local["answer"]["windows"] = {"train_1": [3, 50], "heldout": [3, 50]}
    local["truth"]["effects"][0]["where"] = {"axis": "time", "intervals": spans}
    assert dict(marks.places(local)) == {"time": pytest.approx((1 + 0.5) / 2)}
    held = row("one", ["position_friction"], ["position_friction"])
    held["truth"]["effects"][0]["where"] = {"axis": "position", "regions": [[0, 2]]}
    held["answer"]["effects"][0]["where"] = {"axis": "position", "regions": [[1, 3]]}
    assert dict(marks.places(held)) == {"position": pytest.approx(1 / 3)}
    missed = local | {"answer": local["answer"] | {"verdict": []}}
    assert scores([missed])["localisation"]["value"] == 0
    assert scores([missed])["localisation_given"]["value"] is None


def test_errors_of_numbers_are_relative_and_those_of_phases_an_angle() -> None:
    one = row("one", ["cogging"], ["cogging"])
    one["truth"]["effects"][0]["parameters"] = {"amplitude": 2.0, "phase": 3.0, "harmonics": [0.0]}
    one["answer"]["effects"][0]["parameters"] = {"amplitude": 2.2, "phase": 3.1 - np.pi / 2 - 2 * np.pi}
    errors = {name: error for _, name, error in marks.parameter_errors(one)}
    assert errors == pytest.approx({"amplitude": 0.1, "phase": 0.1})
