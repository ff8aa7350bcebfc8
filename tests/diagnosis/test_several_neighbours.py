"""An axis with several neighbours has a coupling with each of those that act, and with no other."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from two_links import elbow, joint, tones

import cosim.delivery
from cosim.api.why import Written
from cosim.data.recording import Recording
from cosim.delivery.deliver import as_json
from cosim.diagnosis.answer.why import reasons
from cosim.diagnosis.diagnose import Outcome, diagnose
from cosim.diagnosis.trust.admission import check_neighbours
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import prepare
from pyfmi_models.card import parse_card
from pyfmi_models.card_writer import card_text

CARD = """
[mount]
name = "joint"
inertia = 0.3
[friction]
model = "coulomb"
Fc = 0.5
sigma2 = 0.3
"""
COUPLED = """[[effects]]
effect = "axis_coupling"
inertia = {}
neighbour = "{}"
"""
SCHEMA = Path(cosim.delivery.__file__).with_name("schema.json")


def found(acting: Mapping[int, tuple[float, float]], **more: float) -> Outcome:
    runs = [joint(seed, acting, **more) for seed in (1, 2, 3)]
    return diagnose(runs[:2], runs[2:], parse_card(CARD, "card.toml"))


def test_each_neighbour_that_acts_is_found_with_its_own_size_and_delivered() -> None:
    outcome = found({1: (0.2, 1.5), 3: (0.05, 0.0)})
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


def test_what_the_equation_of_a_coupling_lacks_makes_no_other_neighbour_a_cause() -> None:
    runs = []
    for seed in (1, 2, 3):
        run = elbow(seed)
        idle = {f"q{k}": tones(run.t, 100 * k + seed, 0.7).q for k in (3, 4)}
        runs.append(Recording.of({**run.table, **idle}, run.name))
    answer = diagnose(runs[:2], runs[2:], parse_card(CARD.replace("0.3", "0.064"), "card.toml")).diagnosis
    assert {one.source for one in answer.findings if one.effect == "axis_coupling" and one.parameters} == {"q1"}


def test_neighbours_that_move_and_do_nothing_are_not_named() -> None:
    answer = found({}).diagnosis
    assert answer.verdict == ()
    (row,) = (one for one in answer.findings if one.effect == "axis_coupling")
    assert row.answer == "not_seen"


def test_one_of_several_that_acts_alone_has_its_id_for_its_name_whatever_its_column_is_called() -> None:
    runs = []
    for run in (joint(seed, {3: (0.1, 0.0)}) for seed in (1, 2, 3)):
        speeds = {f"dq{k}": np.gradient(run[f"q{k}"], run.t) for k in (1, 2)}  # on speeds alone no weight hangs
        own = {name: run[name] for name in ("t", "tau", "q")}
        runs.append(Recording.of({**own, **speeds, "joint 3 position": run["q3"]}, run.name))
    answer = diagnose(runs[:2], runs[2:], parse_card(CARD, "card.toml")).diagnosis
    (row,) = (one for one in answer.findings if one.answer == "found")
    assert (row.name, row.title, row.source) == ("axis_coupling", "Axis coupling", "joint 3 position")
    assert not any("axis_coupling:" in rule.name for one in answer.ledger for rule in one.rules)
    assert {one.effect for one in answer.ledger if one.effect.startswith("axis")} == {"axis_coupling"}
    assert [one.effect for one in answer.scores.effects] == ["axis_coupling"] if answer.scores else False


def test_of_two_that_move_in_proportion_one_is_named_and_the_other_said() -> None:
    answer = found({2: (0.2, 0.0)}, spare=0.0).diagnosis
    (row,) = (one for one in answer.findings if one.answer == "found")
    assert row.parameters == {"inertia": pytest.approx(0.2, rel=0.02)}
    assert row.statement.endswith("of `q1`. It may as well be `q2`: `q1` moves in proportion to that.")


def test_two_that_move_nearly_alike_are_a_set_where_no_evidence_separates_them() -> None:
    answer = found({1: (0.003, 0.0)}, spare=0.05, noise=0.2).diagnosis
    assert [{*group} for group in answer.ambiguous_with] == [{"axis_coupling:q1", "axis_coupling:q2"}]


def test_a_card_with_two_couplings_reads_two_inputs_and_needs_the_sum_of_their_torques() -> None:
    texts = [COUPLED.format(0.2, "q1"), COUPLED.format(0.05, "q3")]
    both, *single = (parse_card(CARD + text, "card.toml").plant() for text in ("".join(texts), *texts))
    run = joint(1, {})
    check_neighbours(both, [run])
    pieces = prepare([run], 15.0).pieces

    def torque(*mounts: object) -> list[np.ndarray]:
        return [stacked(Inverse(one, ()), pieces, np.zeros(0))[0] for one in mounts]

    none, one, other, together = torque(replace(both, effects=()), *single, both)
    np.testing.assert_allclose(together - none, one + other - 2 * none, atol=1e-9)
    assert np.ptp(other - none) > 0.01
    inputs = {variable.name: variable.description for variable in both.model().inputs}
    assert inputs["neighbour_acceleration"] == "Acceleration of the neighbouring axis, `q1`"
    assert inputs["neighbour_acceleration2"] == "Acceleration of the neighbouring axis, `q3`"
    alone = [variable.name for variable in single[1].model().inputs]
    assert alone == ["tau", "disturbance", "neighbour_acceleration"]
    x, p = np.zeros(2), [variable.start for variable in both.parameters()]
    speeds = [both.model().equations(0, x, [0, 0, *given], p)[0][1] for given in ((1, 0), (0, 1))]
    assert [float(one) for one in speeds] == pytest.approx([-0.2 / 0.3, -0.05 / 0.3])
