"""A neighbouring axis acts on this one: named where its columns are there and it moves by itself, and only then."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from two_links import WEIGHT, coupling, elbow

from cosim.data.neighbours import Neighbour, neighbours
from cosim.diagnosis.answer.result import Diagnosis
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.trust.admission import check_neighbours
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.neighbours import as_inputs, key
from cosim.estimation.prepare import prepare
from cosim.support.errors import RecordingError
from pyfmi_models.card import parse_card
from pyfmi_models.effects.axis_coupling import AxisCoupling, WeightCoupling

CARD = """
[mount]
name = "elbow"
inertia = 0.064
[friction]
model = "coulomb"
Fc = 0.15
sigma2 = 0.08
"""


@cache
def found(neighbour: str, columns: bool = True) -> Diagnosis:
    runs = [elbow(seed, neighbour, columns=columns) for seed in (1, 2, 3)]
    return diagnose(runs[:2], runs[2:], parse_card(CARD, "card.toml")).diagnosis


def test_a_neighbour_whose_columns_are_there_is_named_with_its_inertia_and_its_weight() -> None:
    (one,) = (finding for finding in found("tones").findings if finding.effect == "axis_coupling")
    assert one.answer == "found"
    assert one.parameters["inertia"] == pytest.approx(coupling(), rel=0.15)
    assert one.parameters["weight"] == pytest.approx(WEIGHT, rel=0.15)
    assert (one.parameters["phase"], one.parameters["follows"]) == (pytest.approx(0.0, abs=0.05), 1.0)
    assert "per rad/s² of `q1`" in one.statement
    held = found("tones").heldout
    assert held.after_rms < 0.1 * held.before_rms


def test_without_its_columns_it_is_nothing_else_for_sure() -> None:
    rows = {one.effect: one for one in found("tones", columns=False).findings}
    assert not [name for name, one in rows.items() if one.answer == "found"]
    assert (rows["axis_coupling"].answer, rows["axis_coupling"].evidence) == (
        "not_testable",
        "no column of a neighbour",
    )


def test_a_neighbour_that_stands_still_does_nothing() -> None:
    rows = {one.effect: one for one in found("still").findings}
    assert rows["axis_coupling"].answer == "not_testable"
    assert rows["gravity_unbalance"].answer == "found", "the weight of the elbow alone"


@pytest.mark.parametrize(("name", "is_there"), [("tones", True), ("still", False), ("alike", False)])
def test_a_neighbour_counts_where_it_moves_by_itself(name: str, is_there: bool) -> None:
    prepared = prepare([elbow(1, name), elbow(2, name)], 15.0)
    assert [one.name for one in prepared.neighbours_recorded] == ["q1"]
    assert bool(prepared.neighbours) == is_there


def test_what_was_not_recorded_of_a_neighbour_is_the_derivative_of_what_was() -> None:
    run = elbow(1)
    piece = prepare([run], 15.0).pieces[0]
    filtered = piece.neighbours[key("q1", "position")]
    speed = np.gradient(filtered, piece.dt)
    np.testing.assert_allclose(piece.neighbours[key("q1", "speed")][5:-5], speed[5:-5], atol=0.02 * np.ptp(speed))
    fed = as_inputs(run, parse_card(CARD + '[[effects]]\neffect="axis_coupling"\nneighbour="q1"\n', "c").plant(), 15.0)
    assert "neighbour_acceleration" in fed
    assert "neighbour_speed" not in fed, "only what the effect reads"


@pytest.mark.parametrize(
    ("columns", "units", "expected"),
    [
        (["q2"], {}, [Neighbour(position="q2")]),
        (["q_2", "dq_2", "qdd_2"], {}, [Neighbour("q_2", "dq_2", "qdd_2")]),
        (["joint2_position", "joint2_velocity"], {}, [Neighbour("joint2_position", "joint2_velocity")]),
        (["axis2.q", "v2", "a2"], {}, [Neighbour("axis2.q", "v2", "a2")]),
        (["elbow_pos"], {"elbow_pos": "m"}, [Neighbour("elbow_pos", turns=False)]),
        (["q_neighbour"], {}, [Neighbour("q_neighbour")]),
        (["wrist"], {"wrist": "rad/s"}, [Neighbour(speed="wrist")]),
        (["q1", "q3"], {}, [Neighbour("q1"), Neighbour("q3")]),
        (["tau2", "q2_ref", "position_error_2", "i2", "temp2", "position", "load", "v", "q_d"], {}, []),
        (["q2"], {"q2": "N.m"}, []),
        (["encoder_2", "joint2_encoder"], {}, [Neighbour("joint2_encoder")]),
    ],
)
def test_columns_of_a_neighbour_are_told_by_the_fields_usual_names(
    columns: list[str], units: dict[str, str], expected: list[Neighbour]
) -> None:
    assert list(neighbours(["t", "tau", "q", *columns], units)) == expected


def test_a_sentence_names_the_column_and_the_inputs_are_the_plants() -> None:
    one = WeightCoupling(inertia=0.12, weight=1.1, follows=0.0, neighbour="q2")
    said = "0.12 N·m per rad/s² of `q2`, a weight of 1.1 N·m that goes with the angle `q2`."
    assert one.statement().endswith(said)
    assert [each.name for each in one.inputs()] == ["neighbour_acceleration", "neighbour_position"]
    assert one.recorded_as()["neighbour_acceleration"] == "q2 acceleration"
    assert AxisCoupling(inertia=0.1).recorded_as() == {}


def test_a_card_that_names_a_column_which_is_not_there_is_refused_with_those_that_are() -> None:
    plant = parse_card(CARD + '[[effects]]\neffect="axis_coupling"\nneighbour="q7"\n', "card.toml").plant()
    with pytest.raises(RecordingError, match=r'reads "q7", which this recording lacks; neighbours are: q1\.'):
        check_neighbours(plant, [elbow(1)])
    with pytest.raises(RecordingError, match="it has no column of a neighbour"):
        check_neighbours(plant, [elbow(1, columns=False)])


def test_a_card_without_the_word_reads_the_only_neighbour() -> None:
    named, bare = (
        parse_card(CARD + f'[[effects]]\neffect="axis_coupling"\ninertia=0.09\n{more}\n', "c").plant()
        for more in ('neighbour="q1"', "")
    )
    pieces = prepare([elbow(1)], 15.0).pieces
    torques = [stacked(Inverse(mount, ()), pieces, np.zeros(0))[0] for mount in (named, bare)]
    np.testing.assert_array_equal(*torques)
    without = stacked(Inverse(replace(named, effects=()), ()), pieces, np.zeros(0))[0]
    assert np.ptp(torques[0] - without) > 0.1
