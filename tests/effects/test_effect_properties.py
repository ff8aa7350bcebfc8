"""What holds for every effect of the catalogue, a new one too, and what a mechanic reads of each in sentences."""

from collections.abc import Sequence
from dataclasses import replace
from math import log
from typing import Any

import numpy as np
import pytest
from effect_examples import EXAMPLES, FORM, INERTIA, NUMBERS, evaluate, example, mount, response, slopes
from friction_laws import EXAMPLES as LAW_EXAMPLES
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.diagnosis.measure.findings import between
from pyfmi_models.effects import (
    CATALOGUE,
    FORMS,
    ActuatorLag,
    ClockEffect,
    Coupling,
    Delay,
    DriveEffect,
    Effect,
    FrictionEffect,
    GravityUnbalance,
    InertiaEffect,
    LoadEffect,
    SensorEffect,
    Transmission,
)
from pyfmi_models.effects.base import higher, percent
from pyfmi_models.friction import Frictionless, LuGre
from pyfmi_models.model import Model, parameters_of

LUGRE = LuGre(sigma0=1e4, sigma1=200.0, sigma2=3.0, Fc=1.0, Fs=1.5, Vs=0.02)


def each(chosen: Sequence[Effect]) -> Any:
    return pytest.mark.parametrize("effect", chosen, ids=lambda one: type(one).__name__)


def of_kind(*kinds: type[Effect]) -> list[Any]:
    return [one for one in EXAMPLES if isinstance(one, kinds)]


EACH = each(EXAMPLES)
WEIGHT = GravityUnbalance(mgl=2.0)
"""On the axis everywhere, so that what depends on a load has one."""
CONSERVATIVE = ("cogging", "gravity_unbalance", "torque_offset", "cable_wrap")


def points(model: Model, count: int, seed: int = 0) -> np.ndarray:
    """Columns of (t, x, u, p): times from 0 to hours, speeds from rest to fast, states and inputs of all sizes."""
    rng = np.random.default_rng(seed)
    found = np.zeros((1 + len(model.states) + len(model.inputs) + len(model.parameters), count))
    found[0] = rng.choice([0.0, 1.0, 1e4], count) * rng.random(count)
    for row, variable in enumerate((*model.states, *model.inputs, *model.parameters), 1):
        if row > len(model.states) + len(model.inputs):
            found[row] = variable.start
        else:
            size = variable.nominal * rng.choice([0.0, 1e-6, 1.0, 30.0], count)
            found[row] = np.clip(variable.start + size * rng.standard_normal(count), variable.low, variable.high)
    found[2, ::4] = 0.0  # at rest
    return found


@settings(max_examples=25, deadline=None)
@given(chosen=st.lists(st.sampled_from(EXAMPLES), max_size=7), law=st.sampled_from(sorted(LAW_EXAMPLES)))
def test_any_combination_on_any_law_is_a_plant(chosen: list[Effect], law: str) -> None:
    """In any order, and several of a kind."""
    model = mount(*chosen, friction=LAW_EXAMPLES[law]).model()
    assert len({variable.name for variable in _all(model)}) == len(_all(model))
    found = evaluate(model, 1.0, tau=3.0, position=0.2, speed=0.1)
    assert np.all(np.isfinite(list(found.values())))
    assert found["der(position)"] == 0.1


@EACH
def test_equations_and_derivatives_are_finite_at_rest_and_with_each_parameter_at_its_bounds(effect: Effect) -> None:
    """Also where a fit or a user drives one to its end; ends that break a rule of the effect are not reached."""
    ends = [(one.name, end) for one in parameters_of(effect) for end in (one.low, one.high) if np.isfinite(end)]
    for changed in (effect, *(replace(effect, **{name: end}) for name, end in ends)):
        if not changed.broken_rule():
            function = slopes(model := mount(changed, WEIGHT, friction=LUGRE).model())
            for z in points(model, 12).T:
                assert all(np.all(np.isfinite(part.full())) for part in function(z)), (changed, z)


