"""Effects that a card may hold and a diagnosis does not ask for yet, each beside its equation in numpy."""

from typing import Any

import numpy as np
import pytest
from effect_examples import EXAMPLES, evaluate, mount, simulate

from cosim.diagnosis.effects import TRIED
from cosim.diagnosis.trust.admission import check_effects
from cosim.support.errors import InputError
from pyfmi_models.card import parse_card
from pyfmi_models.effects import CATALOGUE, GravityUnbalance
from pyfmi_models.effects.concave_viscous import ConcaveViscous
from pyfmi_models.effects.dead_band import DeadBand
from pyfmi_models.effects.gear_friction import GearFriction
from pyfmi_models.effects.known_load import KnownLoad
from pyfmi_models.effects.rough_spot import RoughSpot
from pyfmi_models.effects.torque_droop import TorqueDroop, WarmTorqueDroop
from pyfmi_models.errors import CardError

ASKED = """
    friction_asymmetry stribeck presliding position_friction load_dependent_friction dwell_breakaway thermal_viscosity
    torque_offset constant_force cogging gravity_unbalance cable_wrap quadratic_drag periodic_disturbance
    torque_saturation delay actuator_lag clock_skew inertia_variation compliance encoder_eccentricity backlash
    concave_viscous axis_coupling
"""
"""What a diagnosis looks for: an effect in the catalogue is not asked for before it has a hypothesis."""
OF_CARDS = ("dead_band", "gear_friction", "rough_spot", "torque_droop", "bouc_wen")


def friction(*effects: Any, motion: str = "rotary", **values: float) -> float:
    """Friction torque of an axis with 1 N m of Coulomb friction, 3 N m s/rad and these effects."""
    return evaluate(mount(*effects, motion=motion).model(), **values)["friction"]


def test_a_diagnosis_asks_for_what_it_did_and_for_none_of_these() -> None:
    assert set(TRIED) == set(ASKED.split())
    assert not set(OF_CARDS) & set(TRIED)
    assert set(OF_CARDS) <= set(CATALOGUE)


@pytest.mark.parametrize("softness", [0.2, 0.25, 2.0])
def test_each_torque_has_its_command(softness: float) -> None:
    command = np.linspace(-3, 3, 2001)
    given = np.array([float(DeadBand(band=0.5, softness=softness).applied((), u)) for u in command])
    assert np.all(np.diff(given) > 0.01 * np.diff(command))
    within = (given[1001] - given[999]) / (command[1001] - command[999])
    assert within == pytest.approx(2 / (1 + np.exp(1 / softness)), rel=1e-3)


@pytest.mark.parametrize("exponent", [-1.0, -0.4, 0.0, 0.6, 1.0])
def test_far_above_its_speed_viscous_friction_is_a_power_and_far_below_a_line(exponent: float) -> None:
    effect, line = ConcaveViscous(thinning_speed=0.1, exponent=exponent), 3.0

    def torque(v: float) -> float:
        return float(effect.viscous(line * v, mount(effect).at(0.0, 0.0, v)))

    assert torque(1e-4) == pytest.approx(line * 1e-4, rel=1e-5)
    assert torque(200.0) / torque(100.0) == pytest.approx(2.0**exponent, rel=1e-5)
    assert torque(100.0) == pytest.approx(line * 100.0 * 1000.0 ** (exponent - 1), rel=1e-5)
    assert torque(-0.3) == -torque(0.3) < 0.0


# Gears

WEIGHT = GravityUnbalance(mgl=2.0, phase=0.3)
GEAR = GearFriction(driving=0.6, driven=0.2)


@pytest.mark.parametrize("load", [-4.0, 4.0])
def test_a_gear_of_a_linear_axis_feels_a_known_load(load: float) -> None:
    for v in (-0.2, 0.2):
        level = 1.0 + (0.6 if load * v > 0 else 0.2) * 4.0
        found = friction(KnownLoad(), GEAR, motion="linear", position=0.7, speed=v, load_torque=load)
        assert found == pytest.approx(level * np.sign(v) + 3 * v, rel=1e-12)
    units = {one.name: one.unit for one in mount(WEIGHT, GEAR, motion="linear").parameters()}
    assert units["gear_friction.driving"] == units["gear_friction.driven"] == "1"


