"""Learned terms: tables as data in a card, the same in NumPy, CasADi and FMU; their limits, what a reader is given."""

import math
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from effect_examples import evaluate, mount

from pyfmi_models.card import parse_card
from pyfmi_models.effects.learned import LearnedFriction, LearnedTorque
from pyfmi_models.effects.learned_drive import LearnedDrive
from pyfmi_models.effects.learned_memory import LearnedAfterReversal, LearnedHysteresis
from pyfmi_models.errors import CardError
from pyfmi_models.waves import input_of, span, spoken, waves

CARD = '[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\nsigma2 = 3.0\n'


def test_what_goes_over_the_way_counts_it_there_and_back() -> None:
    effect = LearnedFriction(over="way", seen=(0.0, 2.0), level_change=(0.0, 0.5))
    here = mount(effect).at(0.0, 0.0, -0.7, {})._replace(state=[1.0])
    assert float(ca.DM(effect.rate(here))) == 0.7
    assert float(effect.level(1.0, here)) == pytest.approx(1.0)
    assert float(effect.level(1.0, here._replace(state=[0.0]))) == pytest.approx(np.exp(0.5))


def test_a_drive_that_gives_less_for_more_is_refused_or_made_smaller_until_it_gives_more() -> None:
    """One wave is steepest at zero, where its place rises by (1 / w) / (2 / (1 + w)) a command, w = 0.05."""
    rise = (1 / 0.05) / (2 / 1.05)
    falls = LearnedDrive(command_seen=(-1.0, 1.0), missing=(0.0, -1.05 / (math.pi * rise)))
    assert falls.broken_rule() == "the drive gives less where it is asked for more"
    assert falls.admitted().broken_rule() == ""
    assert falls.admitted().missing[1] == pytest.approx(falls.missing[1] * 0.99 / 1.05, rel=0.05)
    as_it_is = replace(falls, missing=(0.0, -0.95 / (math.pi * rise)))
    assert as_it_is.broken_rule() == ""
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


def test_the_range_is_in_the_description_of_the_model() -> None:
    said = mount(LearnedTorque(over="position", seen=(-1.0, 1.2), torque=(0.3, 0.5))).model().description
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


# Tables at the limits of what a card may hold, and what a reader is given of them.

ROWS, COLUMNS = 41, 5
"""Of a table for a reader: values over one quantity, and over the second."""


def torque(count: int, **more: Any) -> LearnedTorque:
    return LearnedTorque(**({"over": "position", "seen": (-1.0, 3.0), "torque": (0.1,) * count} | more))


