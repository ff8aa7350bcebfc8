"""Friction effects do what their names say, on the level, the viscous part and the contact of any law."""

from dataclasses import replace

import numpy as np
import pytest
from effect_examples import INERTIA, evaluate, mount, simulate

from pyfmi_models.effects import (
    Cogging,
    FrictionAsymmetry,
    FrictionEffect,
    GravityUnbalance,
    LocalFriction,
    PeriodicFriction,
    StribeckEffect,
)
from pyfmi_models.effects.dwell_breakaway import DwellBreakaway
from pyfmi_models.effects.load_dependent_friction import LoadDependentFriction
from pyfmi_models.effects.presliding import Presliding
from pyfmi_models.effects.thermal_viscosity import RubbedViscosity, ThermalViscosity, WarmingViscosity
from pyfmi_models.friction import Coulomb, Frictionless, LuGre


def torque(*effects: FrictionEffect, q: float = 0.0, v: float = 0.2, **values: float) -> float:
    """Friction torque of an axis with 1 N m of Coulomb friction, 3 N m s/rad and these effects."""
    return evaluate(mount(*effects).model(), position=q, speed=v, **values)["friction"]


@pytest.mark.parametrize("direction", [1, -1])
def test_asymmetry_scales_level_and_viscous_torque_by_direction(direction: int) -> None:
    effect, v = FrictionAsymmetry(level_asymmetry=0.1, viscous_asymmetry=-0.2), direction * 0.5
    expected = direction * (1.0 * (1 + 0.1 * direction) + 1.5 * (1 - 0.2 * direction))
    assert torque(effect, v=v) == pytest.approx(expected)


def test_asymmetry_vanishes_at_standstill() -> None:
    assert torque(FrictionAsymmetry(level_asymmetry=0.5), v=0.0) == 0


@pytest.mark.parametrize("v", [-0.3, 0.3])
def test_periodic_friction_multiplies_the_level_and_follows_the_direction(v: float) -> None:
    effect = PeriodicFriction(cycles_per_rev=3, relative_amplitude=0.2, phase=0.4)
    for q in np.linspace(0, 2, 7):
        expected = np.sign(v) * (1 + 0.2 * np.cos(3 * q + 0.4)) + 3 * v
        assert torque(effect, q=float(q), v=v) == pytest.approx(expected, rel=1e-12)
    assert torque(effect, q=-0.4 / 3, v=v) == pytest.approx(1.2 * np.sign(v) + 3 * v)


@pytest.mark.parametrize("v", [-0.3, 0.3])
def test_a_rough_spot_is_where_it_is_and_as_wide_as_it_is(v: float) -> None:
    effect = LocalFriction(q_center=1.0, width=0.05, relative_amplitude=0.3)
    for q, rise in ((1.0, 0.3), (1.05, 0.3 * np.exp(-0.5)), (0.95, 0.3 * np.exp(-0.5)), (2.0, 0.0), (1e6, 0.0)):
        assert torque(effect, q=q, v=v) == pytest.approx(np.sign(v) * (1 + rise) + 3 * v, rel=1e-12)


def test_the_stribeck_effect_is_the_stribeck_term_of_the_law() -> None:
    law = LuGre(sigma0=1e4, Fc=2.0, Fs=4.0, Vs=0.02, delta=2.0)
    effect, plain = StribeckEffect(Fs=4.0, Vs=0.02), replace(law, Fs=None, Vs=None)
    for v in (-0.5, -0.02, 0.0, 1e-4, 0.03, 9.0):
        motion = mount().at(0.0, 0.0, v)
        assert float(effect.level(plain.level(v), motion)) == pytest.approx(float(law.level(v)), rel=1e-14)


def test_friction_effects_add_up_in_their_order() -> None:
    both = (StribeckEffect(Fs=4.0, Vs=1e3), FrictionAsymmetry(level_asymmetry=0.1))
    assert torque(*both, v=0.1) == pytest.approx(4.0 * 1.1 + 0.3, rel=1e-6)
    assert torque(*reversed(both), v=0.1) == pytest.approx(4.0 + 0.3, rel=1e-6)


