"""A neighbouring axis acts on this one: it is named where its columns are there and it moves by itself."""

import re
from dataclasses import replace

import numpy as np
import pytest
from problems import diagnosed
from two_links import ELBOW, JOINT, LEVER, OWN, WEIGHT, elbow, joint, tones, wrist

from cosim.data.neighbours import Neighbour, neighbours
from cosim.data.recording import Recording
from cosim.diagnosis.answer.result import Diagnosis
from cosim.diagnosis.trust.admission import check_neighbours
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.neighbours import as_inputs, key
from cosim.estimation.prepare import prepare
from cosim.support.errors import RecordingError
from pyfmi_models.card import CardError, parse_card
from pyfmi_models.effects.axis_coupling import ChainCoupling, SpaceCoupling, WeightCoupling
from pyfmi_models.mount import Mount


def coupled(card: str, *keys: str) -> Mount:
    """The mount of a card with couplings of these keys."""
    effects = (f'[[effects]]\neffect = "axis_coupling"\n{one}\n' for one in keys)
    return parse_card(card + "".join(effects), "card.toml").plant()


def of_elbow(neighbour: str, columns: bool = True) -> Diagnosis:
    return diagnosed([elbow(seed, neighbour, columns=columns) for seed in (1, 2, 3)], ELBOW).diagnosis


def test_a_neighbour_whose_columns_are_there_is_named_with_its_inertia_and_its_weight() -> None:
    answer = of_elbow("tones")
    (one,) = (finding for finding in answer.findings if finding.effect == "axis_coupling")
    assert one.answer == "found"
    folded = np.cos(np.concatenate([elbow(seed)["q"] for seed in (1, 2)]))
    assert one.parameters["inertia"] == pytest.approx(OWN + LEVER * np.mean(folded), rel=0.15)
    assert one.parameters["weight"] == pytest.approx(WEIGHT, rel=0.15)
    assert (one.parameters["phase"], one.parameters["follows"]) == (pytest.approx(0.0, abs=0.05), 1.0)
    assert "per rad/s² of `q1`" in one.statement
    assert answer.heldout.after_rms < 0.1 * answer.heldout.before_rms


@pytest.mark.parametrize(
    ("neighbour", "columns", "evidence", "named"),
    [
        pytest.param("tones", False, "no column of a neighbour", set(), id="without its columns nothing is sure"),
        pytest.param("still", True, "`q1` stands still", {"gravity_unbalance"}, id="at rest the own weight is left"),
    ],
)
def test_a_neighbour_that_is_not_seen_is_not_testable(
    neighbour: str, columns: bool, evidence: str, named: set[str]
) -> None:
    rows = {one.effect: one for one in of_elbow(neighbour, columns).findings}
    assert {name for name, one in rows.items() if one.answer == "found"} == named
    assert rows["axis_coupling"].answer == "not_testable"
    assert rows["axis_coupling"].evidence.startswith(evidence)


@pytest.mark.parametrize(("name", "is_there"), [("tones", True), ("still", False), ("alike", False)])
def test_a_neighbour_counts_where_it_moves_by_itself(name: str, is_there: bool) -> None:
    prepared = prepare([elbow(1, name), elbow(2, name)], 15.0)
    assert [one.name for one in prepared.neighbours_recorded] == ["q1"]
    assert bool(prepared.neighbours) == is_there


def test_what_was_not_recorded_of_a_neighbour_is_the_derivative_of_what_was() -> None:
    run = elbow(1)
    piece = prepare([run], 15.0).pieces[0]
    speed = np.gradient(piece.neighbours[key("q1", "position")], piece.dt)
    np.testing.assert_allclose(piece.neighbours[key("q1", "speed")][5:-5], speed[5:-5], atol=0.02 * np.ptp(speed))
    fed = as_inputs(run, coupled(ELBOW, 'neighbour = "q1"'), 15.0)
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


