"""Cards come back as they were written, and make the plants that they describe."""

from dataclasses import replace

import pytest
from effect_examples import EXAMPLES, FORM

from pyfmi_models.card import Card, parse_card, read_card, shipped_cards
from pyfmi_models.card_writer import card_text
from pyfmi_models.effects import Cogging, GravityUnbalance, LocalFriction, PeriodicFriction
from pyfmi_models.friction import Coulomb, LuGre
from pyfmi_models.model import Pair

SMALL = '[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\n'
FULL = r"""
[mount]
name = "north \"axis\" 3°"
motion = "rotary"
inertia = 31.5
torque_limit = 50

[friction]
model = "lugre"
sigma0 = { positive = 9.85e4, negative = 8.61e4 }
sigma1 = 497
Fc = { positive = 2.1, negative = 2.4 }
Fs = 3.3
Vs = 0.04
delta = 1.292

[unbalance]
mgl = 1.5
phase = -0.2

[encoder]
counts_per_rev = 4294967296
noise_rms = 1e-9
ratio = 3

[controller]
kp = 225
kd = 30
compensation = "C3a"
observer_order = 4
velocity = "difference"

[controller.friction]
model = "lugre"
sigma0 = 9e4
Fc = { positive = 2.0, negative = 2.5 }

[controller.adaptation]
memory = 30

[controller.learning]
period = 5

[columns]
tau = "force"
"motor temperature" = "T_m"

[[effects]]
effect = "cogging"
cycles_per_rev = 24
amplitude = 0.5

[[effects]]
effect = "position_friction"
q_center = 1.0
width = 0.05
relative_amplitude = 0.3

[[effects]]
effect = "position_friction"
cycles_per_rev = 3
relative_amplitude = 0.2
phase = 0.1

[origin]
version = "0.1.0"
date = 2026-11-20
time = 2026-11-20T20:00:00Z
odd = "a\u007f\\\"\n\té"
recordings = [{ name = "train 1.csv", sha256 = "ab" }, { name = "b", sha256 = "cd" }]
evidence = { "held out" = { gain = 0.25, proven = true } }
"""


def full() -> Card:
    return parse_card(FULL, "full.toml")


def test_a_card_says_what_was_written() -> None:
    card = full()
    assert card.mount.name == 'north "axis" 3°'
    curve = {"Fc": Pair(2.1, 2.4), "Fs": 3.3, "Vs": 0.04, "delta": 1.292}
    assert card.friction == LuGre(sigma0=Pair(9.85e4, 8.61e4), sigma1=497.0, **curve)
    assert card.unbalance == GravityUnbalance(mgl=1.5, phase=-0.2)
    assert card.effects == (
        Cogging(cycles_per_rev=24, amplitude=0.5),
        LocalFriction(q_center=1.0, width=0.05, relative_amplitude=0.3),
        PeriodicFriction(cycles_per_rev=3, relative_amplitude=0.2, phase=0.1),
    )
    assert card.controller is not None
    assert (card.controller.compensation, card.controller.loop_hz) == ("C3a", 10_000)
    assert card.believed == LuGre(sigma0=9e4, Fc=Pair(2.0, 2.5))
    order = [effect.id for effect in card.plant().effects]
    assert order == ["gravity_unbalance", "cogging", "position_friction", "position_friction"], "the known load first"
    assert card.columns == {"tau": "force", "motor temperature": "T_m"}


def test_a_card_comes_back_from_its_text() -> None:
    card = full()
    text = card_text(card, "What this is.\n\nAnd why.")
    assert text.startswith("# What this is.\n#\n# And why.\n")
    assert parse_card(text, "full.toml") == card
    assert card_text(parse_card(text, "full.toml")) == card_text(card)


@pytest.mark.parametrize("name", shipped_cards())
def test_a_shipped_card_comes_back_and_makes_a_plant(name: str) -> None:
    card = read_card(name)
    assert parse_card(card_text(card), name) == card
    assert card.plant().model().name.endswith("_plant")


def test_all_effects_together_can_be_written_and_read_and_make_a_plant() -> None:
    card = replace(full(), effects=EXAMPLES)
    assert parse_card(card_text(card), "full.toml") == card
    assert len(card.plant().effects) == 1 + len(EXAMPLES)
    assert card.plant().model().states


@pytest.mark.parametrize(
    ("effect", "numbers", "form"),
    [
        ("thermal_viscosity", {"viscous_per_degC": -0.03}, "ThermalViscosity"),
        ("thermal_viscosity", {"viscous_per_degC": -0.03, "warm_up_degC": 9.0}, "WarmingViscosity"),
        ("thermal_viscosity", {"viscous_per_degC": -0.03, "heat_degC_per_rad": 9.0}, "RubbedViscosity"),
        ("torque_droop", {"droop": 0.1, "rated_torque": 8.0}, "TorqueDroop"),
        ("torque_droop", {"droop": 0.1, "rated_torque": 8.0, "per_degC": -0.001}, "WarmTorqueDroop"),
    ],
)
def test_a_form_is_found_by_its_parameters(effect: str, numbers: dict[str, float], form: str) -> None:
    lines = "".join(f"{key} = {value}\n" for key, value in numbers.items())
    assert parse_card(f'{SMALL}[[effects]]\neffect = "{effect}"\n{lines}', "c").effects == (FORM[form](**numbers),)


def test_defaults_are_those_that_the_contract_states() -> None:
    card = parse_card(SMALL, "c")
    assert card.friction == Coulomb(Fc=1.0, sigma2=0.0)
    assert (card.mount.motion, card.controller, card.unbalance, card.effects) == ("rotary", None, None, ())
    assert (card.encoder.counts_per_rev, card.encoder.noise_rms, card.encoder.ratio) == (0, 0, 1)


@pytest.mark.parametrize("Vs", ["", "Vs = 0.04\n"])
@pytest.mark.parametrize("pair", [False, True])
def test_equal_break_away_and_coulomb_levels_mean_no_stribeck_term(Vs: str, pair: bool) -> None:
    level = "{ positive = 2.0, negative = 3.0 }" if pair else "2.0"
    text = f'[mount]\ninertia = 2\n[friction]\nmodel = "lugre"\nsigma0 = 1e4\nFc = {level}\nFs = {level}\n{Vs}'
    law = parse_card(text, "c").friction
    assert isinstance(law, LuGre)
    assert (law.Fs, law.Vs) == (None, None)


def test_the_name_of_a_mount_becomes_an_identifier() -> None:
    assert full().plant().name == "north__axis__3_"
    assert replace(full(), mount=full().mount.model_copy(update={"name": "3"})).plant().name == "_3"
    assert replace(full(), mount=full().mount.model_copy(update={"name": ""})).plant().name == "mount"
