"""What holds for every effect of the catalogue; a new one is met here by itself."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from effect_examples import EXAMPLES, INERTIA, LAW, NUMBERS, evaluate, mount, response, slopes
from friction_laws import EXAMPLES as LAW_EXAMPLES
from hypothesis import given, settings
from hypothesis import strategies as st

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
    StribeckEffect,
    Transmission,
)
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
MULTIPLIED = ("friction_asymmetry", "stribeck", "position_friction", "thermal_viscosity")
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


@EACH
@pytest.mark.parametrize("law", [LAW, LUGRE, Frictionless()], ids=lambda law: law.key)
def test_equations_and_derivatives_are_finite_also_at_rest(effect: Effect, law) -> None:
    model = mount(effect, WEIGHT, friction=law).model()
    function = slopes(model)
    for z in points(model, 40).T:
        assert all(np.all(np.isfinite(part.full())) for part in function(z)), z


@settings(max_examples=25, deadline=None)
@given(chosen=st.lists(st.sampled_from(EXAMPLES), max_size=7), law=st.sampled_from(sorted(LAW_EXAMPLES)))
def test_any_combination_on_any_law_is_a_plant(chosen: list[Effect], law: str) -> None:
    """In any order, and several of a kind."""
    model = mount(*chosen, friction=LAW_EXAMPLES[law]).model()
    assert len({variable.name for variable in (*model.states, *model.parameters)}) == len(_all(model)) - len(
        model.inputs
    )
    found = evaluate(model, 1.0, tau=3.0, position=0.2, speed=0.1)
    assert np.all(np.isfinite(list(found.values())))
    assert found["der(position)"] == 0.1


@EACH
def test_equations_are_finite_with_each_parameter_at_its_bounds(effect: Effect) -> None:
    """Also where a fit or a user drives one to its end; ends that break a rule of the effect are not reached."""
    for variable in parameters_of(effect):
        for end in (variable.low, variable.high):
            changed = replace(effect, **{variable.name: end}) if np.isfinite(end) else effect
            if not changed.broken_rule():
                function = slopes(model := mount(changed, WEIGHT, friction=LUGRE).model())
                for z in points(model, 8).T:
                    assert all(np.all(np.isfinite(part.full())) for part in function(z)), (variable.name, end, z)


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
def test_an_effect_acts_in_one_place_and_says_what_it_is_and_what_tells_it_from_its_rivals(
    effect: Effect, unit: str
) -> None:
    assert sum(isinstance(effect, kind) for kind in KINDS) == 1
    statement = effect.statement(unit)
    assert statement.endswith(".")
    assert "\n" not in statement
    assert "N·m" not in statement or unit == "N·m"
    assert all((effect.title, effect.told_apart_by, effect.action))
    assert effect.id not in effect.rivals
    assert set(effect.rivals) <= set(CATALOGUE)


multipliers = [one for one in of_kind(FrictionEffect) if one.id in MULTIPLIED and not one.states()]


@each(multipliers)
def test_friction_that_is_not_there_cannot_be_multiplied(effect: FrictionEffect) -> None:
    warm = mount(effect).at(0.0, 1.0, 0.1, {"temperature": 35.0})
    assert isinstance(effect, StribeckEffect) or float(effect.level(0.0, warm)) == pytest.approx(0, abs=1e-12)
    assert float(effect.viscous(0.0, warm)) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("omega", [1.0, 40.0])
def test_the_plant_sends_the_command_through_its_drive_effects_in_series(omega: float) -> None:
    """States of a dead time follow it within its band; there the response is the product of both."""
    drives = (Delay(delay_ms=4.0), ActuatorLag(time_constant_ms=3.0))
    found = response(mount(*drives, friction=Frictionless()).model(), omega / (2 * np.pi), "applied")
    expected = np.prod([one.response(np.array([omega])) for one in drives])
    assert abs(found - expected) < 1e-5 * abs(expected)
