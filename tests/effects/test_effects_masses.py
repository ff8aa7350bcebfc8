"""Springs, a play and friction that wanders: their equations in time and frequency, again in plain Python."""

import math
from itertools import product
from random import Random
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from effect_examples import FORM, INERTIA, evaluate, example, mount
from test_effects_equations import near, sign

from pyfmi_models.effects import Cogging, FrictionAsymmetry, FrictionEffect, FrictionWander, GravityUnbalance
from pyfmi_models.friction import Coulomb, LuGre
from pyfmi_models.mount import Axis


def test_a_spring_between_two_masses_is_its_equation_in_time_and_over_frequency() -> None:
    """Antiresonance 20 Hz, resonance 25 Hz, both masses 2 kg m2: at s = j w the far mass moves k + d s of the near."""
    spring = example(FORM["Compliance"])
    far = 2 * (1 - 0.64)
    k, d = far * (40 * math.pi) ** 2, 2 * 0.02 * far * 40 * math.pi
    near(spring.share(), 0.36)
    near(spring.torque(1e-3, 0.2, far), k * 1e-3 + d * 0.2)
    for w, damping in product((1.0, 60.0, 40 * math.pi, 900.0), (0.02, 0.0)):
        d = 2 * max(damping, 1e-4) * far * 40 * math.pi
        moved = (k + d * 1j * w) / (far * (1j * w) ** 2 + k + d * 1j * w)
        found = FORM["Compliance"](antiresonance_hz=20.0, resonance_hz=25.0, damping_ratio=damping)
        np.testing.assert_allclose(found.carried(np.array([w])), [moved], rtol=1e-12)


def test_a_spring_before_the_axis_is_its_equation_in_time_and_over_frequency() -> None:
    """Resonance 60 Hz; of 2 kg m2 the axis has 1.2, so the motor has 0.8."""
    spring, motor, axis, w = example(FORM["LoadSideCompliance"]), 0.8, 1.2, 120 * math.pi
    k = w**2 * motor * axis / 2
    d = k * 2 * 0.02 / w
    near(spring.share(), 0.6)
    near(spring.antiresonance_hz(), 60 * math.sqrt(0.4))
    near(spring.torque(1e-3, 0.2, axis), k * 1e-3 + d * 0.2)
    omega = np.array([1.0, 60.0, 377.0, 2e3])
    expected = [1 + motor * (1j * one) ** 2 / (k + d * 1j * one) for one in omega]
    np.testing.assert_allclose(spring.demand(omega), expected, rtol=1e-12)


PLAY = FORM["Backlash"](gap_rad=0.01, load_friction=0.3, load_viscous=0.7, load_deflection=1e-3, contact_hz=30.0)


@pytest.mark.parametrize(("twist", "rate"), [(0.004, 1.0), (0.006, 0.0), (0.006, 0.5), (0.006, -9.0), (-0.0051, -0.4)])
def test_a_play_passes_nothing_in_its_gap_and_pushes_beyond_it_and_never_pulls(twist: float, rate: float) -> None:
    far, side, depth = 1.5, sign(twist), max(abs(twist) - 0.005, 0)
    k = far * (60 * math.pi) ** 2
    d = 2 * 0.75 * far * 60 * math.pi * (1 - math.exp(-depth / 1e-5))
    near(PLAY.torque(twist, rate, far), side * max(k * depth + d * side * rate, 0))


def test_the_far_side_of_a_play_rubs_by_its_bristle_and_its_oil() -> None:
    for speed, z in product((-0.2, 0.0, 0.5), (-8e-4, 0.0, 1e-3)):
        near(PLAY.drag(speed, [0.0, 0.0, z]), 0.3 * z / 1e-3 + 0.7 * speed)
        near(PLAY.further_rates(speed, [0.0, 0.0, z])[0], speed - abs(speed) * z / 1e-3)


@pytest.mark.parametrize("seed", range(30))
def test_a_step_of_a_play_solves_its_implicit_equations(seed: int) -> None:
    """Contact and friction at the end of the step: what they give changes the speed by just that."""
    dice, far, dt = Random(seed), 1.5, 10 ** Random(seed).uniform(-5, -2)
    twist, v, z = dice.uniform(-0.012, 0.012), dice.uniform(-1, 1), dice.uniform(-1e-3, 1e-3)
    speed = dice.uniform(-1, 1)
    after_twist, after, after_z, passed = map(float, PLAY.advance(twist, v, (z,), speed, dt, far))
    assert after_twist == pytest.approx(twist + dt * (speed - after), abs=1e-14)
    assert after_z == pytest.approx(z + dt * (after - abs(after) * after_z / 1e-3), abs=1e-13)
    side = sign(twist + dt * (speed - v))
    pushed = (v + dt * passed / far) / (1 + dt * 0.7 / far)
    assert after == pytest.approx(pushed - dt * 0.3 * after_z / 1e-3 / far, abs=1e-12)
    deep, before = side * (twist + dt * (speed - v) - dt * dt * passed / far) - 0.005, max(side * twist - 0.005, 0)
    omega = 60 * math.pi
    contact = side * far * max(omega**2 * deep + 2 * 0.75 * omega * (deep - before) / dt, 0)
    assert passed == pytest.approx(contact, rel=1e-7, abs=1e-9)


