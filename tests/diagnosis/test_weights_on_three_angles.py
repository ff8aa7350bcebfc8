"""A weight that hangs on three axes is found with both neighbours, as one sine of their sum or as products of sines."""

import re
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from two_links import TIP, forearm, wrist

from cosim.diagnosis.diagnose import Outcome, diagnose
from cosim.diagnosis.trust.admission import check_neighbours
from cosim.estimation.neighbours import as_inputs
from cosim.support.errors import RecordingError
from cosim_investigation.questions import effect_of
from pyfmi_models.card import CardError, parse_card
from pyfmi_models.card_writer import card_text
from pyfmi_models.effects.axis_coupling import PRODUCTS, ChainCoupling, SpaceCoupling
from pyfmi_models.effects.base import Motion

CARD = """
[mount]
name = "wrist"
inertia = 0.06
[friction]
model = "coulomb"
Fc = 0.15
sigma2 = 0.08
"""
_, MASS, LEVER = TIP


@cache
def of_wrist() -> Outcome:
    runs = [wrist(seed, idle=1) for seed in (1, 2, 3)]
    return diagnose(runs[:2], runs[2:], parse_card(CARD, "card.toml"))


def test_a_weight_behind_three_parallel_axes_has_its_size_and_delivers_a_card_that_reads_both() -> None:
    outcome = of_wrist()
    named = {one.name: one for one in outcome.diagnosis.findings if one.answer == "found"}
    assert next(iter(named)) == "axis_coupling:q1 + q2"
    assert not [name for name in named if "q4" in name]
    one = named["axis_coupling:q1 + q2"]
    assert one.parameters["weight"] == pytest.approx(MASS * 9.81 * LEVER, rel=0.03)
    assert one.parameters["phase"] == pytest.approx(0.0, abs=0.03)
    assert (one.parameters["follows"], one.parameters["follows_second"]) == (1.0, 1.0)
    assert one.statement.startswith("Two neighbouring axes act on this one: a weight of 1.1")
    assert one.statement.endswith("that goes with the angle this axis + `q1` + `q2`.")
    held = outcome.diagnosis.heldout
    assert held.after_rms < 0.2 * held.before_rms

    again = parse_card(card_text(outcome.card, ""), "card.toml").plant()
    assert {one.name for one in again.effects} == {*named}
    assert again.recorded_as()["second_neighbour_position"] == "q2 position"
    assert isinstance(effect_of(one), ChainCoupling)
    assert effect_of(one).name == one.name


def test_a_weight_on_axes_that_point_elsewhere_is_one_of_eight_products() -> None:
    runs = [forearm(seed) for seed in (1, 2, 3)]
    answer = diagnose(runs[:2], runs[2:], parse_card(CARD, "card.toml")).diagnosis
    first = next(one for one in answer.findings if one.answer == "found")
    assert (first.name, {*first.parameters}) == ("axis_coupling:q1 + q2", {*PRODUCTS})
    assert answer.heldout.after_rms < 0.25 * answer.heldout.before_rms


def test_eight_products_hold_the_torque_of_a_weight_that_three_turns_about_any_axes_move() -> None:
    """But for what hangs on fewer of them: each of axes x, y, x is at right angles to the one before."""
    dice = np.random.default_rng(1)
    q, first, second = dice.uniform(-2, 2, (3, 200))
    turns = [Rotation.from_euler(axis, angle[:, None]) for axis, angle in zip("xyx", (first, second, q), strict=True)]
    along = (turns[0] * turns[1]).apply([1.0, 0.0, 0.0])
    arm = (turns[0] * turns[1] * turns[2]).apply([0.0, 1.0, 0.0])
    torque = -np.sum(along * np.cross(arm, [0.0, 0.0, -1.0]), axis=1)

    space = SpaceCoupling(ccc=1.0)
    inputs = {"neighbour_position": first, "second_neighbour_position": second}
    hung = [
        float(space.load(Motion(0.0, a, 0.0, a, {"neighbour_position": b, "second_neighbour_position": c})))
        for a, b, c in zip(q, *inputs.values(), strict=True)
    ]
    np.testing.assert_allclose(torque - hung, -np.sin(q) * np.sin(first), atol=1e-12)


def test_a_sentence_says_which_angles_turn_a_weight_and_which_way() -> None:
    said = ChainCoupling(weight=2.0, follows=-1.0, follows_second=-1.0, neighbour="a + b").statement()
    assert said.endswith("a weight of 2 N·m that goes with the angle - this axis + `a` - `b`.")
    said = ChainCoupling(weight=2.0, follows=0.0, follows_second=1.0, neighbour="a + b").statement("N")
    assert said.endswith("a weight of 2 N that goes with the angle `a` + `b`.")
    said = SpaceCoupling(sss=3.0, ccc=-4.0, neighbour="a + b").statement()
    assert said.endswith("a weight of 5 N·m at most that goes with three angles, this axis', `a` and `b`.")


def test_each_of_both_columns_must_be_there() -> None:
    text = '[[effects]]\neffect="axis_coupling"\nweight=1.0\nfollows_second=1.0\nneighbour="q1 + {}"\n'
    run, (there, missing) = wrist(1), (parse_card(CARD + text.format(name), "c").plant() for name in ("q2", "q9"))
    check_neighbours(there, [run])
    fed = as_inputs(run, there, 15.0)
    assert np.ptp(fed["second_neighbour_position"] - run["q2"]) < 0.05 * np.ptp(run["q2"])
    with pytest.raises(RecordingError, match=r'reads "q9", which this recording lacks'):
        check_neighbours(missing, [run])


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
        parse_card(CARD + f'[[effects]]\neffect="axis_coupling"\n{keys}\n', "c")