def test_a_gear_that_takes_more_than_it_lowers_holds_its_load() -> None:
    """The weight hangs out at a right angle; friction of the axis itself is small, and nothing drives."""
    far = {}
    for driven in (0.2, 1.2):
        gear = GearFriction(driving=1.5, driven=driven)
        run = simulate(mount(GravityUnbalance(mgl=20.0), gear).model(), np.array([0.0, 1.0]), start={"position": 1.5})
        far[driven] = abs(run["position"][-1] - 1.5)
    assert far[1.2] < 1e-4
    assert far[0.2] > 0.5


# Rough spots

SPOT = RoughSpot(q_center=0.3, width=0.1, forward=0.8, backward=-0.3)


@pytest.mark.parametrize("motion", ["rotary", "linear"])
@pytest.mark.parametrize("v", [-0.4, -0.01, 0.01, 0.4])
def test_a_rough_spot_is_another_forward_than_backward(v: float, motion: str) -> None:
    for q in (-9.0, 0.1, 0.25, 0.3, 0.5, 0.3 + 2 * np.pi):
        rise = (0.8 if v > 0 else -0.3) * np.exp(-0.5 * ((q - 0.3) / 0.1) ** 2)
        expected = (1 + rise) * np.sign(v) + 3 * v
        assert friction(SPOT, motion=motion, position=q, speed=v) == pytest.approx(expected, rel=1e-12)
    units = {one.name: one.unit for one in mount(SPOT, motion="linear").parameters()}
    assert [units[f"rough_spot.{name}"] for name in ("q_center", "width", "forward")] == ["m", "m", "1"]


# Droop


def drooped(command: float, droop: float, rated: float) -> float:
    """The docstring's equation, in numpy."""
    s = np.hypot(np.array([command / rated, 1.0]), 0.05) - 0.05
    return command / (1 + (1 / (1 - droop) - 1) * s[0] / s[1])


@pytest.mark.parametrize("droop", [0.0, 0.05, 0.3, 0.9])
def test_a_drive_that_droops_loses_its_share_at_the_rated_torque_and_more_always_gives_more(droop: float) -> None:
    drive = TorqueDroop(droop=droop, rated_torque=8.0)
    command = np.concatenate([-np.geomspace(1e-6, 800.0, 400)[::-1], np.geomspace(1e-6, 800.0, 400)])
    given = np.array([float(drive.applied((), u)) for u in command])
    np.testing.assert_allclose(given, [drooped(u, droop, 8.0) for u in command], rtol=1e-12)
    np.testing.assert_allclose(given, -given[::-1], rtol=1e-15)
    assert np.all(np.diff(given) > 0)
    assert float(drive.applied((), 8.0)) == pytest.approx((1 - droop) * 8.0, rel=1e-12)


@pytest.mark.parametrize("degrees", [-30.0, 20.0, 80.0])
def test_warm_magnets_give_less(degrees: float) -> None:
    drive = WarmTorqueDroop(droop=0.1, rated_torque=8.0, per_degC=-0.002)
    model = mount(drive).model()
    assert [(one.name, one.unit, one.start) for one in model.inputs[2:]] == [("temperature", "degC", 20.0)]
    found = evaluate(model, tau=5.0, temperature=degrees)["applied"]
    units = {one.name: one.unit for one in mount(drive, motion="linear").parameters()}
    assert [units[f"torque_droop.{name}"] for name in ("rated_torque", "droop", "per_degC")] == ["N", "1", "1/K"]
    assert found == pytest.approx(drooped(5.0, 0.1, 8.0) * (1 - 0.002 * (degrees - 20)), rel=1e-12)


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