# Temperature


@pytest.mark.parametrize("degrees", [-10.0, 20.0, 45.0])
def test_warm_grease_is_thin_and_the_card_holds_at_20_degrees(degrees: float) -> None:
    effect = ThermalViscosity(viscous_per_degC=-0.04, coulomb_per_degC=-0.02)
    expected = np.exp(-0.02 * (degrees - 20)) + 0.6 * np.exp(-0.04 * (degrees - 20))
    assert torque(effect, temperature=degrees) == pytest.approx(expected)
    slope = (torque(effect, temperature=20.001) - torque(effect, temperature=19.999)) / 0.002
    assert slope == pytest.approx(-0.02 * 1.0 - 0.04 * 0.6, rel=1e-6)  # the relative change at 20 degC


def test_the_temperature_is_an_input_that_starts_at_20_degrees_and_is_shared() -> None:
    two = (ThermalViscosity(viscous_per_degC=-0.04), WarmingViscosity(viscous_per_degC=0.01, warm_up_degC=5.0))
    inputs = mount(*two).model().inputs
    assert [(one.name, one.unit, one.start) for one in inputs[2:]] == [("temperature", "degC", 20.0)]
    assert len(mount().model().inputs) == 2


def test_a_bearing_warms_up_with_its_time_constant() -> None:
    effect = WarmingViscosity(viscous_per_degC=-0.04, warm_up_degC=15.0, warm_up_s=30.0)
    run = simulate(mount(effect).model(), np.array([0.0, 30.0, 600.0]), lambda t: 4.0, temperature=10.0)
    rise = run["thermal_viscosity.rise"]
    np.testing.assert_allclose(rise, 15 * (1 - np.exp([0, -1, -20])), rtol=1e-6)
    assert run["v"][-1] == pytest.approx((4.0 - 1.0) / (3.0 * np.exp(-0.04 * (10 + 15 - 20))), rel=1e-6)


def test_rubbing_heats_a_bearing_and_rest_cools_it() -> None:
    """Rise to h |v| tau at constant speed; a balanced torque keeps the speed of 1 rad/s."""
    effect = RubbedViscosity(viscous_per_degC=0.0, heat_degC_per_rad=0.5, cooling_s=20.0)
    run = simulate(mount(effect).model(), np.array([0.0, 20.0, 400.0]), lambda t: 4.0)
    speed = (4.0 - 1.0) / 3.0
    assert run["v"][-1] == pytest.approx(speed, rel=1e-6)
    assert run["thermal_viscosity.rise"][-1] == pytest.approx(0.5 * speed * 20.0, rel=1e-3)
    at_rest = simulate(mount(effect).model(), np.array([0.0, 20.0, 60.0]), start={"thermal_viscosity.rise": 10.0})
    np.testing.assert_allclose(at_rest["thermal_viscosity.rise"], 10.0 * np.exp([0.0, -1.0, -3.0]), rtol=1e-6)


# Rest


def test_a_longer_rest_costs_its_logarithm_in_break_away() -> None:
    """A fresh contact at rest ages by the second: each e-fold of rest costs the torque of its name."""
    effect = DwellBreakaway(torque_per_efold=0.3, onset_s=0.1)
    run = simulate(mount(effect).model(), np.array([0.0, 1.0, 10.0]))
    np.testing.assert_allclose(run["dwell_breakaway.age"], [0, 1, 10], rtol=1e-9)
    levels = [torque(effect, v=1e-3, **{"dwell_breakaway.age": age}) - 3e-3 for age in (0.0, 1.0, 10.0)]
    np.testing.assert_allclose(levels, 1 + 0.3 * np.log(1 + np.array([0, 1, 10]) / 0.1), rtol=1e-9)
    assert levels[2] - levels[1] == pytest.approx(0.3 * np.log(10), rel=0.04)


