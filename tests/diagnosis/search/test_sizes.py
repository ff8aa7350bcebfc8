"""The size of an effect is told by its 95 % range, and never at a bound, nor where the effect is really another."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from wandering import posed, swing
from wandering import recorded as axis_read

from cosim.data.recording import Recording
from cosim.diagnosis.answer.result import Finding
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import _problem
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.effects.tuning import ANY, at_bound
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.measure.bounds import not_found
from cosim.diagnosis.search.admissibility import (
    Numbers,
    in_time,
    is_degenerate,
    is_told,
    needs_turns,
    numbers_of,
    standard_errors,
)
from cosim.diagnosis.search.candidate_fit import CandidateFit, margin
from cosim.diagnosis.search.stages import refitted
from cosim.estimation.blocks import Blocks
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from pyfmi_models.card import parse_card
from pyfmi_models.effects import (
    ActuatorLag,
    Cogging,
    Delay,
    Effect,
    FrictionAsymmetry,
    GravityUnbalance,
    LocalFriction,
    PeriodicFriction,
    StribeckEffect,
    TorqueOffset,
)
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.cable_wrap import CableWrap
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.effects.inertia_variation import InertiaVariation
from pyfmi_models.effects.presliding import Presliding
from pyfmi_models.effects.thermal_viscosity import ThermalViscosity, WarmingViscosity
from pyfmi_models.friction import Coulomb, LuGre
from pyfmi_models.model import Recorded, parameters_of
from pyfmi_models.mount import Axis, Mount

MOUNT = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=1.0))
VISITED = Recorded(speed=2.0, torque=9.0)
LONGEST = {one.name: one for one in parameters_of(Delay(delay_ms=1.0))}["delay_ms"].high
MIDDLE = Delay(delay_ms=0.5 * LONGEST)


@pytest.mark.parametrize(
    ("viscous", "level", "error", "told"),
    [
        (-0.03, 0.0, 0.01, True),
        (-0.03, 0.0, 0.02, False),  # the range holds none
        (0.0, 0.03, 0.01, True),  # one of two is enough
        (-1.0, 0.0, 0.01, False),  # at a bound, however narrow the range
        (-1.0, 0.03, 0.01, True),
        (-0.9, 0.9, 1.2, False),  # all that it may be
    ],
)
@pytest.mark.parametrize("form", [ThermalViscosity, WarmingViscosity])
def test_a_size_is_told_by_a_range_without_none_and_away_from_bounds(form, viscous, level, error, told):
    more = {"warm_up_degC": 10.0} if form is WarmingViscosity else {}
    effect = form(viscous_per_degC=viscous, coulomb_per_degC=level, **more)
    names = ("viscous_per_degC", "coulomb_per_degC")
    numbers = Numbers({name: getattr(effect, name) for name in names}, dict.fromkeys(names, error))
    assert is_told(effect, numbers, MOUNT, VISITED) is told


@pytest.mark.parametrize(
    ("effect", "errors", "told"),
    [
        pytest.param(TorqueOffset(torque=1.0), {"torque": 1 / 1.97}, True, id="none lies beyond the 95 % range"),
        pytest.param(TorqueOffset(torque=1.0), {"torque": 1 / 1.95}, False, id="none lies in it"),
        pytest.param(TorqueOffset(torque=-1.0), {"torque": 1 / 1.97}, True, id="a negative one is as good"),
        pytest.param(TorqueOffset(torque=-1.0), {"torque": 1 / 1.95}, False, id="negative, and none in its range"),
        pytest.param(Delay(delay_ms=LONGEST), {"delay_ms": 0.01 * LONGEST}, False, id="at a bound"),
        pytest.param(Delay(delay_ms=0.999 * LONGEST), {"delay_ms": 0.01 * LONGEST}, True, id="near a bound"),
        pytest.param(MIDDLE, {"delay_ms": 0.2 * LONGEST}, True, id="a range that holds much of what it may be"),
        pytest.param(MIDDLE, {"delay_ms": 0.3 * LONGEST}, False, id="a range that holds all that it may be"),
        pytest.param(Cogging(amplitude=0.1, cycles_per_rev=20.0), {}, True, id="what was not fitted says nothing"),
    ],
)
def test_a_range_that_holds_nothing_at_all_or_all_tells_no_size(effect, errors, told):
    values = {variable.name: float(variable.start) for variable in parameters_of(effect)}
    assert is_told(effect, Numbers(values, errors), replace(MOUNT, effects=(effect,)), ANY) is told


def test_a_fit_ends_at_a_bound_a_little_inside() -> None:
    assert at_bound(Delay(delay_ms=LONGEST))
    assert at_bound(Delay(delay_ms=LONGEST * (1 - 2e-9))), "a fit goes on from 1e-9 of its scale inside"
    assert not at_bound(Delay(delay_ms=0.999 * LONGEST))


@pytest.mark.parametrize("edge", [0.95, -0.95])
def test_of_several_sizes_one_inside_its_range_is_no_bound(edge: float) -> None:
    """Another generator's friction of two directions has a viscous part beyond what a card may hold."""
    sizes = hypothesis_of(FrictionAsymmetry(level_asymmetry=0.1)).sizes
    assert not at_bound(FrictionAsymmetry(level_asymmetry=0.33, viscous_asymmetry=edge), sizes)
    assert at_bound(FrictionAsymmetry(level_asymmetry=0.33, viscous_asymmetry=edge))
    assert at_bound(FrictionAsymmetry(level_asymmetry=0.0, viscous_asymmetry=edge), sizes), "nothing is no size"
    assert at_bound(FrictionAsymmetry(level_asymmetry=edge, viscous_asymmetry=-edge), sizes)