@pytest.mark.parametrize(
    ("table", "rule"),
    [
        (torque(1), ""),
        (torque(160), ""),
        (torque(161), "the table has 161 coefficients; it needs 1 to 160"),
        (torque(0), "the table has 0 coefficients; it needs 1 to 160"),
        (torque(1, over="turn", seen=()), ""),
        (torque(3, over="turn", seen=()), ""),
        (torque(2, over="turn", seen=()), "an odd number"),
        (torque(6, by="speed", by_seen=(0.0, 1.0), waves=(2, 1)), ""),
        (torque(5, by="speed", by_seen=(0.0, 1.0), waves=(2, 1)), "it needs 6"),
        (torque(6, by="speed", by_seen=(0.0, 1.0), waves=(2.5, 1)), "two whole numbers"),
        (torque(6, by="speed", by_seen=(0.0, 1.0), waves=(5,)), "two whole numbers"),
        (torque(6, by="turn", by_seen=(), waves=(2, 1)), "over the turn has no second"),
        (torque(6, over="turn", seen=(), by="speed", by_seen=(0.0, 1.0), waves=(2, 1)), "over the turn has no second"),
        (torque(6, by="speed", by_seen=(1.0, 1.0), waves=(2, 1)), "by_seen must be two numbers"),
        (torque(1, by="command", by_seen=(0.0, 1.0), waves=(0, 0)), "what goes over the command is the drive's"),
        (torque(2, by_seen=(0.0, 1.0)), "belong to a table of products"),
        (torque(1, seen=(0.0, 1.0, 2.0)), "seen must be two numbers"),
        (torque(1, seen=(1.0, 1.0)), "seen must be two numbers"),
        (torque(1, seen=(0.0, math.inf)), "seen must be two numbers"),
        (torque(1, seen=(math.nan, 1.0)), "seen must be two numbers"),
        (torque(1, over="turn", seen=(0.0, 1.0)), "seen is not for the turn"),
        (torque(1, over="input.oil"), ""),
        (torque(1, over="input.öl"), '"input.öl" is no quantity'),
        (torque(1, over="input."), '"input." is no quantity'),
        (torque(1, over="oil"), '"oil" is no quantity'),
        (LearnedDrive(command_seen=(-1.0, 1.0), missing=(0.0,) * 40), ""),
        (LearnedDrive(command_seen=(-1.0, 1.0), missing=(0.0,) * 41), "missing has 41 coefficients; it needs 1 to 40"),
        (LearnedHysteresis(strokes=(0.1,) * 12, torque=(1.0,) * 12), ""),
        (LearnedHysteresis(strokes=(0.1,) * 13, torque=(1.0,) * 13), "it has 13 coefficients for 13 ways"),
        (LearnedHysteresis(strokes=(), torque=()), "it has 0 coefficients for 0 ways"),
        (LearnedHysteresis(strokes=(1e-9,), torque=(1.0,)), ""),
        (LearnedHysteresis(strokes=(0.9e-9,), torque=(1.0,)), "9e-10 is no way or time; it must be above 0"),
        (LearnedAfterReversal(ways=(0.1,), times=(0.2, 0.3), level_change=(0.1, 0.2, 0.3)), ""),
        (LearnedAfterReversal(ways=(0.1,), times=(0.2, 0.3), level_change=(0.1, 0.2)), "2 coefficients for 3 ways"),
    ],
)
def test_a_table_is_taken_up_to_its_limits_and_refused_beyond(table: Any, rule: str) -> None:
    found = table.broken_rule()
    assert rule in found
    assert bool(found) == bool(rule)


def test_a_reader_is_given_rows_of_one_quantity_and_columns_of_two() -> None:
    told = torque(2).for_reader("N")
    at, value = np.array(told["at"]), np.array(told["value"])
    assert (told["kind"], told["unit"], told["over"], len(at)) == ("torque", "N", "position", ROWS)
    np.testing.assert_allclose(at, np.linspace(-1, 3, ROWS))
    np.testing.assert_allclose(value, 0.1 + 0.1 * np.cos(np.pi * (at + 1) / 4), rtol=1e-12)
    two = {"over": "position", "seen": (0.0, 2.0), "by": "input.oil", "by_seen": (10.0, 30.0), "waves": (1, 1)}
    both = LearnedFriction(**two, level_change=(0.1, 0, 0, 0.2))
    told = both.for_reader("N.m")
    assert (told["unit"], told["by"], len(told["by_at"])) == ("1", "oil", COLUMNS)
    x, y = np.meshgrid(np.linspace(0, 1, ROWS), np.linspace(0, 1, COLUMNS), indexing="ij")
    expected = np.exp(0.1 + 0.2 * np.cos(np.pi * x) * np.cos(np.pi * y)) - 1
    np.testing.assert_allclose(told["value"], expected, rtol=1e-9)
    assert both.size() == pytest.approx(0.2)
    assert [one.start for one in both.inputs()] == [20.0]


def test_a_table_of_two_is_told_at_the_middle_of_the_second_or_where_it_is_asked() -> None:
    table = torque(4, by="speed", by_seen=(0.0, 2.0), waves=(1, 1), torque=(0.0, 1.0, 0.0, 0.0))
    middle, asked = (table.values(3, other)[1] for other in (None, 0.5))
    dense = [u / (u + 0.1) for u in (0.5, 1.0, 2.0)]
    np.testing.assert_allclose(middle, np.cos(np.pi * dense[1] / dense[2]), rtol=1e-12)
    np.testing.assert_allclose(asked, np.cos(np.pi * dense[0] / dense[2]), rtol=1e-12)


