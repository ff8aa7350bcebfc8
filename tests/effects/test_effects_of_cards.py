"""Effects that a card may hold and a diagnosis does not ask for yet, each beside its equation in numpy."""

from typing import Any

import numpy as np
import pytest
from effect_examples import EXAMPLES, INERTIA, evaluate, mount, simulate
from export_models import Driver
from scipy.integrate import solve_ivp

from cosim.diagnosis.trust.admission import check_effects
from cosim.support.errors import InputError
from pyfmi_models.card import parse_card
from pyfmi_models.effects import GravityUnbalance
from pyfmi_models.effects.bouc_wen import BoucWen
from pyfmi_models.effects.clock_skew import ClockSkew
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity
from pyfmi_models.effects.gear_friction import GearFriction
from pyfmi_models.effects.known_load import KnownLoad
from pyfmi_models.effects.rough_spot import RoughSpot
from pyfmi_models.effects.torque_droop import TorqueDroop, WarmTorqueDroop
from pyfmi_models.effects.torque_saturation import TorqueSaturation
from pyfmi_models.errors import CardError
from pyfmi_models.export import build_library
from pyfmi_models.friction import Coulomb, Frictionless
from pyfmi_models.mount import Axis


def friction(*effects: Any, motion: str = "rotary", **values: float) -> float:
    """Friction torque of an axis with 1 N m of Coulomb friction, 3 N m s/rad and these effects."""
    return evaluate(mount(*effects, motion=motion).model(), **values)["friction"]


WEIGHT = GravityUnbalance(mgl=2.0, phase=0.3)
GEAR = GearFriction(driving=0.6, driven=0.2)


@pytest.mark.parametrize("load", [-4.0, 4.0])
def test_a_gear_of_a_linear_axis_feels_a_known_load(load: float) -> None:
    for v in (-0.2, 0.2):
        level = 1.0 + (0.6 if load * v > 0 else 0.2) * 4.0
        found = friction(KnownLoad(), GEAR, motion="linear", position=0.7, speed=v, load_torque=load)
        assert found == pytest.approx(level * np.sign(v) + 3 * v, rel=1e-12)


SPOT = RoughSpot(q_center=0.3, width=0.1, forward=0.8, backward=-0.3)


def drooped(command: float, droop: float, rated: float) -> float:
    """The docstring's equation, in numpy."""
    s = np.hypot(np.array([command / rated, 1.0]), 0.05) - 0.05
    return command / (1 + (1 / (1 - droop) - 1) * s[0] / s[1])


LINEAR = {
    SPOT: {"q_center": "m", "width": "m", "forward": "1"},
    WarmTorqueDroop(droop=0.1, rated_torque=8.0, per_degC=-0.002): {
        "rated_torque": "N",
        "droop": "1",
        "per_degC": "1/K",
    },
    BoucWen(torque=0.8, stroke=0.05): {"stroke": "m", "torque": "N"},
    GEAR: {"driving": "1", "driven": "1"},
}


@pytest.mark.parametrize("effect", LINEAR, ids=lambda one: one.id)
def test_numbers_of_a_linear_axis_are_in_its_units(effect: Any) -> None:
    units = {one.name: one.unit for one in mount(WEIGHT, effect, motion="linear").parameters()}
    assert {name: units[f"{effect.id}.{name}"] for name in LINEAR[effect]} == LINEAR[effect]


def test_a_card_takes_the_form_with_a_temperature_by_its_key() -> None:
    text = '[mount]\ninertia = 2.0\n[friction]\nmodel = "none"\n[[effects]]\neffect = "torque_droop"\n'
    numbers = "droop = 0.1\nrated_torque = 8.0\n"
    assert parse_card(text + numbers, "c").effects == (TorqueDroop(droop=0.1, rated_torque=8.0),)
    warm = WarmTorqueDroop(droop=0.1, rated_torque=8.0, per_degC=-0.001)
    assert parse_card(text + numbers + "per_degC = -0.001\n", "c").effects == (warm,)
    with pytest.raises(CardError, match='"warmth" is not a key'):
        parse_card(text + numbers + "warmth = 3.0\n", "c")


@pytest.mark.parametrize("effect", [one for one in EXAMPLES if type(one).__name__ == "BoucWen"])
def test_a_card_with_what_an_inverse_cannot_follow_is_refused_by_a_diagnosis(effect: Any) -> None:
    with pytest.raises(InputError, match=f"The card holds {effect.id}, which a diagnosis cannot take into account yet"):
        check_effects(mount(effect))


# Hysteresis of Bouc and Wen, and an FMU with all effects of this kind beside numpy alone.


def test_numbers_that_would_make_energy_are_refused_in_a_sentence() -> None:
    """With gamma above beta, pushing back against a large z makes it larger still, without end."""
    text = '[mount]\ninertia = 2.0\n[friction]\nmodel = "none"\n[[effects]]\neffect = "bouc_wen"\ntorque = 1.0\n'
    for beta, gamma in ((0.5, 1.5), (0.5, -0.5), (0.0, 0.0)):
        with pytest.raises(CardError, match=rf"\(bouc_wen\): gamma = {gamma:g} must be above -beta and at most beta"):
            parse_card(text + f"stroke = 0.05\nbeta = {beta}\ngamma = {gamma}\n", "c")
    assert parse_card(text + "stroke = 0.05\nbeta = 0.5\ngamma = 0.5\n", "c").effects