def test_errors_go_to_the_numbers_of_their_own_effect() -> None:
    mount = replace(MOUNT, effects=(TorqueOffset(torque=1.0), Delay(delay_ms=2.0)))
    names = {part: name for name, part in mount.components().items() if isinstance(part, Effect)}
    errors = {f"{names[mount.effects[0]]}.torque": 0.1, f"{names[mount.effects[1]]}.delay_ms": 0.2}
    assert numbers_of(mount.effects[1], mount, errors).errors == {"delay_ms": 0.2}


@pytest.mark.parametrize(("level", "plausible"), [(2.1, True), (2.0, False), (1.5, False)])
def test_a_stribeck_curve_falls_from_a_break_away_above_the_level(level: float, plausible: bool) -> None:
    curve = StribeckEffect(Fs=level, Vs=0.1)
    assert hypothesis_of(curve).is_plausible(curve, MOUNT) is plausible


# What an effect that is really another is called.

LIGHT = replace(MOUNT, friction=Coulomb(Fc=1.0))


def read_at_1khz(speed: np.ndarray, **columns: np.ndarray) -> Problem:
    """Of one recording at 1 kHz."""
    t = np.arange(len(speed)) / 1000
    return posed(LIGHT, [Recording("r", {"t": t, "tau": speed, "q": np.cumsum(speed) / 1000, **columns})], 10.0)


@pytest.mark.parametrize(
    ("effect", "degenerate"),
    [
        # A value that is held, or stamped at the other end of its row, is half a sample late: so it was read.
        *((form(**{name: 0.51}), True) for form, name in ((Delay, "delay_ms"), (ActuatorLag, "time_constant_ms"))),
        *((form(**{name: 0.57}), False) for form, name in ((Delay, "delay_ms"), (ActuatorLag, "time_constant_ms"))),
        (Compliance(antiresonance_hz=30.0, resonance_hz=20.0), True),  # no card may hold it
        (Compliance(antiresonance_hz=20.0, resonance_hz=30.0), False),
        # A cable whose home is far beside the travel, here from 0 to 2 rad, pulls one way all along, as a weight does.
        (CableWrap(stiffness=0.1, home=-0.45), False),
        (CableWrap(stiffness=0.1, home=-0.55), True),
        (CableWrap(stiffness=0.1, home=2.55), True),
    ],
    ids=str,
)
def test_what_is_really_something_else_is_no_answer(effect: Effect, degenerate: bool) -> None:
    assert is_degenerate(read_at_1khz(np.sin(np.arange(20_000) / 1000)), effect) is degenerate


@pytest.mark.parametrize(("more", "told"), [({}, False), ({"q_d": np.arange(20_000) / 1000}, True)])
def test_noise_at_constant_speed_tells_no_delay_unless_a_set_point_asks_for_it(more, told):
    found = read_at_1khz(1 + 0.02 * np.random.default_rng(1).standard_normal(20_000), **more)
    none = np.zeros(0)
    fit = Fit(LIGHT, (), none, none, none, np.zeros(len(found.prepared.recording_of)))
    assert in_time(found, CandidateFit(Delay(delay_ms=5.0), fit, 50.0, 0.0, 0.5)) is told


def tuned(this: Problem, rough: Effect) -> Effect:
    """What a hypothesis makes of an effect that was fitted from a rough start."""
    mount = replace(LIGHT, effects=(rough,))
    found: Callable[..., Fit] = hypothesis_of(rough).tuned
    return found(this, this.fit(mount, 12), rough, lambda fit: -this.error(fit)).mount.effects[-1]