def test_a_drives_table_is_told_over_its_commands() -> None:
    drive = LearnedDrive(command_seen=(-2.0, 2.0), missing=(0.3, 0.01), share=0.5)
    command, missing = drive.curve(5)
    np.testing.assert_allclose(command, [-2, -1, 0, 1, 2])
    place = np.array([0, (-1 / 1.1 + 2 / 2.1) / (4 / 2.1), 0.5, (1 / 1.1 + 2 / 2.1) / (4 / 2.1), 1])
    np.testing.assert_allclose(missing, 0.5 * (0.3 + 0.01 * np.cos(np.pi * place)), atol=1e-15)
    assert drive.size() == pytest.approx(0.005)
    told = drive.for_reader("N.m")
    assert (told["kind"], told["unit"], len(told["command"]), len(told["missing"])) == ("drive", "N.m", ROWS, ROWS)


@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_waves_are_cosines_of_the_place_and_over_a_turn_of_the_angle(count: int) -> None:
    for value in (-2.0, -1.0, 0.3, 2.9, 4.0):
        place = min(max((value + 1) / 4, 0.0), 1.0)
        found = [float(one) for one in waves(value, "position", (-1.0, 3.0), count)]
        np.testing.assert_allclose(found, [math.cos(math.pi * k * place) for k in range(count + 1)], atol=1e-13)
        turned = [float(one) for one in waves(value, "turn", (), count)]
        pairs = [f(k * value) for k in range(1, count + 1) for f in (math.cos, math.sin)]
        np.testing.assert_allclose(turned, [1.0, *pairs], atol=1e-12)


def test_a_quantity_is_an_input_where_it_is_none_of_the_axis() -> None:
    assert input_of("position", (0.0, 1.0)) == ()
    (oil,) = input_of("input.oil", (1.0, 4.0))
    assert (oil.name, oil.unit, oil.start) == ("oil", "1", 2.5)
    (warm,) = input_of("temperature", (0.0, 40.0))
    assert (warm.unit, warm.start) == ("degC", 20.0), "the card holds at 20 degC, whatever was seen"


def test_a_range_is_said_in_its_unit() -> None:
    assert span("position", (-1.0, 1.25)) == "position -1 to 1.25 rad"
    assert span("speed", (-1.0, 1.25), linear=True) == "speed -1 to 1.25 m/s"
    assert span("payload", (0.0, 12.0), linear=True) == "payload 0 to 12 N"
    assert span("turn", ()) == "the whole turn"
    assert span("input.oil", (0.0, 1.0)) == "oil 0 to 1"
    assert spoken("turn") == "position over the turn"


@pytest.mark.parametrize(
    ("ways", "said"), [((0.1,), "over the way since a reversal"), ((), "over the time since a reversal")]
)
def test_a_memory_says_what_it_forgets_over_and_how_much_it_changes(ways: tuple[float, ...], said: str) -> None:
    times = () if ways else (0.2,)
    found = LearnedAfterReversal(ways=ways, times=times, level_change=(math.log(0.75),))
    assert found.learned_in() == said
    assert found.statement() == "After a reversal friction is 25 % lower for a while; learned from data."
    assert found.for_reader("N") == {
        "kind": "friction after a reversal",
        "ways": list(ways),
        "times": list(times),
        "level_change": [math.log(0.75)],
        "unit": "1",
    }
    loop = LearnedHysteresis(strokes=(0.1, 0.4), torque=(0.2, 0.3))
    assert loop.statement("N") == "Something goes round a loop of 0.5 N either way; learned from data."
    assert loop.for_reader("N") == {"kind": "hysteresis", "strokes": [0.1, 0.4], "torque": [0.2, 0.3], "unit": "N"}
