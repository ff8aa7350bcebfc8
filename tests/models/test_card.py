"""Cards come back as written and make the plants that they describe; every mistake is named: key, value and rule."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from effect_examples import EXAMPLES, FORM

from pyfmi_models.card import Card, EncoderSection, MountSection, parse_card, read_card, shipped_cards
from pyfmi_models.card_writer import card_text
from pyfmi_models.controller_section import AdaptationSection, ControllerSection, LearningSection
from pyfmi_models.effects import CATALOGUE, Cogging, GravityUnbalance, LocalFriction, PeriodicFriction
from pyfmi_models.errors import CardError
from pyfmi_models.friction import LAWS, Coulomb, LuGre
from pyfmi_models.model import Pair
from pyfmi_models.near import did_you_mean, near
from pyfmi_models.numbers import shown

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
@pytest.mark.parametrize("level", ["2.0", "{ positive = 2.0, negative = 3.0 }"])
def test_equal_break_away_and_coulomb_levels_mean_no_stribeck_term(Vs: str, level: str) -> None:
    text = f'[mount]\ninertia = 2\n[friction]\nmodel = "lugre"\nsigma0 = 1e4\nFc = {level}\nFs = {level}\n{Vs}'
    law = parse_card(text, "c").friction
    assert (law.Fs, law.Vs) == (None, None)


def test_the_name_of_a_mount_becomes_an_identifier() -> None:
    assert full().plant().name == "north__axis__3_"
    assert replace(full(), mount=full().mount.model_copy(update={"name": "3"})).plant().name == "_3"
    assert replace(full(), mount=full().mount.model_copy(update={"name": ""})).plant().name == "mount"


# Mistakes

LAW = "[friction]"
FIRST = "[[effects]] number 1"
EFFECT = SMALL + "[[effects]]\n"
POSITION = EFFECT + 'effect = "position_friction"\nrelative_amplitude = 0.1\nq_center = 1.0\n'
COGGING = EFFECT + 'effect = "cogging"\ncycles_per_rev = 3\namplitude = 0.1\n'
LOOP = EFFECT + 'effect = "bouc_wen"\ntorque = 1.0\nstroke = 0.05\n'
"""With gamma above beta, pushing back against a large z makes it larger still, without end."""
STATIC = SMALL.replace("coulomb", "static")
CONTROL = SMALL + "[controller]\nkp = 1\nkd = 1\n"
MISTAKES = {
    "no TOML": ("[mount", "is not valid TOML: Expected ']'"),
    "key twice": (SMALL + "Fc = 2\n", "is not valid TOML: Cannot overwrite a value"),
    "unknown section": (SMALL + "[fricton]\n", "[fricton] is not a key of a card; keys are: mount"),
    "unknown key": (SMALL + "[encoder]\ncounts = 3\n", "[encoder] counts is not a key of a card; keys are"),
    "no friction": ("[mount]\ninertia = 2\n", "[friction] is missing."),
    "no inertia": (SMALL.replace("inertia = 2.0", ""), "[mount] inertia is missing."),
    "negative inertia": (SMALL.replace("2.0", "-2.0"), "[mount] inertia = -2.0 breaks the rule: input"),
    "infinite inertia": (SMALL.replace("2.0", "inf"), "[mount] inertia = inf breaks the rule: input should"),
    "inertia in quotes": (SMALL.replace("2.0", '"2.0"'), "[mount] inertia = '2.0' breaks the rule: input"),
    "no section": ('mount = 3\n[friction]\nmodel = "none"\n', "[mount] = 3 breaks the rule: it must be a"),
    "a number for a name": (SMALL + "[columns]\ntau = 3\n", "[columns] tau = 3 breaks the rule: it must be"),
    "a name of 101 characters": (f'[mount]\nname = "{"m" * 101}"{SMALL[7:]}', "[mount] name = 'mmm"),
    "wrong word": (
        CONTROL + 'compensation = "C9"\n',
        "compensation = 'C9' breaks the rule: input should be 'C1', 'C2a', 'C2b', 'C3a', 'C3b' or 'C2a+C3a'.",
    ),
    "unknown key of the adaptation": (
        CONTROL + "[controller.adaptation]\nspeed = 1\n",
        "[controller.adaptation] speed is not a key of a card; keys are: memory, slowest,",
    ),
    "unknown law of the controller": (CONTROL + '[controller.friction]\nmodel = "sand"\n', "model = 'sand' is unknown"),
    "friction without a law": (SMALL.replace("model", "#"), f"{LAW} model is missing; models are: "),
    "unknown law": (SMALL.replace("coulomb", "lugr"), f"'lugr' is unknown; models are: {', '.join(LAWS)}"),
    "law as a list": (SMALL.replace('"coulomb"', '["coulomb"]'), f"{LAW} model = ['coulomb'] is unknown"),
    "key of another law": (SMALL + "Fs = 2\n", f'{LAW}: "Fs" is not a key here; keys are: smoothing, Fc, sigma2.'),
    "missing level": (SMALL.replace("Fc = 1.0", ""), f"{LAW}: Fc is missing."),
    "level out of bounds": (SMALL.replace("1.0", "-1.0"), f"{LAW}: Fc = -1 is outside 0 .. inf."),
    "side out of bounds": (
        SMALL.replace("1.0", "{ positive = 1, negative = -2 }"),
        f"{LAW}: Fc.negative = -2 is",
    ),
    "half a pair": (SMALL.replace("1.0", "{ positive = 1 }"), f"{LAW}: Fc = {{'positive': 1}} is no pair; "),
    "pair in a pair": (
        SMALL.replace("1.0", "{ positive = 1, negative = { positive = 1, negative = 2 } }"),
        f"{LAW}: Fc.negative = {{'positive': 1, 'negative': 2}} is not a number.",
    ),
    "level in quotes": (SMALL.replace("1.0", '"1"'), f"{LAW}: Fc = '1' is not a number."),
    "level as truth": (SMALL.replace("1.0", "true"), f"{LAW}: Fc = True is not a number."),
    "level nan": (SMALL.replace("1.0", "nan"), f"{LAW}: Fc = nan is not a number."),
    "level beyond arithmetic": (SMALL.replace("1.0", "1e300"), f"{LAW}: Fc = 1e+300 is not a number."),
    "level beyond arithmetic, negative": (SMALL.replace("1.0", "-1e300"), f"{LAW}: Fc = -1e+300 is not a number."),
    "level too long": (SMALL.replace("1.0", "1" + "0" * 400), f"{LAW}: Fc = 1000"),
    "Stribeck without its speed": (STATIC + "Fs = 2.0\n", f"{LAW}: Fs needs Vs, the speed over which friction falls."),
    "Stribeck speed without its level": (STATIC + "Vs = 0.04\n", f"{LAW}: Vs needs Fs, the level at rest."),
    "empty unbalance": (SMALL + "[unbalance]\n", "[unbalance]: mgl is missing."),
    "effect without a name": (EFFECT + "amplitude = 1\n", f"{FIRST}: effect is missing; effects are: "),
    "effect as a list": (EFFECT + 'effect = ["x"]\n', f"{FIRST}: effect = ['x'] is unknown"),
    "unknown effect": (EFFECT + 'effect = "coging"\n', f"'coging' is unknown; effects are: {', '.join(CATALOGUE)}."),
    "effects as one table": (SMALL + '[effects]\neffect = "x"\n', "[effects] is one table; write [[effects]] above"),
    "missing amplitude": (COGGING.replace("amplitude", "#"), f"{FIRST} (cogging): amplitude is missing."),
    "typing error in one form of an effect": (
        POSITION + "widht = 0.1\n",
        f'{FIRST} (position_friction): "widht" is not a key here; keys are: q_center, width, relative_amplitude.',
    ),
    "two forms at once": (POSITION + "width = 0.1\ncycles_per_rev = 3\n", '"cycles_per_rev" is not a key here'),
    "resonance below antiresonance": (
        EFFECT + 'effect = "compliance"\nantiresonance_hz = 30\nresonance_hz = 20\n',
        f"{FIRST} (compliance): resonance_hz must be above antiresonance_hz.",
    ),
    "a loop that makes energy": (LOOP + "beta = 0.5\ngamma = 1.5\n", "must be above -beta and at most beta"),
    "a loop without an end": (LOOP + "beta = 0.5\ngamma = -0.5\n", "gamma = -0.5 must be above -beta"),
    "a loop of nothing": (LOOP + "beta = 0.0\ngamma = 0.0\n", "gamma = 0 must be above -beta"),
    "one harmonic without brackets": (
        COGGING + "harmonics = 0.3\n",
        "(cogging): harmonics = 0.3 is not a list",
    ),
    "harmonic in quotes": (COGGING + 'harmonics = [0.3, "0.1"]\n', "(cogging): harmonics[2] = '0.1' is not a number."),
    "second harmonic too high": (COGGING + "harmonics = [0.1, 101.0]\n", "harmonics[2] = 101 is outside -100 .. 100"),
    "second effect without a name": (COGGING + "[[effects]]\n", "number 2: effect is missing; effects are: "),
    "effect by direction": (
        EFFECT + 'effect = "delay"\ndelay_ms = { positive = 1, negative = 2 }\n',
        f"{FIRST} (delay): delay_ms = {{'positive': 1, 'negative': 2}} is not a number.",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_a_card_is_named_in_one_sentence(mistake: str, tmp_path: Path) -> None:
    text, message = MISTAKES[mistake]
    with pytest.raises(CardError) as caught:
        parse_card(text, "bad.toml")
    assert message in str(caught.value)
    assert str(caught.value).startswith("bad.toml")
    assert "\n" not in str(caught.value)
    path = tmp_path / "bad.toml"
    path.write_text(text, "utf-8")
    with pytest.raises(CardError) as caught:
        read_card(path)
    assert str(path) in str(caught.value)


def test_a_card_that_is_not_there_lists_those_that_are() -> None:
    with pytest.raises(CardError) as caught:
        read_card("paper_mont")
    names = "altaz_altitude, altaz_azimuth, emps, paper_mount, paper_mount_directional"
    assert str(caught.value) == f'paper_mont: no such card. Shipped cards are: {names}. Did you mean "paper_mount"?'


def test_a_folder_and_bytes_are_no_card(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_bytes(b"\xff\xfe\x00")
    for source, sentence in ((tmp_path, " is a folder, not a card."), (path, " is not a card: it is not UTF-8 text.")):
        with pytest.raises(CardError) as caught:
            read_card(source)
        assert str(caught.value) == f"{source}{sentence}"


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ("", "there is no [controller] section, so there is no controller to export."),
        (
            'compensation = "C3a"',
            '[controller] compensation = "C3a" needs [friction] model = "lugre"; it is "coul',
        ),
        (
            "[controller.learning]\nperiod = 0.01\nknots = 101",
            "period = 0.01 is not a whole number of ticks of 0",
        ),
        ("[controller.learning]\nperiod = 0.01005", "period = 0.01005 is not a whole number of ticks of 0.0001"),
        ("[controller.adaptation]", 'goes with compensation = "C2a" or "C3a"; it is "C1".'),
    ],
)
def test_what_a_controller_cannot_be_composed_of_is_said(more: str, sentence: str) -> None:
    assert parse_card(CONTROL, "c.toml").controller_model().period == 1e-4
    with pytest.raises(CardError, match=re.escape(sentence)):
        parse_card(CONTROL + more if more else SMALL, "c.toml").controller_model()


# Numbers, names and words of a card at their limits: the last that is taken, the first that is refused.

RANGES: dict[type, dict[str, tuple[float, float, float, float]]] = {
    MountSection: {"inertia": (1e-9, 1e12, 0.99e-9, 1.001e12), "torque_limit": (1e-9, 1e12, 0.99e-9, 1.001e12)},
    EncoderSection: {
        "counts_per_rev": (0.0, 2.0**53, -1e-9, 2.0**53 + 2),
        "noise_rms": (0.0, 1e12, -1e-300, 1.001e12),
        "ratio": (1e-9, 1e12, 0.99e-9, 1.001e12),
    },
    ControllerSection: {
        "kp": (1e-300, 1e12, 0.0, 1.001e12),
        "kd": (1e-300, 1e12, 0.0, 1.001e12),
        "loop_hz": (1e-3, 1e9, 0.999e-3, 1.001e9),
        "record_hz": (1e-3, 1e9, 0.999e-3, 1.001e9),
        "observer_bandwidth": (1e-300, 1e9, 0.0, 1.001e9),
        "observer_order": (3, 4, 2, 5),
    },
    LearningSection: {
        "period": (1e-300, 1e9, 0.0, -1.0),
        "knots": (3, 1000, 2, 1001),
        "gain": (1e-300, 1.0, 0.0, 1.001),
    },
    AdaptationSection: {
        "memory": (0.1, 1e9, 0.099, -1.0),
        "slowest": (0.0, 1e9, -1e-300, -1.0),
        "widest": (1.0, 1e9, 0.999, -1.0),
        "doubt": (1e-300, 1e9, 0.0, -1.0),
        "noise": (1e-300, 1e9, 0.0, -1.0),
    },
}
"""Sections of a card, by key: lowest and highest number that it takes, and two that it refuses."""
NEEDED: dict[type, dict[str, Any]] = {
    MountSection: {"inertia": 1.0},
    ControllerSection: {"kp": 1.0, "kd": 1.0},
    LearningSection: {"period": 1.0},
}


@pytest.mark.parametrize(("section", "key"), [(section, key) for section, keys in RANGES.items() for key in keys])
def test_a_section_takes_numbers_up_to_their_limits(section: Any, key: str) -> None:
    low, high, under, over = RANGES[section][key]
    needed = NEEDED.get(section, {})
    for value in (low, high):
        assert getattr(section(**(needed | {key: value})), key) == value
    for value in (under, over):
        with pytest.raises(ValueError, match=key):
            section(**(needed | {key: value}))


def test_a_law_and_a_name_are_taken_up_to_their_limits_and_a_loop_that_only_just_makes_none() -> None:
    """Of energy: gamma = beta."""
    assert parse_card(SMALL.replace("1.0", "0.999e300"), "a.toml").friction.Fc == 0.999e300  # type: ignore[attr-defined]
    assert parse_card(f'[mount]\nname = "{"m" * 100}"{SMALL[7:]}', "a.toml").plant().name == "m" * 100
    assert parse_card(LOOP + "beta = 0.5\ngamma = 0.5\n", "a.toml").effects


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("a" * 58, repr("a" * 58)),
        ("a" * 59, f"{repr('a' * 59)[:60]}... (61 characters)"),
        ("a" * 2000, f"{repr('a' * 2000)[:60]}... (2,002 characters)"),
        (7, "7"),
    ],
)
def test_a_value_of_more_than_sixty_characters_is_cut_short(value: object, text: str) -> None:
    assert shown(value) == text


@pytest.mark.parametrize(
    ("name", "choices", "meant"),
    [
        ("sideral", ["sidereal", "demo"], "sidereal"),
        ("SIDEREAL", ["sidereal", "demo"], "sidereal"),
        ("stpe", ["stop", "step"], "step"),
        ("xyz", ["sidereal", "demo"], ""),
        ("abcdexxx", ["abcdeyyy"], "abcdeyyy"),
        ("abcdxxxx", ["abcdyyyy"], ""),
        ("a" * 100 + "b" * 50, ["a" * 100 + "c" * 50], "a" * 100 + "c" * 50),
    ],
)
def test_the_name_that_was_meant_shares_six_tenths_of_its_letters(name: str, choices: list[str], meant: str) -> None:
    assert near(name, choices) == meant
    assert did_you_mean("demo", ["demo", "demos"]) == "", "a name that is right is not suggested"
    assert did_you_mean(name, choices) == (f' Did you mean "{meant}"?' if meant else "")