@EACH
def test_derivatives_are_finite_differences(effect: Effect) -> None:
    model = mount(effect, WEIGHT, friction=LUGRE).model()
    function, rng = slopes(model), np.random.default_rng(1)
    sizes = np.array([1.0, *(v.nominal if v.start == 0 else abs(v.start) for v in _all(model))])
    starts = np.array([1.0, *(v.start for v in _all(model))])
    sizes[1:] *= [not v.name.endswith(".seed") for v in _all(model)]  # seeds are whole numbers
    for _ in range(10):
        z = starts + 0.3 * sizes * rng.standard_normal(len(sizes)) * (rng.random(len(sizes)) < 0.7)
        z[2] = 0.3 * sizes[2] * rng.standard_normal()  # away from rest, where friction has its kink
        way, h = sizes * rng.standard_normal(len(sizes)), 1e-6
        jacobian = function(z)[1].full()
        difference = (function(z + h * way)[0] - function(z - h * way)[0]).full().ravel() / (2 * h)
        scale = np.abs(jacobian) @ np.abs(way) + 1e-9
        np.testing.assert_allclose(difference / scale, jacobian @ way / scale, atol=1e-5)


def _all(model: Model):
    return (*model.states, *model.inputs, *model.parameters)


def test_every_form_is_in_the_catalogue_and_has_an_example() -> None:
    assert set(NUMBERS) <= {form.__name__ for form in FORMS}
    assert {type(one) for one in EXAMPLES} == {form for forms in CATALOGUE.values() for form in forms}


momentary = [one for one in of_kind(FrictionEffect) if one.id != "presliding"]


@each(momentary)
@settings(max_examples=30, deadline=None)
@given(q=st.floats(-4, 4), v=st.floats(-2, 2), age=st.floats(0, 1e3), degrees=st.floats(-20, 60))
def test_friction_never_drives(effect: FrictionEffect, q: float, v: float, age: float, degrees: float) -> None:
    here = mount(effect, WEIGHT)
    given = {one.name: degrees if one.unit == "degC" else one.nominal for one in here.inputs()}
    motion = here.at(0.0, q, v, given)
    states = {effect.id: [age] * len(effect.states())}
    level = here.level(motion, states)
    torque = here.law.contact((), v, level) + here.viscous(motion, states)
    assert level >= 0
    assert float(torque) * v >= 0


loads_of_the_moment = [one for one in of_kind(LoadEffect) if not one.states()]
"""Those with a memory are asked over time, in the tests of their own."""


@each(loads_of_the_moment)
def test_a_load_resists_and_is_the_same_for_the_equation_of_motion(effect: LoadEffect) -> None:
    model, plain = mount(effect).model(), mount().model()
    given = {one.name: one.nominal for one in effect.inputs()}
    for q, v in ((0.4, 0.3), (-1.0, 0.0), (0.1, -0.3)):
        load = float(effect.load(mount(effect).at(0.7, q, v, given)))
        here = evaluate(model, 0.7, position=q, speed=v, **given)["der(speed)"]
        there = evaluate(plain, 0.7, position=q, speed=v)["der(speed)"]
        assert load != 0 or v == 0
        assert (there - here) * INERTIA == pytest.approx(load, rel=1e-9)


@each(loads_of_the_moment)
def test_a_load_gives_back_over_a_round_trip_what_it_took_or_less(effect: LoadEffect) -> None:
    """Work over a closed path at one moment: zero for a potential, positive for what wastes, never negative."""
    turn = np.linspace(0, 2 * np.pi, 2001)
    q, v = 0.8 * np.sin(turn), 0.8 * np.cos(turn)
    here = mount(effect)
    loads = np.array([float(effect.load(here.at(0.3, *one))) for one in zip(q, v, strict=True)])
    work = float(np.trapezoid(loads * v, turn))
    assert work > -1e-6
    assert abs(work) < 1e-6 or effect.id not in CONSERVATIVE
    assert work > 0.1 or effect.id != "quadratic_drag"


