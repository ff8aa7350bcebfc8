"""Which name friction gets: grease that thins or wears in, what is uneven over position, a constant on a carriage."""

from dataclasses import replace

import numpy as np
import pytest
from problems import diagnosed, problem_of
from wandering import recorded, swing

import cosim.diagnosis.diagnose as module
from cosim.data.recording import Recording
from cosim.diagnosis.answer.scores import EffectScores, ResidualScores, Scores, TermScores
from cosim.diagnosis.decide.decision import decide
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import Outcome
from cosim.diagnosis.effects import hypothesis_of, named
from cosim.estimation.prepare import prepare
from pyfmi_models.card import parse_card
from pyfmi_models.effects import LocalFriction, PeriodicFriction, TorqueOffset
from pyfmi_models.effects.concave_viscous import ConcaveViscous
from pyfmi_models.mount import Mount


def card(inertia: float, level: float, viscous: float, motion: str = "rotary") -> str:
    friction = f'[friction]\nmodel = "coulomb"\nFc = {level}\nsigma2 = {viscous}\n'
    return f'[mount]\nname = "carriage"\nmotion = "{motion}"\ninertia = {inertia}\n{friction}'


def mount(*numbers: float) -> Mount:
    return parse_card(card(*numbers), "card.toml").plant()


def thinning(seed: int, exponent: float) -> Recording:
    """A swing of two tones, friction of 2.5 N m and 12 N m s/rad that thins above 0.1 rad/s with this power."""
    t = np.arange(0, 20, 0.01)
    q = 1.2 * np.sin(2 * np.pi * 0.15 * t) + 0.3 * np.sin(2 * np.pi * 0.43 * t + seed)
    v = np.gradient(q, t)
    viscous = 12 * v * (1 + (v / 0.1) ** 2) ** ((exponent - 1) / 2)
    noise = 0.05 * np.random.default_rng(seed).standard_normal(len(t))
    return recorded(30 * np.gradient(v, t) + 2.5 * np.tanh(v / 1e-3) + viscous + noise, t, q, f"run_{seed}")


def of_grease(exponent: float) -> Outcome:
    return diagnosed([thinning(seed, exponent) for seed in (1, 2, 3)], card(30.0, 2.5, 4.0))


def test_grease_that_thins_is_named_with_its_speed_and_power_and_predicts_another_day() -> None:
    outcome = of_grease(0.2)
    assert outcome.diagnosis.verdict == ("concave_viscous",)
    (grease,) = outcome.card.effects
    assert grease.thinning_speed == pytest.approx(0.1, rel=0.3)  # type: ignore[attr-defined]
    assert grease.exponent == pytest.approx(0.2, abs=0.15)  # type: ignore[attr-defined]
    assert outcome.diagnosis.heldout.after_rms < 0.3 * outcome.diagnosis.heldout.before_rms


def test_what_makes_the_held_out_error_larger_is_only_possible_and_not_delivered(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "_is_worse", lambda *_: True)
    outcome = of_grease(0.2)
    grease = next(one for one in outcome.diagnosis.findings if one.effect == "concave_viscous")
    assert outcome.diagnosis.verdict == ("concave_viscous",)
    assert (outcome.card.effects, grease.answer) == ((), "ambiguous")
    assert grease.probability <= 0.5


def test_grease_that_does_not_is_not_and_its_bound_says_from_which_speed_it_would_have_shown() -> None:
    diagnosis = of_grease(1.0).diagnosis
    assert diagnosis.verdict == ()
    seen = {one.effect: one for one in diagnosis.findings}["concave_viscous"]
    assert seen.answer == "not_seen"
    assert "root of the speed" in str(seen)


@pytest.mark.parametrize(("thinning_speed", "degenerate"), [(0.029, True), (0.031, False)])
def test_what_thins_below_the_speeds_that_are_tried_is_a_level(thinning_speed: float, degenerate: bool) -> None:
    """Its share of the top speed; there it would be the contact's friction, and that nothing."""
    problem = problem_of(mount(30.0, 2.5, 4.0), thinning(1, 1.0), cutoff=30.0)
    grease = ConcaveViscous(thinning_speed=thinning_speed * problem.top_speed, exponent=0.0)
    assert hypothesis_of(grease).is_degenerate(problem, grease) is degenerate