def wandered(t: float, e: Any) -> float:
    """Relative change of the level in whole numbers: what is drawn is a congruential generator's, cubed by squares."""
    modulus, multiplier = 94906249, 48271

    def scrambled(seed: int) -> int:
        number = seed + 1
        for _ in range(3):
            number = (multiplier * number + 1) % modulus
            number = number * number % modulus
        return number

    def jump(count: int) -> float:
        return e.jump_std * math.sqrt(3) * (2 * scrambled(e.seed * 7919 + (count + 1) * 104729) / modulus - 1)

    number, slow = scrambled(e.seed), 0.0
    for k in range(8):
        number = (multiplier * number + 1) % modulus
        rate = math.tan(math.pi / 2 * (k + 0.5) / 8) * (1 + 0.35 * (2 * number / modulus - 1)) / e.correlation_time
        number = (multiplier * number + 1) % modulus
        slow += math.sin(rate * t + 2 * math.pi * number / modulus)
    count = math.floor(t / e.jump_period)
    x = min((t / e.jump_period - count) / 0.02, 1)
    return e.std * math.sqrt(2 / 8) * slow + jump(count - 1) + (jump(count) - jump(count - 1)) * (3 * x**2 - 2 * x**3)


@pytest.mark.parametrize("t", [0.0, 0.01, 1.99, 2.0, 2.013, 2.039, 2.041, 7.7, 94.3])
def test_friction_wanders_as_its_generator_says_in_whole_numbers(t: float) -> None:
    numbers: dict[str, Any] = {"std": 0.1, "correlation_time": 0.7, "jump_std": 0.2, "jump_period": 2.0, "seed": 12}
    found = FrictionWander(**numbers).level(2.0, SimpleNamespace(t=t))  # type: ignore[arg-type]
    near(found, 2 * max(0.05, 1 + wandered(t, SimpleNamespace(**numbers))))


# Friction effects do what their names say, on the level, the viscous part and the contact of any law.


def torque(*effects: FrictionEffect, q: float = 0.0, v: float = 0.2, **values: float) -> float:
    """Friction torque of an axis with 1 N m of Coulomb friction, 3 N m s/rad and these effects."""
    return evaluate(mount(*effects).model(), position=q, speed=v, **values)["friction"]


def test_friction_effects_add_up_in_their_order() -> None:
    both = (FORM["StribeckEffect"](Fs=4.0, Vs=1e3), FrictionAsymmetry(level_asymmetry=0.1))
    assert torque(*both, v=0.1) == pytest.approx(4.0 * 1.1 + 0.3, rel=1e-6)
    assert torque(*reversed(both), v=0.1) == pytest.approx(4.0 + 0.3, rel=1e-6)


def test_the_temperature_is_an_input_that_starts_at_20_degrees_and_is_shared() -> None:
    two = (
        FORM["ThermalViscosity"](viscous_per_degC=-0.04),
        FORM["WarmingViscosity"](viscous_per_degC=0.01, warm_up_degC=5.0),
    )
    inputs = mount(*two).model().inputs
    assert [(one.name, one.unit, one.start) for one in inputs[2:]] == [("temperature", "degC", 20.0)]
    assert len(mount().model().inputs) == 2


def test_friction_grows_with_the_weights_on_the_axis_and_with_nothing_else() -> None:
    effect, weight = FORM["LoadDependentFriction"](coulomb_per_Nm=0.2), GravityUnbalance(mgl=5.0, phase=0.1)
    for q in (-1.0, 0.0, 1.4):
        assert torque(effect, weight, q=q) == pytest.approx(1.6 + 0.2 * 5 * abs(np.sin(q + 0.1)))
    assert torque(effect, Cogging(cycles_per_rev=4, amplitude=9.0), disturbance=7.0) == pytest.approx(1.6)
    two = (weight, GravityUnbalance(mgl=5.0, phase=0.1 + np.pi))  # that balance each other
    assert torque(effect, *two, q=1.0) == pytest.approx(1.6)