@each(of_kind(SensorEffect))
def test_a_sensor_effect_changes_what_is_read_and_nothing_else(effect: SensorEffect) -> None:
    model, plain = mount(effect).model(), mount().model()
    here, there = (evaluate(one, position=0.4, speed=0.2, tau=3.0) for one in (model, plain))
    assert here["q"] != there["q"]
    assert here["q_true"] == there["q"] == 0.4
    assert here["der(speed)"] == there["der(speed)"]


@each(of_kind(Coupling, InertiaEffect))
def test_at_rest_a_torque_accelerates_no_less_than_a_rigid_axis_would_be(effect: Effect) -> None:
    """What is behind a coupling is not felt at once, and what is in front is never more than all."""
    rates = evaluate(mount(effect, friction=Frictionless()).model(), position=-0.2, tau=3.0)
    if isinstance(effect, Transmission):  # the axis stays as it is, the motor goes
        assert rates["der(speed)"] == 0
        rates["der(speed)"] = rates[f"der({effect.id}.twist_rate)"]
    inertia = 3.0 / rates["der(speed)"]
    if isinstance(effect, InertiaEffect):
        whole = float(effect.inertia(INERTIA, mount(effect).at(0.0, -0.2, 0.0)))
        assert inertia == pytest.approx(whole)
        assert whole > 1.2 * INERTIA
    else:
        assert 0 < inertia < INERTIA


KINDS = (DriveEffect, FrictionEffect, LoadEffect, InertiaEffect, Coupling, SensorEffect, ClockEffect)


@EACH
@pytest.mark.parametrize("unit", ["N·m", "N"])
def test_an_effect_acts_in_one_place_and_says_what_tells_it_from_its_rivals(effect: Effect, unit: str) -> None:
    assert sum(isinstance(effect, kind) for kind in KINDS) == 1
    statement = effect.statement(unit)
    assert statement.endswith(".")
    assert "\n" not in statement
    assert "N·m" not in statement or unit == "N·m"
    assert all((effect.title, effect.told_apart_by, effect.action))
    assert effect.id not in effect.rivals
    assert set(effect.rivals) <= set(CATALOGUE)


@pytest.mark.parametrize("omega", [1.0, 40.0])
def test_the_plant_sends_the_command_through_its_drive_effects_in_series(omega: float) -> None:
    """States of a dead time follow it within its band; there the response is the product of both."""
    drives = (Delay(delay_ms=4.0), ActuatorLag(time_constant_ms=3.0))
    found = response(mount(*drives, friction=Frictionless()).model(), omega / (2 * np.pi), "applied")
    expected = np.prod([one.response(np.array([omega])) for one in drives])
    assert abs(found - expected) < 1e-5 * abs(expected)


# Sentences, by hand from the numbers, for axes that turn and that slide.