@pytest.mark.parametrize(("thinning_speed", "exponent", "shows"), [(0.1, 0.5, True), (0.01, 0.05, False)])
def test_a_bend_next_to_rest_that_a_law_may_have_left_is_not_enough(
    thinning_speed: float, exponent: float, shows: bool
) -> None:
    grease = ConcaveViscous(thinning_speed=thinning_speed, exponent=exponent)
    prepared = prepare([thinning(1, 1.0)], 30.0)
    assert hypothesis_of(grease).shows(grease, mount(30.0, 2.5, 12.0), prepared) is shows


# Friction that falls with use is thermal only where the lubricant is seen to thin; else something without a name.


def wearing(number: int, level: float, viscosity: float) -> Recording:
    """40 s of motion; level and viscosity fall by these shares, with a time constant of 8 s."""
    t, phase = np.arange(4_000) / 100, 0.7 * number
    q, v, a = swing(t, [(0.6, 0.11, phase), (0.25, 0.37, 1 + phase), (0.02, 0.9, 2.0)])
    gone = 1 - np.exp(-t / 8)
    friction = 2 * np.sign(v) * (1 - level * gone) + 2 * v * (1 - viscosity * gone)
    noise = 0.02 * np.random.default_rng(int(10 * phase) + 1).standard_normal(len(t))
    return recorded(5 * a + friction + noise, t, q, f"run {number}")


@pytest.mark.parametrize(("level", "viscosity", "said"), [(0.3, 0.0, "unknown"), (0.1, 0.5, "thermal_viscosity")])
def test_friction_is_thermal_without_a_thermometer_where_viscosity_surely_falls(
    level: float, viscosity: float, said: str
) -> None:
    found = diagnosed([wearing(k, level, viscosity) for k in range(3)], card(5.0, 2.0, 2.0)).diagnosis
    assert found.verdict == (said,)
    rows = [row for row in found.ledger if row.effect == "thermal_viscosity"]
    ways = [rule.outcome for row in rows for rule in row.rules if "surely have the sign" in rule.name]
    assert ways == [said == "thermal_viscosity"]


# Friction of any machine is a little uneven over position: that is no physics a card lacks, ten per cent are.

EVEN = (2.0, 1.0, 3.0)


def rough(share: float, seed: int) -> Recording:
    """An axis, 1.3 rad either way, whose friction rises and falls by so much eight times a turn."""
    t = np.arange(2000) / 100
    q, v, a = swing(t, [(1.2, 0.5 + 0.05 * seed, seed), (0.1, 1.3 + 0.1 * seed, 1.0)], per=1)
    noise = 0.01 * np.random.default_rng(seed).standard_normal(len(t))
    return recorded(2 * a + (1 + share * np.cos(8 * q)) * np.sign(v) + 3 * v + noise, t, q, f"run_{seed}")


@pytest.mark.parametrize(("share", "said"), [(0.02, ()), (0.1, ("position_friction",))])
def test_a_name_needs_more_than_any_machine_is_uneven_by(share: float, said: tuple[str, ...]) -> None:
    runs = [rough(share, seed) for seed in (1, 2, 3)]
    assert diagnosed(runs, card(*EVEN)).diagnosis.verdict == said


LARGE, SMALL = (
    PeriodicFriction(cycles_per_rev=k, relative_amplitude=share, phase=0.0) for k, share in ((8, 0.2), (16, 0.01))
)