def rates(t: float, x: np.ndarray, tau: float) -> list[float]:
    """The plant of these effects in numpy: position, speed, z; inertia 2 kg m2, friction 1 N m and 3 N m s/rad."""
    q, v, z = x
    load = 2.0 * np.sin(q + 0.3)
    level = 1.0 * (1 + (0.8 if v > 0 else -0.3) * np.exp(-0.5 * ((q - 0.3) / 0.1) ** 2))
    level += (0.6 if load * v > 0 else 0.2) * abs(load)
    bent = (z * z + 1e-6) ** 0.25
    turning = (v - bent * (0.6 * abs(v) * z - 0.3 * v * abs(z))) / 0.05
    applied = drooped(tau, 0.2, 8.0) * (1 - 0.002 * (45.0 - 20.0))
    return [v, (applied - level * np.tanh(v / 1e-2) - 3 * v - load - 0.8 * z) / 2.0, turning]


def test_an_fmu_with_these_effects_moves_as_numpy_says() -> None:
    hysteresis = BoucWen(torque=0.8, stroke=0.05, beta=0.6, gamma=-0.3, n=1.5)
    warm = WarmTorqueDroop(droop=0.2, rated_torque=8.0, per_degC=-0.002)
    law = Coulomb(Fc=1.0, sigma2=3.0, smoothing=1e-2)
    model = mount(warm, SPOT, WEIGHT, GEAR, hysteresis, friction=law).model()
    driver, now, x, moved = Driver(model, build_library(model), 3), 0, np.zeros(3), []
    driver.start(tolerance=1e-9, temperature=45.0)
    for until, tau in ((300, 9.0), (700, -8.0), (900, 0.5), (1200, 7.0)):
        span = (now * 1e-3, until * 1e-3)
        x = solve_ivp(rates, span, x, "Radau", args=(tau,), rtol=1e-10, atol=1e-12, max_step=1e-3).y[:, -1]
        driver.set("tau", tau)
        driver.run(now * 1e-3, until - now, 1e-3)
        now = until
        found = np.array(driver.get("q", "v", "bouc_wen.z"))
        np.testing.assert_allclose(found, x, rtol=0, atol=2e-6)
        moved.append(found[0])
    assert np.ptp(moved) > 0.2


# Between torque and mass, and between mass and reading: saturation, eccentricity, clocks.

KNEE = TorqueSaturation(knee_torque=5.0, slope=0.4)
DISC = EncoderEccentricity(cycles_per_rev=8, amplitude_rad=1e-3, phase=0.3, second=0.2)


def test_the_torque_limit_acts_before_the_knee() -> None:
    model = mount(KNEE, axis=Axis(inertia=INERTIA, torque_limit=6.0)).model()
    assert evaluate(model, tau=100.0)["applied"] == pytest.approx(5.4, abs=1e-4)


def test_encoder_turns_of_a_linear_axis_are_per_metre() -> None:
    model = mount(DISC, motion="linear").model()
    assert evaluate(model, position=0.31)["q"] - 0.31 == pytest.approx(
        evaluate(model, position=0.31 + 1 / 8)["q"] - 0.31 - 1 / 8, abs=1e-15
    )
    assert next(v.unit for v in model.parameters if v.name.endswith("amplitude_rad")) == "m"


def test_errors_of_several_encoders_add_up() -> None:
    twice = mount(DISC, EncoderEccentricity(cycles_per_rev=1, amplitude_rad=2e-3)).model()
    one, two = (1e-3 * (np.sin(1.9) + 0.2 * np.sin(3.8)), 2e-3 * np.sin(0.2))
    assert evaluate(twice, position=0.2)["q"] - 0.2 == pytest.approx(one + two)


@pytest.mark.parametrize("offset", [-6.0, 6.0])
def test_a_skewed_clock_records_the_reading_of_another_time(offset: float) -> None:
    """Without friction a constant torque makes a parabola, for which the prediction is exact."""
    clock = ClockSkew(offset_ms=offset, drift_ppm=2000.0)
    run = simulate(mount(clock, friction=Frictionless()).model(), np.linspace(0, 2, 21), lambda t: 3.0)
    then = run["t"] + 1e-3 * offset + 2e-3 * run["t"]
    np.testing.assert_allclose(run["q"], 3.0 / INERTIA * run["t"] ** 2 / 2, atol=1e-9)
    np.testing.assert_allclose(run["q_recorded"], 3.0 / INERTIA * then**2 / 2, atol=1e-9)


def test_the_loop_does_not_see_the_clock() -> None:
    with_it, without = (
        evaluate(mount(*effects).model(), position=0.1, speed=0.2, tau=1.0)
        for effects in ([ClockSkew(offset_ms=5)], [])
    )
    assert with_it.pop("q_recorded") != with_it["q"]
    assert with_it == without