TURNING = {
    "ActuatorLag": "The drive builds up its torque slowly, with a time constant of 4 ms.",
    "AltitudeInertia": "The azimuth carries 3 kg·m² more with the tube level than at the zenith.",
    "AzimuthCentrifugal": "Turning in azimuth swings the tube down; it weighs 3 kg·m² against it.",
    "Backlash": "There is play of 0.01 rad in the drive.",
    "BoucWen": "A belt or gear goes round a loop of 1.79 N·m either way, within 0.05 rad.",
    "CableWrap": "A cable or spring pulls towards 0.2 rad with 3 N·m per rad.",
    "ClockSkew": "The clock of the encoder is 4 ms ahead of the torque and drifts by 100 ppm; not mechanical.",
    "Cogging": "The motor torque ripples 24 times per turn, by 0.5 N·m each way.",
    "Compliance": "36 % of the inertia hangs on a spring that rings at 25 Hz.",
    "LoadSideCompliance": "The motor turns the axis through a spring: both ring against each other at 60 Hz.",
    "ConcaveViscous": "Above 0.3 rad/s viscous friction falls: the grease thins.",
    "DeadBand": "The drive gives next to nothing for commands below 0.5 N·m, and less by that above.",
    "Delay": "Actuation delay of 4 ms (drive or bus, not mechanical).",
    "DwellBreakaway": "The longer the axis rests the harder it starts: "
    f"{0.3 * log(10):.2g} N·m more for ten times the rest.",
    "EncoderEccentricity": "The encoder errs by 0.001 rad either way, 8 times per turn.",
    "GearFriction": "The gear's friction rises by 0.3 N·m for each N·m that it lifts and 0.1 that it lowers.",
    "GravityUnbalance": "The axis is out of balance by 1.5 N·m.",
    "InertiaVariation": "The inertia rises and falls by 30 %, 2 times per turn.",
    "KnownLoad": "The known load acts with 1 N·m of drive torque for each N·m.",
    "LearnedAfterReversal": "After a reversal friction is 11 % higher for a while; learned from data.",
    "LearnedDrive": "The drive gives up to 0.25 N·m less or more than its command; a table learned from data.",
    "LearnedHysteresis": "Something goes round a loop of 0.5 N·m either way; learned from data.",
    "LoadDependentFriction": "Friction rises by 0.2 N·m for each N·m of load on the axis.",
    "GearLoadFriction": "Friction rises by 0.2 N·m for each N·m through the gear, to hold a load or to move it.",
    "LoadScaledFriction": "Friction rises by 0.1 N·m for each N·m of load on the axis.",
    "LocalFriction": "Around 1 rad friction is 30 % higher, over about 0.2 rad.",
    "PeriodicDisturbance": "Something shakes the axis 3 times a second with 0.6 N·m.",
    "PeriodicFriction": "Friction rises and falls by 20 %, 3 times per turn.",
    "Presliding": "Before it slides the axis bends like a spring of 2e+04 N·m per rad.",
    "QuadraticDrag": "Drag grows with the square of the speed, 2 N·m at 1 rad/s.",
    "RoughSpot": "Around 0.3 rad friction is 80 % higher moving forward and 30 % lower backward, over about 0.4 rad.",
    "StribeckEffect": "Below about 0.02 rad/s friction changes with speed, to 4 N·m near standstill.",
    "ThermalViscosity": "Viscous friction falls by 4 % per degree and sliding friction falls by 2 % per degree.",
    "WarmingViscosity": "Viscous friction falls by 45 % in the first 90 s.",
    "RubbedViscosity": "Viscous friction falls by 32 % per rad rubbed.",
    "TorqueDroop": "Of a command of 8 N·m the drive loses 20 %, of small ones less.",
    "WarmTorqueDroop": "Of a command of 8 N·m the drive loses 20 %, of small ones less, "
    "and gives 0.2 % less per degree.",
    "TorqueOffset": "A constant 0.7 N·m pushes the axis backward, moving or not.",
    "ConstantForce": "A constant load of 0.7 N·m pushes the axis backward: "
    "a weight, or an offset of the drive's reading.",
    "TorqueSaturation": "The drive saturates at 5 N·m: 40 % of what is asked for beyond it arrives.",
}
"""By the examples of tests/tools/effect_examples.py; 36 % is 1 - (20 / 25)^2, the share that rings."""
SLIDING = {
    "N·m": "N",
    "per rad": "per m",
    " rad ": " m ",
    "rad.": "m.",
    "rad/s": "m/s",
    "per turn": "per metre",
    "of the inertia": "of the moving mass",
    "The inertia rises": "The moving mass rises",
    "constant load of 0.7": "constant force of 0.7",
    "0.7 N pushes the axis backward:": "0.7 N pushes the carriage backward:",
}
"""What the sentence of an axis that slides says in the place of these words, and in nothing else."""


@pytest.mark.parametrize("name", TURNING)
def test_a_sentence_says_the_numbers_of_an_axis_that_turns_and_of_one_that_slides(name: str) -> None:
    effect, sliding = example(FORM[name]), TURNING[name]
    assert effect.statement() == TURNING[name]
    for one, other in SLIDING.items():
        sliding = sliding.replace(one, other)
    assert effect.statement("N") == sliding


