"""Which name friction gets: what thins, wears in, is uneven or grows with a load; a constant on a carriage."""

from dataclasses import replace

import numpy as np
import pytest
from problems import compared, diagnosed, problem_of
from wandering import recorded, swing

import cosim.diagnosis.diagnose as module
from cosim.data.recording import Recording
from cosim.diagnosis.answer.result import Finding
from cosim.diagnosis.answer.scores import EffectScores, ResidualScores, Scores, TermScores
from cosim.diagnosis.decide.decision import decide
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import Outcome, _problem
from cosim.diagnosis.effects import hypothesis_of, named
from cosim.diagnosis.effects.candidates import at_own_level
from cosim.diagnosis.measure.bounds import not_found
from cosim.diagnosis.measure.findings import _at_own_level
from cosim.diagnosis.search.admissibility import Numbers, is_degenerate
from cosim.diagnosis.search.stages import refitted
from cosim.estimation.prepare import prepare
from pyfmi_models.card import Card, parse_card
from pyfmi_models.effects import LocalFriction, Motion, PeriodicFriction, TorqueOffset
from pyfmi_models.effects.concave_viscous import ConcaveViscous
from pyfmi_models.effects.load_dependent_friction import GearLoadFriction, LoadDependentFriction, LoadScaledFriction
from pyfmi_models.effects.torque_saturation import TorqueSaturation
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


def test_what_raises_the_held_out_error_is_only_possible(monkeypatch: pytest.MonkeyPatch) -> None:
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
def test_a_bend_next_to_rest_is_not_enough(thinning_speed: float, exponent: float, shows: bool) -> None:
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
def test_friction_is_thermal_where_viscosity_surely_falls(level: float, viscosity: float, said: str) -> None:
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


def test_a_small_further_wave_of_a_large_one_stays() -> None:
    large, small = (
        PeriodicFriction(cycles_per_rev=k, relative_amplitude=share, phase=0.0) for k, share in ((8, 0.2), (16, 0.01))
    )
    own, plant = hypothesis_of(small), mount(*EVEN)
    assert own.is_plausible(small, replace(plant, effects=(large, small)))
    assert not own.is_plausible(small, replace(plant, effects=(small,)))


@pytest.mark.parametrize(("rise", "plausible"), [(-0.03, False), (0.05, True)])
def test_a_spot_is_rough_from_there_on(rise: float, plausible: bool) -> None:
    spot = LocalFriction(q_center=0.1, width=0.2, relative_amplitude=rise)
    assert hypothesis_of(spot).is_plausible(spot, mount(*EVEN)) is plausible


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


# Friction that grows with a load: with a weight that the card states, and with all torque that goes through a gear.

PHASE = 0.2


def stated(mgl: float) -> Card:
    """A card that states a load, or none."""
    return parse_card(card(*EVEN) + (f"[unbalance]\nmgl = {mgl}\nphase = {PHASE}\n" if mgl else ""), "card.toml")


def loaded(mgl: float, seed: int) -> Recording:
    """An axis with that load, 1.2 rad either way."""
    t = np.arange(2000) / 100
    q, v, a = swing(t, [(1.2, 0.7, seed), (0.1, 2.3, 1.0)], per=1)
    noise = 0.05 * np.random.default_rng(seed).standard_normal(len(t))
    return recorded(2 * a + np.sign(v) + 3 * v + mgl * np.sin(q + PHASE) + noise, t, q, f"run_{seed}")


def answered(mgl: float) -> Finding:
    """What is said of it where there is none."""
    problem = _problem([loaded(mgl, seed) for seed in (1, 2)], stated(mgl))
    findings = not_found(*compared(problem), [], 0.0)
    return next(one for one in findings if one.effect == "load_dependent_friction")


def test_a_load_of_the_card_gives_a_bound_half_of_it_one_twice_as_large_and_none_the_load_of_a_gear() -> None:
    whole, half, none = (answered(mgl) for mgl in (4.0, 2.0, 0.0))
    for one in (whole, half, none):
        assert one.answer == "not_seen"
        assert one.bound is not None
        assert one.bound.unit == "% of the load"
        assert one.visible_from == one.bound.value
    assert whole.visible_from is not None
    assert 1.0 < whole.visible_from < 6.0
    assert half.visible_from == pytest.approx(2 * whole.visible_from, rel=0.05)


def geared(rise: float, inertia: float, others: float, seed: int) -> Recording:
    """Quick moves of an axis without a weight, friction of which rises by so much per unit through its gear."""
    t = np.arange(4000) / 200
    q, v, a = swing(t, [(1.5 / 1.9, 1.9, seed - np.pi / 2), (0.8 / 5.3, 5.3, 1 - np.pi / 2)], per=1)
    friction = np.sign(v) + 3 * v
    for _ in range(60):  # the friction is part of what goes through, which is part of friction
        friction = (1 + rise * np.abs(inertia * 2 * a + others * friction)) * np.sign(v) + 3 * v
    noise = 0.05 * np.random.default_rng(seed).standard_normal(len(t))
    return recorded(2 * a + friction + noise, t, q, f"run_{seed}")


@pytest.mark.parametrize("others", [0.0, 1.0])
def test_a_gear_is_told_from_a_drive_that_gives_less_and_by_the_side_that_feels_the_torque(others: float) -> None:
    problem = _problem([geared(0.15, 1.0, others, seed) for seed in (1, 2)], stated(0.0))
    comparison, base = compared(problem)
    sides = [
        GearLoadFriction(coulomb_per_Nm=0.01, at_level=1.0, inertia_share=1.0, friction_share=one)
        for one in (others, 1 - others)
    ]
    right, wrong, drive = (
        refitted(comparison, base, one, 2) for one in (*sides, TorqueSaturation(knee_torque=8.0, slope=0.5))
    )
    assert right.effect.coulomb_per_Nm == pytest.approx(0.15, rel=0.1)  # type: ignore[attr-defined]
    assert right.evidence > max(wrong.evidence, drive.evidence) + POLICY.clear
    assert not is_degenerate(problem, right.effect)


def test_the_rise_is_told_beside_the_level_that_was_fitted_not_beside_the_one_the_fit_began_with() -> None:
    plant = mount(2.0, 0.75, 3.0)
    begun = LoadScaledFriction(coulomb_per_Nm=0.1, at_level=1.25)
    told = at_own_level(begun, plant)
    assert isinstance(told, LoadScaledFriction)
    assert (told.coulomb_per_Nm, told.at_level) == pytest.approx((0.06, 0.75))
    for payload in (0.0, 3.0):
        motion = Motion(t=0.0, q=0.0, v=1.0, angle=0.0, payload=payload)
        assert float(told.level(0.75, motion)) == pytest.approx(float(begun.level(0.75, motion)))
    numbers = Numbers({"coulomb_per_Nm": 0.1, "at_level": 1.25}, {"coulomb_per_Nm": 0.01})
    assert _at_own_level(begun, numbers, plant)[1].errors == pytest.approx({"coulomb_per_Nm": 0.006})
    plain = LoadDependentFriction(coulomb_per_Nm=0.1)
    assert at_own_level(plain, plant) is plain