@pytest.mark.parametrize(
    ("effects", "plausible"),
    [
        pytest.param((LARGE, SMALL), True, id="a small further wave of a large one"),
        pytest.param((SMALL,), False, id="the small wave alone"),
        pytest.param((LocalFriction(q_center=0.1, width=0.2, relative_amplitude=0.05),), True, id="a rough spot"),
        pytest.param((LocalFriction(q_center=0.1, width=0.2, relative_amplitude=-0.03),), False, id="a smooth spot"),
    ],
)
def test_a_wave_stays_beside_a_large_one_and_a_spot_is_rough(effects: tuple, plausible: bool) -> None:
    own = hypothesis_of(effects[-1])
    assert own.is_plausible(effects[-1], replace(mount(*EVEN), effects=effects)) is plausible


@pytest.mark.parametrize(("uneven", "unknown"), [(0.028, False), (0.029, True)])
def test_nor_is_it_something_unknown(uneven: float, unknown: bool) -> None:
    term = TermScores("friction level over position", 200.0, 0.5, uneven=uneven)
    assert decide(Scores([], ResidualScores(0.0, 0.0, [term])), POLICY).is_unknown == unknown


@pytest.mark.parametrize(("uneven", "unknown"), [(0.01, False), (0.1, True)])
def test_nor_does_it_make_a_name_doubtful(uneven: float, unknown: bool) -> None:
    """A name that explains little stands against 45 nats of another cause, unless as much as itself is left."""
    name = EffectScores("cogging", 200.0, {}, {"cogging": 0.5}, predicted=100.0)
    level = TermScores("friction level over position", 200.0, -0.5, uneven=uneven)
    rest = ResidualScores(0.0, 0.0, [level, TermScores("temperature", 45.0, 0.1)])
    assert decide(Scores([name], rest), POLICY).is_unknown == unknown


# A weight on a linear axis: a constant has two names there, and no recording tells which is right.

FORCE = 20.0
"""More than the friction level, so that no difference of the directions does the same."""


def pushed(seed: int) -> Recording:
    """12 s of a carriage that swings, with the noise of its drive and of its scale."""
    dice, t = np.random.default_rng(seed), np.arange(0, 12, 1 / 250)
    waves = [(0.09, 0.23), (0.035, 0.61), (0.012, 1.7)]
    q, v, acceleration = swing(t, [(a, f, dice.uniform(0, 2 * np.pi)) for a, f in waves])
    tau = 20 * acceleration + 15 * np.tanh(v / 1e-4) + 30 * v + FORCE + dice.normal(0, 0.3, len(t))
    return recorded(tau, t, q + dice.normal(0, 1e-7, len(t)), f"run {seed}")


def test_a_constant_of_a_linear_axis_is_told_as_a_set_of_two_of_which_the_card_holds_one() -> None:
    outcome = diagnosed([pushed(seed) for seed in (1, 2, 3)], card(20.0, 15.0, 30.0, "linear"))
    found = outcome.diagnosis
    assert found.ambiguous_with == (("torque_offset", "constant_force"),)
    first, second = (next(one for one in found.findings if one.effect == name) for name in found.ambiguous_with[0])
    assert first.parameters["torque"] == second.parameters["force"] == pytest.approx(FORCE, rel=0.01)
    assert first.ranges["torque"] == second.ranges["force"]
    assert first.ranges["torque"][0] < FORCE < first.ranges["torque"][1]
    assert first.probability == second.probability == pytest.approx(0.5, abs=0.05)
    said = "A constant force of 20 N pushes the carriage backward: a weight, or an offset of the drive's reading."
    assert second.statement == said
    assert "release the carriage" in first.told_apart_by
    assert not found.next_experiment, "no motion separates the two"
    (held,) = outcome.card.effects
    assert isinstance(held, TorqueOffset)
    assert found.heldout.after_rms < 0.05 * found.heldout.before_rms


def test_an_axis_that_turns_has_a_torque_offset_alone() -> None:
    weight, plant = named("constant_force"), mount(20.0, 15.0, 30.0)
    assert weight.renamed(TorqueOffset(torque=FORCE), plant) is None
    said = weight.why_not(plant, prepare([pushed(1)], 20.0))
    assert said == "on an axis that turns a constant is called a torque offset"
