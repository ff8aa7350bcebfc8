"""Friction effects do what their names say, on the level, the viscous part and the contact of any law."""

import numpy as np
import pytest
from effect_examples import INERTIA, evaluate, mount, simulate

from pyfmi_models.effects import (
    Cogging,
    FrictionAsymmetry,
    FrictionEffect,
    GravityUnbalance,
    StribeckEffect,
)
from pyfmi_models.effects.load_dependent_friction import LoadDependentFriction
from pyfmi_models.effects.presliding import Presliding
from pyfmi_models.effects.thermal_viscosity import RubbedViscosity, ThermalViscosity, WarmingViscosity
from pyfmi_models.friction import Coulomb, Frictionless, LuGre


def torque(*effects: FrictionEffect, q: float = 0.0, v: float = 0.2, **values: float) -> float:
    """Friction torque of an axis with 1 N m of Coulomb friction, 3 N m s/rad and these effects."""
    return evaluate(mount(*effects).model(), position=q, speed=v, **values)["friction"]


def test_friction_effects_add_up_in_their_order() -> None:
    both = (StribeckEffect(Fs=4.0, Vs=1e3), FrictionAsymmetry(level_asymmetry=0.1))
    assert torque(*both, v=0.1) == pytest.approx(4.0 * 1.1 + 0.3, rel=1e-6)
    assert torque(*reversed(both), v=0.1) == pytest.approx(4.0 + 0.3, rel=1e-6)


# Temperature


def test_the_temperature_is_an_input_that_starts_at_20_degrees_and_is_shared() -> None:
    two = (ThermalViscosity(viscous_per_degC=-0.04), WarmingViscosity(viscous_per_degC=0.01, warm_up_degC=5.0))
    inputs = mount(*two).model().inputs
    assert [(one.name, one.unit, one.start) for one in inputs[2:]] == [("temperature", "degC", 20.0)]
    assert len(mount().model().inputs) == 2


def test_rubbing_heats_a_bearing_and_rest_cools_it() -> None:
    """Rise to h |v| tau at constant speed; a balanced torque keeps the speed of 1 rad/s."""
    effect = RubbedViscosity(viscous_per_degC=0.0, heat_degC_per_rad=0.5, cooling_s=20.0)
    run = simulate(mount(effect).model(), np.array([0.0, 20.0, 400.0]), lambda t: 4.0)
    speed = (4.0 - 1.0) / 3.0
    assert run["v"][-1] == pytest.approx(speed, rel=1e-6)
    assert run["thermal_viscosity.rise"][-1] == pytest.approx(0.5 * speed * 20.0, rel=1e-3)
    at_rest = simulate(mount(effect).model(), np.array([0.0, 20.0, 60.0]), start={"thermal_viscosity.rise": 10.0})
    np.testing.assert_allclose(at_rest["thermal_viscosity.rise"], 10.0 * np.exp([0.0, -1.0, -3.0]), rtol=1e-6)


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