def test_how_a_cable_hardens_is_fitted_as_its_grid_knows_it_only_roughly() -> None:
    t = np.arange(40_000) / 1000
    q, v = 1.5 * np.sin(0.9 * t), 1.35 * np.cos(0.9 * t)
    tau = -0.81 * 5 * q + np.sign(v) + 2 * (q - 0.2) * (1 + 0.3 * (q - 0.2) ** 2)
    found = tuned(read_at_1khz(v, tau=tau, q=q), CableWrap(stiffness=1.0, home=0.0, hardening=4 / 9))
    assert (found.hardening, found.home) == (pytest.approx(0.3, rel=0.05), pytest.approx(0.2, rel=0.05))


def test_a_stribeck_curve_is_found_from_a_start_narrower_than_the_gap_between_the_speeds() -> None:
    t = np.arange(300) / 100
    runs = []
    for v in (side * v for v in (0.1, 3.0, 6.0, 9.0, 12.0, 15.0, 18.0, 21.0) for side in (1, -1)):
        tau = np.full(300, np.sign(v) * (1 + 0.2 * np.exp(-abs(v) / 5)) + 0.02 * v)
        runs.append(Recording(f"at {v}", {"t": t, "q": v * t, "tau": tau}))
    found = tuned(posed(LIGHT, runs, 10.0), StribeckEffect(Fs=1.2, Vs=0.1))
    assert (found.Vs, found.Fs) == (pytest.approx(5, rel=0.01), pytest.approx(1.2, rel=0.01))


def test_of_an_asymmetry_that_looks_like_the_offset_found_it_is_said_that_it_does() -> None:
    t = np.arange(0, 20, 0.01)
    v = np.cos(2 * t) + 0.5 * np.cos(0.7 * t)
    q = np.sin(2 * t) / 2 + np.sin(0.7 * t) / 1.4
    this = posed(LIGHT, [Recording("r", {"t": t, "q": q, "tau": np.sign(v) + 0.2 + 5 * np.gradient(v, t)})], 10.0)
    found = this.fit(replace(LIGHT, effects=(TorqueOffset(torque=1.0),)), 5)
    comparison = Comparison.of(this, this.fit(LIGHT, 5), POLICY)
    absent = {finding.effect: finding for finding in not_found(comparison, found, ["torque_offset"], 0.0)}
    assert absent["friction_asymmetry"].answer == "not_testable"
    assert "torque offset" in absent["friction_asymmetry"].evidence


# On one sine a weight is an inertia with the other sign: errors, bounds and sets of a diagnosis know it.


CARD = parse_card('[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\nsigma2 = 3.0\n', "card.toml")
INERTIA, SLOW, FAST = 2.0, 1.5, 4.0


class Stroke(NamedTuple):
    """Amplitude [rad] of a sine, and what of it another, faster one has."""

    size: float
    more: float = 0.0


def recorded(stroke: Stroke, mgl: float, seed: int) -> Recording:
    t = np.arange(3000) / 100
    q, v, a = swing(t, [(stroke.size, SLOW, seed), (stroke.more * stroke.size, FAST, seed)], per=1)
    noise = 0.02 * np.random.default_rng(seed).standard_normal(len(t))
    tau = INERTIA * a + np.sign(v) + 3 * v + mgl * np.sin(q) + noise
    return Recording(f"run_{seed}", {"t": t, "q": q, "tau": tau})


def problem(stroke: Stroke, mgl: float = 1.0) -> Problem:
    return _problem([recorded(stroke, mgl, seed) for seed in (1, 2)], CARD)


def compared(stroke: Stroke, mgl: float = 1.0) -> tuple[Comparison, Fit]:
    this = problem(stroke, mgl)
    base = this.fit(this.mount, 25)
    return Comparison.of(this, base, POLICY), base


def errors_of(stroke: Stroke) -> tuple[dict[str, float], dict[str, float]]:
    """Numbers and standard errors of inertia and weight, fitted together."""
    this = problem(stroke)
    found = this.fit(replace(this.mount, effects=(GravityUnbalance(mgl=0.3, phase=0.3),)), 40)
    return found.parameters(), standard_errors(found, Blocks.of(this.prepared), this.weight)