def test_sliding_renews_the_contact_over_its_memory() -> None:
    effect = DwellBreakaway(torque_per_efold=0.3, memory_rad=1e-3)
    model, name = mount(effect, friction=Coulomb(Fc=0.0, sigma2=300.0)).model(), "dwell_breakaway.age"
    run = simulate(model, np.linspace(0, 1, 101), lambda t: 30.0, start={name: 100.0, "speed": 0.1})
    assert run[name][-1] == pytest.approx(1e-3 / run["v"][-1], rel=1e-3)  # steady: memory over speed
    moved = np.argmax(run["q"] > 1e-3)
    assert run[name][moved] < 100 / np.e * 1.05


# Load


def test_friction_grows_with_the_weights_on_the_axis_and_with_nothing_else() -> None:
    effect, weight = LoadDependentFriction(coulomb_per_Nm=0.2), GravityUnbalance(mgl=5.0, phase=0.1)
    for q in (-1.0, 0.0, 1.4):
        assert torque(effect, weight, q=q) == pytest.approx(1.6 + 0.2 * 5 * abs(np.sin(q + 0.1)))
    assert torque(effect, Cogging(cycles_per_rev=4, amplitude=9.0), disturbance=7.0) == pytest.approx(1.6)
    two = (weight, GravityUnbalance(mgl=5.0, phase=0.1 + np.pi))  # that balance each other
    assert torque(effect, *two, q=1.0) == pytest.approx(1.6)


# Contact


def test_a_static_law_with_presliding_is_lugre() -> None:
    effect, law = Presliding(sigma0=2e4, sigma1=90.0), Coulomb(Fc=1.0, sigma2=3.0)
    bent = mount(effect, friction=law).model()
    lugre = mount(friction=LuGre(sigma0=2e4, sigma1=90.0, sigma2=3.0, Fc=1.0)).model()
    assert [s.name for s in bent.states] == [s.name for s in lugre.states]
    for z, v in ((0.0, 0.1), (0.7, -0.02), (-0.9, 1e-5)):
        values = {"friction.bristle": z, "speed": v, "tau": 2.0}
        assert evaluate(bent, **values) == pytest.approx(evaluate(lugre, **values), rel=1e-12)


def test_below_break_away_the_axis_bends_and_springs_back() -> None:
    """Slowly, along dz/dx = sigma0 (1 - |z| / Fc): there over -ln(1 - r) Fc / sigma0, back over ln(1 + r) of it."""
    model = mount(Presliding(sigma0=2e4, sigma1=200.0)).model()
    run = simulate(model, np.linspace(0, 4, 401), lambda t: 0.1 * min(t, 1.0) if t < 2 else 0.1 * max(3.0 - t, 0.0))
    there, back = -np.log(0.9) / 2e4, np.log(1.1) / 2e4
    assert run["q"][199] == pytest.approx(there, rel=0.01)
    assert run["q"][199] - run["q"][-1] == pytest.approx(back, rel=0.01)


def test_presliding_replaces_the_bristles_of_a_law_that_has_its_own() -> None:
    law = LuGre(sigma0=1e6, sigma1=0.0, sigma2=3.0, Fc=1.0, Fs=1.5, Vs=0.1)
    model = mount(Presliding(sigma0=2e4), friction=law).model()
    found = evaluate(model, speed=1e-6, **{"friction.bristle": 0.0})
    assert found["der(friction.bristle)"] == pytest.approx(2e4 * 1e-6)
    assert [s.name for s in model.states] == ["position", "speed", "friction.bristle"]
    sliding = evaluate(model, speed=0.05, **{"friction.bristle": float(law.level(0.05))})
    assert sliding["der(friction.bristle)"] == pytest.approx(0, abs=1e-9)  # its level is still the law's


def test_bristles_without_friction_carry_nothing() -> None:
    found = evaluate(mount(Presliding(sigma0=2e4), friction=Frictionless()).model(), speed=0.3, tau=1.0)
    assert found["der(speed)"] == pytest.approx(1.0 / INERTIA, abs=1e-6)
