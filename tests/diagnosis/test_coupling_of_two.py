"""A weight behind two neighbouring axes goes with three angles: their sum, or eight products."""

import numpy as np
import pytest
from problems import diagnosed
from scipy.spatial.transform import Rotation
from two_links import TIP, WRIST, forearm, wrist

from cosim.diagnosis.trust.admission import check_neighbours
from cosim.estimation.neighbours import as_inputs
from cosim_investigation.questions import effect_of
from pyfmi_models.card import parse_card
from pyfmi_models.card_writer import card_text
from pyfmi_models.effects.axis_coupling import PRODUCTS, ChainCoupling, SpaceCoupling
from pyfmi_models.effects.base import Motion


def test_a_weight_behind_three_parallel_axes_has_its_size_and_delivers_a_card_that_reads_both() -> None:
    outcome = diagnosed([wrist(seed, idle=1) for seed in (1, 2, 3)], WRIST)
    named = {one.name: one for one in outcome.diagnosis.findings if one.answer == "found"}
    assert next(iter(named)) == "axis_coupling:q1 + q2"
    assert not [name for name in named if "q4" in name]
    one, (_, mass, lever) = named["axis_coupling:q1 + q2"], TIP
    assert one.parameters["weight"] == pytest.approx(mass * 9.81 * lever, rel=0.03)
    assert one.parameters["phase"] == pytest.approx(0.0, abs=0.03)
    assert (one.parameters["follows"], one.parameters["follows_second"]) == (1.0, 1.0)
    assert one.statement.startswith("Two neighbouring axes act on this one: a weight of 1.1")
    assert one.statement.endswith("that goes with the angle this axis + `q1` + `q2`.")
    held = outcome.diagnosis.heldout
    assert held.after_rms < 0.2 * held.before_rms

    again, run = parse_card(card_text(outcome.card, ""), "card.toml").plant(), wrist(1)
    assert {one.name for one in again.effects} == {*named}
    check_neighbours(again, [run])
    assert np.ptp(as_inputs(run, again, 15.0)["second_neighbour_position"] - run["q2"]) < 0.05 * np.ptp(run["q2"])
    assert isinstance(effect_of(one), ChainCoupling)
    assert effect_of(one).name == one.name


def test_a_weight_on_axes_that_point_elsewhere_is_one_of_eight_products() -> None:
    answer = diagnosed([forearm(seed) for seed in (1, 2, 3)], WRIST).diagnosis
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
    hung = [
        float(space.load(Motion(0.0, a, 0.0, a, {"neighbour_position": b, "second_neighbour_position": c})))
        for a, b, c in zip(q, first, second, strict=True)
    ]
    np.testing.assert_allclose(torque - hung, -np.sin(q) * np.sin(first), atol=1e-12)