@pytest.mark.parametrize("size", [0.1, 0.3])
def test_errors_of_inertia_and_weight_are_large_on_one_sine_and_small_on_two(size: float) -> None:
    (values, errors), (_, fewer) = errors_of(Stroke(size)), errors_of(Stroke(size, 0.15))
    for name, true in (("axis.inertia", INERTIA), ("gravity_unbalance.mgl", 1.0)):
        assert errors[name] > 50 * fewer[name]
        assert abs(values[name] - true) < 1.96 * errors[name]
    assert errors["friction.Fc"] < 2 * fewer["friction.Fc"], "what is not collinear is told as well"


def gravity(stroke: Stroke, mgl: float) -> tuple[Finding, Fit]:
    """What is said of a weight that the base could take for less inertia."""
    comparison, base = compared(stroke, mgl)
    return next(one for one in not_found(comparison, base, [], 0.0) if one.effect == "gravity_unbalance"), base


def test_a_weight_that_the_inertia_took_is_not_testable_on_a_short_sine() -> None:
    one, base = gravity(Stroke(0.1), 1.0)
    assert base.mount.axis.inertia == pytest.approx(INERTIA - 1.0 / SLOW**2, rel=0.02)
    assert (one.answer, one.evidence) == ("not_testable", "these recordings do not excite it")
    assert one.action == "record at least half a turn, slowly, with stops"


def test_the_bound_on_a_longer_sine_is_larger_than_the_weight_that_the_inertia_took() -> None:
    one, base = gravity(Stroke(0.3), 3.0)
    assert base.mount.axis.inertia < 0.5 * INERTIA
    assert one.answer == "not_seen"
    assert one.visible_from > 3.0


@pytest.mark.parametrize(("stroke", "together"), [(Stroke(0.8), True), (Stroke(0.8, 0.15), False)])
def test_a_weight_and_an_inertia_over_position_stand_in_one_set_on_one_sine_only(stroke, together):
    comparison, base = compared(stroke)
    weight = refitted(comparison, base, GravityUnbalance(mgl=0.5, phase=0.1), 1)
    varying = refitted(comparison, base, InertiaVariation(relative_amplitude=0.1, cycles_per_rev=1.0, phase=3.0), 1)
    assert weight.evidence > POLICY.clear
    assert weight.plain_gain > POLICY.considerable
    behind = float(margin(comparison, weight, varying))
    assert behind < POLICY.fair if together else behind > POLICY.fair


# What recordings cannot tell: friction, where motion goes one way; a tone, where each recording is a few rows.

T = np.arange(20_000) / 1000

ONE_WAY, BACKWARDS, SWING = (
    prepare([axis_read(np.sign(np.gradient(q)), T, q)], 10.0)
    for q in (0.6 * T + 0.03 * np.sin(30 * T), -0.6 * T, 1.5 * np.sin(0.9 * T))
)
RIPPLE, SPRING = PeriodicFriction(cycles_per_rev=14.0, relative_amplitude=0.3), Presliding(sigma0=100.0)
TURNS = [(one, LIGHT) for one in (Presliding(sigma0=20.0), RIPPLE, Backlash(gap_rad=0.2))]
TURNS += [(Backlash(gap_rad=1e-4, load_deflection=0.09), LIGHT), (SPRING, replace(LIGHT, friction=Coulomb(Fc=10.0)))]
# A contact that is stiff enough slides on the way back; a torque over position needs no way back.
NO_TURNS = [(one, LIGHT) for one in (SPRING, Cogging(cycles_per_rev=14.0, amplitude=0.1), TorqueOffset(torque=0.1))]


@pytest.mark.parametrize(("effect", "mount"), [*TURNS, *NO_TURNS], ids=lambda one: getattr(one, "id", ""))
def test_what_needs_a_turn_is_not_believed_where_motion_goes_one_way(effect: Effect, mount: Mount) -> None:
    needed = (effect, mount) in TURNS
    assert needs_turns(effect, mount, ONE_WAY) is needed
    assert needs_turns(effect, mount, BACKWARDS) or not needed
    assert not needs_turns(effect, mount, SWING)


@pytest.mark.parametrize(("width", "is_one"), [(1e-5, False), (5e-3, True)])
def test_a_spot_across_which_the_contact_bends_is_a_place_where_the_axis_rested(width: float, is_one: bool) -> None:
    spot = LocalFriction(q_center=0.3, width=width, relative_amplitude=0.4)
    bristle = replace(LIGHT, friction=LuGre(sigma0=1e4, sigma1=50.0, sigma2=0.0, Fc=1.0, Fs=1.0, Vs=0.01))
    assert hypothesis_of(spot).shows(spot, bristle, SWING) is is_one
