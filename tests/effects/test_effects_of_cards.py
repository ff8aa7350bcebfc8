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
from pyfmi_models.effects.bouc_wen import BoucWen
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


# Gears

WEIGHT = GravityUnbalance(mgl=2.0, phase=0.3)
GEAR = GearFriction(driving=0.6, driven=0.2)


@pytest.mark.parametrize("load", [-4.0, 4.0])
def test_a_gear_of_a_linear_axis_feels_a_known_load(load: float) -> None:
    for v in (-0.2, 0.2):
        level = 1.0 + (0.6 if load * v > 0 else 0.2) * 4.0
        found = friction(KnownLoad(), GEAR, motion="linear", position=0.7, speed=v, load_torque=load)
        assert found == pytest.approx(level * np.sign(v) + 3 * v, rel=1e-12)


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


# Droop


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