def test_a_sentence_names_the_columns_and_says_which_way_they_turn() -> None:
    said = WeightCoupling(inertia=0.12, weight=1.1, follows=0.0, neighbour="q2").statement()
    assert said.endswith("0.12 N·m per rad/s² of `q2`, a weight of 1.1 N·m that goes with the angle `q2`.")
    said = ChainCoupling(weight=2.0, follows=-1.0, follows_second=-1.0, neighbour="a + b").statement()
    assert said.endswith("a weight of 2 N·m that goes with the angle - this axis + `a` - `b`.")
    said = ChainCoupling(weight=2.0, follows=0.0, follows_second=1.0, neighbour="a + b").statement("N")
    assert said.endswith("a weight of 2 N that goes with the angle `a` + `b`.")
    said = SpaceCoupling(sss=3.0, ccc=-4.0, neighbour="a + b").statement()
    assert said.endswith("a weight of 5 N·m at most that goes with three angles, this axis', `a` and `b`.")


@pytest.mark.parametrize(
    ("keys", "run", "sentence"),
    [
        ('neighbour = "q7"', elbow(1), 'reads "q7", which this recording lacks; neighbours are: q1.'),
        ('neighbour = "q7"', elbow(1, columns=False), "it has no column of a neighbour"),
        ('weight = 1\nfollows_second = 1\nneighbour = "q1 + q9"', wrist(1), 'reads "q9", which this recording lacks'),
    ],
)
def test_a_card_that_names_a_column_which_is_not_there_is_refused(keys: str, run: Recording, sentence: str) -> None:
    with pytest.raises(RecordingError, match=re.escape(sentence)):
        check_neighbours(coupled(ELBOW, keys), [run])


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ('weight=1.0\nfollows_second=1.0\nneighbour="q1"', 'neighbour "q1" must name two neighbours, as q2 + q3'),
        ('weight=1.0\nfollows_second=1.0\nneighbour="a + b + c"', "must name two neighbours"),
        ('inertia=1.0\nneighbour="q1 + q2"', 'neighbour "q1 + q2" must name one neighbour'),
    ],
)
def test_a_coupling_names_as_many_neighbours_as_it_reads(keys: str, sentence: str) -> None:
    with pytest.raises(CardError, match=re.escape(sentence)):
        coupled(ELBOW, keys)


def torques(run: Recording, *mounts: Mount) -> list[np.ndarray]:
    """What each mount needs for the motion of a recording."""
    pieces = prepare([run], 15.0).pieces
    return [stacked(Inverse(one, ()), pieces, np.zeros(0))[0] for one in mounts]


def test_a_card_without_the_word_reads_the_only_neighbour() -> None:
    named, bare = (coupled(ELBOW, f"inertia = 0.09\n{more}") for more in ('neighbour = "q1"', ""))
    first, second, without = torques(elbow(1), named, bare, replace(named, effects=()))
    np.testing.assert_array_equal(first, second)
    assert np.ptp(first - without) > 0.1


def test_a_card_with_two_couplings_reads_two_inputs_and_needs_the_sum_of_their_torques() -> None:
    keys = ['inertia = 0.2\nneighbour = "q1"', 'inertia = 0.05\nneighbour = "q3"']
    both, *single = coupled(JOINT, *keys), *(coupled(JOINT, one) for one in keys)
    run = joint(1, {})
    check_neighbours(both, [run])
    none, one, other, together = torques(run, replace(both, effects=()), *single, both)
    np.testing.assert_allclose(together - none, one + other - 2 * none, atol=1e-9)
    assert np.ptp(other - none) > 0.01
    inputs = {variable.name: variable.description for variable in both.model().inputs}
    assert inputs["neighbour_acceleration"] == "Acceleration of the neighbouring axis, `q1`"
    assert inputs["neighbour_acceleration2"] == "Acceleration of the neighbouring axis, `q3`"
    assert "neighbour_acceleration2" not in [variable.name for variable in single[1].model().inputs]
    x, p = np.zeros(2), [variable.start for variable in both.parameters()]
    speeds = [both.model().equations(0, x, [0, 0, *given], p)[0][1] for given in ((1, 0), (0, 1))]
    assert [float(one) for one in speeds] == pytest.approx([-0.2 / 0.3, -0.05 / 0.3])


def test_what_the_equation_of_a_coupling_lacks_makes_no_other_neighbour_a_cause() -> None:
    runs = []
    for seed in (1, 2, 3):
        run = elbow(seed)
        idle = {f"q{k}": tones(run.t, 100 * k + seed, 0.7).q for k in (3, 4)}
        runs.append(Recording.of({**run.table, **idle}, run.name))
    answer = diagnosed(runs, ELBOW).diagnosis
    assert {one.source for one in answer.findings if one.effect == "axis_coupling" and one.parameters} == {"q1"}
