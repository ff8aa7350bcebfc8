"""Scores of a proof are what one counts by hand, with the intervals of the textbook."""

from math import pi, sqrt
from typing import Any

import numpy as np
import pytest
from prove_rows import ROWS, row

from cosim_studies.proof import marks, power, score
from cosim_studies.proof.intervals import mean, ratio, share
from cosim_studies.proof.outside import SHAPED


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


def test_one_case_makes_nothing_sure() -> None:
    found = scores([row("one", ["cogging"], ["cogging"], after=1.0, best=1.0)])
    assert (found["gap_closed"]["met"], found["gap_closed"]["sure"]) == (True, False)
    many = scores([row("one", ["cogging"], ["cogging"], after=1.0, best=1.0)] * 20)
    assert many["gap_closed"]["sure"] is True


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
    missed = local | {"answer": local["answer"] | {"verdict": []}}
    assert scores([missed])["localisation"]["value"] == 0
    assert scores([missed])["localisation_given"]["value"] is None


def test_errors_of_numbers_are_relative_and_those_of_phases_an_angle() -> None:
    one = row("one", ["cogging"], ["cogging"])
    one["truth"]["effects"][0]["parameters"] = {"amplitude": 2.0, "phase": 3.0, "harmonics": [0.0]}
    one["answer"]["effects"][0]["parameters"] = {"amplitude": 2.2, "phase": 3.1 - np.pi / 2 - 2 * np.pi}
    errors = {name: error for _, name, error in marks.parameter_errors(one)}
    assert errors == pytest.approx({"amplitude": 0.1, "phase": 0.1})