@pytest.mark.parametrize(
    ("name", "numbers", "expected"),
    [
        ("ClockSkew", {"offset_ms": -4.0}, "The clock of the encoder is 4 ms behind the torque; not mechanical."),
        ("ClockSkew", {"drift_ppm": -50.0}, "The clock of the encoder drifts by -50 ppm; not mechanical."),
        ("ClockSkew", {}, "The clock of the encoder is right; not mechanical."),
        ("TorqueOffset", {"torque": -0.7}, "A constant 0.7 N·m pushes the axis forward, moving or not."),
        ("TorqueSaturation", {"knee_torque": 5.0}, "The drive saturates at 5 N·m: no more arrives."),
        (
            "WarmTorqueDroop",
            {"droop": 0.2, "rated_torque": 8.0, "per_degC": 0.002},
            TURNING["WarmTorqueDroop"].replace("less per", "more per"),
        ),
        ("ThermalViscosity", {"viscous_per_degC": 0.0}, "Friction keeps its size."),
        (
            "WarmingViscosity",
            {"viscous_per_degC": 0.01, "coulomb_per_degC": -0.02, "warm_up_degC": 10.0, "warm_up_s": 60.0},
            "Viscous friction grows by 11 % in the first 3 min and sliding friction falls by 18 % in the first 3 min.",
        ),
        ("ThermalViscosity", {"viscous_per_degC": 0.04}, "Viscous friction grows by 4 % per degree."),
        (
            "ConcaveViscous",
            {"thinning_speed": 0.3, "exponent": 0.4},
            "Above 0.3 rad/s viscous friction rises less than the speed: the grease thins.",
        ),
        (
            "FrictionAsymmetry",
            {"level_asymmetry": -0.1, "viscous_asymmetry": 0.009},
            "Sliding friction differs by 20 % between directions (of the mean; higher backward).",
        ),
        (
            "FrictionAsymmetry",
            {"level_asymmetry": 0.1, "viscous_asymmetry": -0.2},
            "Viscous friction differs by 40 % between directions (of the mean; higher backward), "
            "sliding friction differs by 20 % between directions (of the mean; higher forward).",
        ),
        (
            "GearFriction",
            {"driving": 0.6, "driven": 1.2},
            "The gear's friction rises by 0.6 N·m for each N·m that it lifts and 1.2 that it lowers; "
            "it holds its load by itself.",
        ),
        (
            "FrictionWander",
            {"std": 0.25, "correlation_time": 0.3, "jump_std": 0.1, "jump_period": 2.5},
            "Friction wanders by 25 % (RMS) within 0.3 s, and jumps by 10 % every 2.5 s: "
            "the same motion twice meets another friction.",
        ),
    ],
)
def test_a_sentence_says_signs_and_no_more_than_is_there(name: str, numbers: dict[str, float], expected: str) -> None:
    assert FORM[name](**numbers).statement() == expected


def test_what_was_learned_says_over_what_and_how_large_it_is() -> None:
    """Half the range between the greatest and the least of a table is what it does either way."""
    said = {type(one).__name__: one.statement() for one in EXAMPLES}
    assert said["LearnedTorque"] == "Something that depends on position, 0.6 N·m; a table learned from data."
    assert said["LearnedFriction"].startswith(
        "Something that depends on position and temperature, 46 % of the friction;"
    )


@pytest.mark.parametrize(
    ("ends", "text"),
    [
        ((28.93, 31.42), "28.9 to 31.4"),
        ((5.9953, 6.0047), "5.995 to 6.005"),
        ((0.19769, 0.19831), "0.1977 to 0.1983"),
        ((0.541, 0.578), "0.541 to 0.578"),
        ((123456.0, 234567.0), "123456 to 234567"),
        ((0.0, 0.0), "0 to 0"),
    ],
)
def test_a_range_tells_its_ends_apart_with_equally_many_digits(ends: tuple[float, float], text: str) -> None:
    assert between(*ends) == text


@pytest.mark.parametrize(
    ("share", "text"), [(0.4226, "42 %"), (1.893, "189 %"), (0.997, "100 %"), (0.0123, "1.2 %"), (0.994, "99 %")]
)
def test_a_share_is_written_without_a_power_of_ten(share: float, text: str) -> None:
    assert percent(share) == text
    assert higher(-share) == f"{text} lower"