@pytest.mark.parametrize(("inertia", "others"), [(1.0, 0.0), (0.4, 0.0), (1.0, 1.0), (0.7, 0.4)])
def test_friction_of_a_gear_grows_with_all_that_goes_through_its_teeth(inertia: float, others: float) -> None:
    """Whatever the torque: lifting, lowering, driving and braking, the axis accelerates as the friction then says."""
    effect = FORM["GearLoadFriction"](coulomb_per_Nm=0.2, at_level=1.0, inertia_share=inertia, friction_share=others)
    effects = (GravityUnbalance(mgl=5.0, phase=0.1), Cogging(cycles_per_rev=4, amplitude=0.8), effect)
    for q, v, tau in product((-1.0, 1.4), (-0.5, 0.2), (-20.0, -4.0, 0.0, 3.0, 15.0)):
        found = evaluate(mount(*effects).model(), position=q, speed=v, tau=tau)
        weight, other = 5 * np.sin(q + 0.1), 0.8 * np.cos(4 * q)
        through = weight + inertia * INERTIA * found["der(speed)"] + others * (found["friction"] + other)
        assert found["friction"] == pytest.approx(np.sign(v) * (1 + 0.2 * abs(through)) + 3 * v, rel=1e-9)
        assert INERTIA * found["der(speed)"] == pytest.approx(tau - found["friction"] - weight - other, rel=1e-9)


def test_a_static_law_with_presliding_is_lugre() -> None:
    effect, law = FORM["Presliding"](sigma0=2e4, sigma1=90.0), Coulomb(Fc=1.0, sigma2=3.0)
    bent = mount(effect, friction=law).model()
    lugre = mount(friction=LuGre(sigma0=2e4, sigma1=90.0, sigma2=3.0, Fc=1.0)).model()
    assert [s.name for s in bent.states] == [s.name for s in lugre.states]
    for z, v in ((0.0, 0.1), (0.7, -0.02), (-0.9, 1e-5)):
        values = {"friction.bristle": z, "speed": v, "tau": 2.0}
        assert evaluate(bent, **values) == pytest.approx(evaluate(lugre, **values), rel=1e-12)


def test_presliding_replaces_the_bristles_of_a_law_that_has_its_own() -> None:
    law = LuGre(sigma0=1e6, sigma1=0.0, sigma2=3.0, Fc=1.0, Fs=1.5, Vs=0.1)
    model = mount(FORM["Presliding"](sigma0=2e4), friction=law).model()
    found = evaluate(model, speed=1e-6, **{"friction.bristle": 0.0})
    assert found["der(friction.bristle)"] == pytest.approx(2e4 * 1e-6)
    assert [s.name for s in model.states] == ["position", "speed", "friction.bristle"]
    sliding = evaluate(model, speed=0.05, **{"friction.bristle": float(law.level(0.05))})
    assert sliding["der(friction.bristle)"] == pytest.approx(0, abs=1e-9)  # its level is still the law's


# What effects of a mount do together, and where each acts.


@pytest.mark.parametrize("load", [-4.0, 4.0])
def test_a_gear_of_a_linear_axis_feels_a_known_load(load: float) -> None:
    effects = (FORM["KnownLoad"](), FORM["GearFriction"](driving=0.6, driven=0.2))
    for v in (-0.2, 0.2):
        found = evaluate(mount(*effects, motion="linear").model(), position=0.7, speed=v, load_torque=load)["friction"]
        level = 1.0 + (0.6 if load * v > 0 else 0.2) * 4.0
        assert found == pytest.approx(level * np.sign(v) + 3 * v, rel=1e-12)


def test_the_torque_limit_acts_before_the_knee() -> None:
    knee = FORM["TorqueSaturation"](knee_torque=5.0, slope=0.4)
    model = mount(knee, axis=Axis(inertia=INERTIA, torque_limit=6.0)).model()
    assert evaluate(model, tau=100.0)["applied"] == pytest.approx(5.4, abs=1e-4)


DISC = FORM["EncoderEccentricity"](cycles_per_rev=8, amplitude_rad=1e-3, phase=0.3, second=0.2)


def test_cycles_of_a_linear_axis_are_per_metre() -> None:
    model = mount(Cogging(cycles_per_rev=4, amplitude=1.0), DISC, motion="linear").model()
    for q, load in ((0.0, 1.0), (0.125, -1.0), (0.25, 1.0), (1.0, 1.0)):
        found = evaluate(model, position=q)
        assert found["der(speed)"] == pytest.approx(-load / INERTIA, abs=1e-12)
        assert found["q"] - q == pytest.approx(1e-3 * (np.sin(0.3) + 0.2 * np.sin(0.6)), abs=1e-15)


def test_errors_of_several_encoders_add_up() -> None:
    other = FORM["EncoderEccentricity"](cycles_per_rev=1, amplitude_rad=2e-3)
    one, two = 1e-3 * (np.sin(1.9) + 0.2 * np.sin(3.8)), 2e-3 * np.sin(0.2)
    assert evaluate(mount(DISC, other).model(), position=0.2)["q"] - 0.2 == pytest.approx(one + two)
