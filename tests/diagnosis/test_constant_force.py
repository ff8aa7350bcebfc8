"""A weight on a linear axis: a constant has two names there, and no recording tells which is right."""

from functools import cache

import numpy as np
import pytest
from wandering import swing

from cosim.data.recording import Recording
from cosim.diagnosis.diagnose import Outcome, diagnose
from cosim.diagnosis.effects import named
from cosim.estimation.prepare import prepare
from pyfmi_models.card import Card, parse_card
from pyfmi_models.effects import TorqueOffset

FORCE = 20.0
"""More than the friction level, so that no difference of the directions does the same."""
CARD = """
[mount]
name = "carriage"
motion = "{motion}"
inertia = 20.0
[friction]
model = "coulomb"
Fc = 15.0
sigma2 = 30.0
"""


def card(motion: str) -> Card:
    return parse_card(CARD.format(motion=motion), "card.toml")


def recorded(seed: int, force: float = FORCE) -> Recording:
    """12 s of a carriage that swings, with the noise of its drive and of its scale."""
    dice, t = np.random.default_rng(seed), np.arange(0, 12, 1 / 250)
    waves = [(0.09, 0.23), (0.035, 0.61), (0.012, 1.7)]
    q, v, acceleration = swing(t, [(a, f, dice.uniform(0, 2 * np.pi)) for a, f in waves])
    tau = 20 * acceleration + 15 * np.tanh(v / 1e-4) + 30 * v + force + dice.normal(0, 0.3, len(t))
    return Recording.of({"t": t, "tau": tau, "q": q + dice.normal(0, 1e-7, len(t))}, f"run {seed}")


@cache
def outcome() -> Outcome:
    return diagnose([recorded(1), recorded(2)], [recorded(3)], card("linear"))


def test_a_constant_of_a_linear_axis_is_told_as_a_set_of_two() -> None:
    found = outcome().diagnosis
    assert found.ambiguous_with == (("torque_offset", "constant_force"),)
    first, second = (next(one for one in found.findings if one.effect == name) for name in found.ambiguous_with[0])
    assert first.parameters["torque"] == second.parameters["force"] == pytest.approx(FORCE, rel=0.01)
    assert first.ranges["torque"] == second.ranges["force"]
    assert first.ranges["torque"][0] < FORCE < first.ranges["torque"][1]
    assert first.probability == second.probability == pytest.approx(0.5, abs=0.05)
    assert (
        second.statement
        == "A constant force of 20 N pushes the carriage backward: a weight, or an offset of the drive's reading."
    )
    assert "release the carriage" in first.told_apart_by
    assert not found.next_experiment, "no motion separates the two"


def test_the_card_holds_one_of_both_and_the_better_error() -> None:
    (held,) = outcome().card.effects
    assert isinstance(held, TorqueOffset)
    assert outcome().diagnosis.heldout.after_rms < 0.05 * outcome().diagnosis.heldout.before_rms


def test_an_axis_that_turns_has_a_torque_offset_alone() -> None:
    weight, plant = named("constant_force"), card("rotary").plant()
    assert weight.renamed(TorqueOffset(torque=FORCE), plant) is None
    said = weight.why_not(plant, prepare([recorded(1)], 20.0))
    assert said == "on an axis that turns a constant is called a torque offset"
