"""Learned terms: tables as data in a card, the same in NumPy, CasADi and FMU; what they may not do."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from effect_examples import EXAMPLES, evaluate, mount

from pyfmi_models.card import parse_card
from pyfmi_models.card_writer import card_text
from pyfmi_models.effects.base import Effect
from pyfmi_models.effects.learned import LearnedFriction, LearnedTorque
from pyfmi_models.effects.learned_drive import LearnedDrive
from pyfmi_models.effects.learned_memory import LearnedAfterReversal, LearnedHysteresis
from pyfmi_models.errors import CardError

LEARNED = [one for one in EXAMPLES if one.id == "learned"]
NAMED = pytest.mark.parametrize("effect", LEARNED, ids=lambda one: type(one).__name__)
CARD = '[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\nsigma2 = 3.0\n'
OVER_POSITION = {"over": "position", "seen": (-1.0, 1.2), "torque": (0.3, 0.5, -0.2, 0.1)}


@NAMED
def test_a_card_keeps_every_digit_of_a_table(effect) -> None:
    given = parse_card(CARD, "a.toml")
    back = parse_card(card_text(replace(given, effects=(effect, effect))), "b.toml")
    assert back.effects == (effect, effect)


def test_what_goes_over_the_way_counts_it_there_and_back() -> None:
    effect = LearnedFriction(over="way", seen=(0.0, 2.0), level_change=(0.0, 0.5))
    here = mount(effect).at(0.0, 0.0, -0.7, {})._replace(state=[1.0])
    assert float(ca.DM(effect.rate(here))) == 0.7
    assert float(effect.level(1.0, here)) == pytest.approx(1.0)
    assert float(effect.level(1.0, here._replace(state=[0.0]))) == pytest.approx(np.exp(0.5))


def test_a_drive_that_overshoots_a_little_is_made_smaller_until_more_command_gives_more() -> None:
    """One wave is steepest at zero, where its place rises by 10.5 a command (`test_learned_limits.py`)."""
    falls = LearnedDrive(command_seen=(-1.0, 1.0), missing=(0.0, -1.1 / (np.pi * 10.5)))
    assert "less where it is asked for more" in falls.broken_rule()
    assert falls.admitted().broken_rule() == ""
    assert falls.admitted().missing[1] == pytest.approx(falls.missing[1] * 0.99 / 1.1, rel=0.05)
    as_it_is = replace(falls, missing=(0.0, -0.9 / (np.pi * 10.5)))
    assert as_it_is.admitted() is as_it_is


def test_a_drive_that_rises_too_fast_about_no_command_keeps_what_it_misses_of_large_ones() -> None:
    """Waves cannot end at the kinks of a dead band: they overshoot its slope of one."""
    missing = (0.0, -0.75, 0.0, 0.085, 0.0, 0.041, 0.0, -0.01, 0.0, -0.017, 0.0, -0.01)
    steep = LearnedDrive(command_seen=(-14.0, 14.0), missing=missing)
    assert "less where it is asked for more" in steep.broken_rule()
    flat = steep.admitted()
    assert flat.broken_rule() == ""
    command, old = steep.curve(201)
    large = np.abs(command) > 3
    assert np.abs(flat.curve(201)[1] - old)[large].max() < 0.2 * np.abs(old[large]).max()


@pytest.mark.parametrize("over", ["position", "speed", "input.load"])
def test_beyond_its_range_a_table_is_constant_and_its_slope_is_continuous(over: str) -> None:
    effect = LearnedTorque(over=over, seen=(-0.4, 0.8), torque=(0.1, 0.5, -0.7, 0.3))
    s = ca.SX.sym("s")
    given = {"position": {"q": s}, "speed": {"v": s}, "input.load": {"inputs": {"load": s}}}[over]
    here = mount(effect)
    motion = here.at(0.0, given.get("q", 0.0), given.get("v", 0.0), given.get("inputs", {}))
    value = effect.load(motion)
    f = ca.Function("f", [s], [value, ca.jacobian(value, s)])
    for edge, out in ((-0.4, -1), (0.8, 1)):
        inside, slope = (float(part) for part in f(edge - 1e-7 * out))
        beyond, flat = (float(part) for part in f(edge + 5.0 * out))
        assert flat == 0
        assert abs(slope) < 1e-4
        assert beyond == pytest.approx(inside, abs=1e-9)


def test_an_input_of_the_plant_is_what_a_table_goes_over() -> None:
    effect = LearnedTorque(over="input.load", seen=(0.0, 10.0), torque=(0.0, 1.0))
    model = mount(effect).model()
    assert [one.name for one in model.inputs] == ["tau", "disturbance", "load"]
    heavy, light = (evaluate(model, load=load)["der(speed)"] for load in (10.0, 0.0))
    assert (heavy - light) * 2.0 == pytest.approx(2.0)


@pytest.mark.parametrize("kind", [LearnedAfterReversal, LearnedHysteresis])
def test_elements_are_named_from_one_on_and_remember_a_direction(kind: type[Effect]) -> None:
    """Names of states are promises: recordings and FMUs hold them."""
    (effect,) = [one for one in LEARNED if type(one) is kind]
    states = effect.states()
    assert [one.name for one in states] == [f"memory{k + 1}" for k in range(len(states))]
    assert {(one.low, one.high, one.start, one.unit) for one in states} == {(-1, 1, 0, "1")}


def test_the_range_is_in_the_description_of_the_model() -> None:
    said = mount(LearnedTorque(**OVER_POSITION)).model().description
    assert said == "m: one axis with coulomb friction, learned over position -1 to 1.2 rad"
    linear = mount(LearnedHysteresis(strokes=(0.1, 0.4), torque=(0.2, 0.3)), motion="linear").model().description
    assert linear.endswith("learned over strokes of 0.1 to 0.4 m")


@pytest.mark.parametrize(
    ("table", "rule"),
    [
        ('over = "positon"\nseen = [0, 1]\ntorque = [1]', '"positon" is no quantity; quantities are: position, turn,'),
        ('over = "position"\nseen = [1, 0]\ntorque = [1]', "the lower one first"),
        ('over = "position"\ntorque = [1]', "seen must be two numbers"),
        ("over = 3\nseen = [0, 1]\ntorque = [1]", "over = 3 is not a text"),
        ('over = "position"\nseen = [0, 1]\ntorque = [true]', "torque[1] = True is not a number"),
        ('over = "position"\nseen = [0, 1]\nlevel_change = [9]', "level_change[1] = 9 is outside -5 .. 5"),
        ('over = "turn"\nseen = [0, 1]\ntorque = [1]', "seen is not for the turn"),
        ('over = "command"\nseen = [0, 1]\ntorque = [1]', "command_seen and missing"),
        ('over = "way"\nseen = [0, 1]\nmore_command = [0.1]', "way"),
        ('over = "input.a b"\nseen = [0, 1]\ntorque = [1]', '"input.a b" is no quantity'),
        ("strokes = [0.1]\ntorque = [-1]", "torque[1] = -1 is outside 0"),
        ("times = [0]\nlevel_change = [1]", "times[1] = 0 is outside"),
        ('over = "position"\nseen = [0, 1]\ntorqe = [1]', "is not a key here"),
    ],
)
def test_nonsense_is_refused_in_one_sentence(table: str, rule: str) -> None:
    with pytest.raises(CardError) as caught:
        parse_card(f'{CARD}[[effects]]\neffect = "learned"\n{table}\n', "a.toml")
    assert rule in str(caught.value)
    assert str(caught.value).startswith("a.toml: [[effects]] number 1 (learned)")
    assert "\n" not in str(caught.value)
