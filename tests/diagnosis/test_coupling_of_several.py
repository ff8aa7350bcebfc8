"""Of several neighbouring axes each that acts is found, and none that only moves."""

import json
from collections.abc import Mapping
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from problems import diagnosed
from two_links import JOINT, joint

import cosim.delivery
from cosim.api.why import Written
from cosim.data.recording import Recording
from cosim.delivery.deliver import as_json
from cosim.diagnosis.answer.why import reasons
from cosim.diagnosis.diagnose import Outcome
from pyfmi_models.card import parse_card
from pyfmi_models.card_writer import card_text

SCHEMA = Path(cosim.delivery.__file__).with_name("schema.json")


def of_joint(acting: Mapping[int, tuple[float, float]], **more: float) -> Outcome:
    return diagnosed([joint(seed, acting, **more) for seed in (1, 2, 3)], JOINT)


def test_each_neighbour_that_acts_is_found_with_its_own_size_and_delivered() -> None:
    outcome = of_joint({1: (0.2, 1.5), 3: (0.05, 0.0)})
    answer = outcome.diagnosis
    named = {one.name: one for one in answer.findings if one.answer == "found"}
    assert [*named] == ["axis_coupling:q1", "axis_coupling:q3"]
    assert named["axis_coupling:q1"].parameters["inertia"] == pytest.approx(0.2, rel=0.02)
    assert named["axis_coupling:q1"].parameters["weight"] == pytest.approx(1.5, rel=0.02)
    assert named["axis_coupling:q3"].parameters == {"inertia": pytest.approx(0.05, rel=0.05)}
    assert answer.heldout.after_rms < 0.05 * answer.heldout.before_rms
    again = parse_card(card_text(outcome.card, ""), "card.toml").plant()
    assert [one.name for one in again.effects] == [*named]

    document = json.loads(json.dumps(as_json(answer)))
    jsonschema.validate(document, json.loads(SCHEMA.read_text("utf-8")))
    assert document["verdict"] == document["delivered"] == ["axis_coupling"]
    (entry,) = (one for one in document["effects"] if one["effect"] == "axis_coupling")
    assert (entry["neighbour"], [one["neighbour"] for one in entry["further"]]) == ("q1", ["q3"])
    said = dict(reasons(document, answer.ledger))
    assert "fitted together with axis_coupling:q1" in said["axis_coupling:q3"]
    Written(document, answer.ledger).check("axis_coupling:q3")


def test_neighbours_that_move_and_do_nothing_are_not_named() -> None:
    answer = of_joint({}).diagnosis
    assert answer.verdict == ()
    assert [one.answer for one in answer.findings if one.effect == "axis_coupling"] == ["not_seen"]


def test_one_of_several_that_acts_alone_has_its_id_for_its_name_whatever_its_column_is_called() -> None:
    runs = []
    for run in (joint(seed, {3: (0.1, 0.0)}) for seed in (1, 2, 3)):
        speeds = {f"dq{k}": np.gradient(run[f"q{k}"], run.t) for k in (1, 2)}  # on speeds alone no weight hangs
        own = {name: run[name] for name in ("t", "tau", "q")}
        runs.append(Recording.of({**own, **speeds, "joint 3 position": run["q3"]}, run.name))
    answer = diagnosed(runs, JOINT).diagnosis
    (row,) = (one for one in answer.findings if one.answer == "found")
    assert (row.name, row.title, row.source) == ("axis_coupling", "Axis coupling", "joint 3 position")
    assert not any("axis_coupling:" in rule.name for one in answer.ledger for rule in one.rules)
    assert {one.effect for one in answer.ledger if one.effect.startswith("axis")} == {"axis_coupling"}


def test_of_two_that_move_in_proportion_one_is_named_and_the_other_said() -> None:
    answer = of_joint({2: (0.2, 0.0)}, spare=0.0).diagnosis
    (row,) = (one for one in answer.findings if one.answer == "found")
    assert row.parameters == {"inertia": pytest.approx(0.2, rel=0.02)}
    assert row.statement.endswith("of `q1`. It may as well be `q2`: `q1` moves in proportion to that.")


def test_two_that_move_nearly_alike_are_a_set_where_no_evidence_separates_them() -> None:
    answer = of_joint({1: (0.003, 0.0)}, spare=0.05, noise=0.2).diagnosis
    assert [{*group} for group in answer.ambiguous_with] == [{"axis_coupling:q1", "axis_coupling:q2"}]
