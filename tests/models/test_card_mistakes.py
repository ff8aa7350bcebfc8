"""Every mistake in a card is named by file, key, value and rule."""

import re
from pathlib import Path
from typing import Any

import pytest
from test_card import SMALL

from pyfmi_models.card import EncoderSection, MountSection, parse_card, read_card
from pyfmi_models.controller_section import AdaptationSection, ControllerSection, LearningSection
from pyfmi_models.effects import CATALOGUE
from pyfmi_models.errors import CardError
from pyfmi_models.friction import LAWS
from pyfmi_models.near import did_you_mean, near
from pyfmi_models.numbers import shown

LAW = "bad.toml: [friction]"
EFFECT = "bad.toml: [[effects]] number 1"
POSITION = 'effect = "position_friction"\nrelative_amplitude = 0.1\nq_center = 1.0\n'
COGGING = 'effect = "cogging"\ncycles_per_rev = 3\namplitude = 0.1\n'
MISTAKES = {
    "no TOML": ("[mount", "bad.toml is not valid TOML: Expected ']'"),
    "key twice": (SMALL + "Fc = 2\n", "bad.toml is not valid TOML: Cannot overwrite a value"),
    "unknown section": (SMALL + "[fricton]\n", "bad.toml: [fricton] is not a key of a card; keys are: mount"),
    "unknown key": (SMALL + "[encoder]\ncounts = 3\n", "bad.toml: [encoder] counts is not a key of a card; keys are"),
    "no friction": ("[mount]\ninertia = 2\n", "bad.toml: [friction] is missing."),
    "no inertia": (SMALL.replace("inertia = 2.0", ""), "bad.toml: [mount] inertia is missing."),
    "negative inertia": (SMALL.replace("2.0", "-2.0"), "bad.toml: [mount] inertia = -2.0 breaks the rule: input"),
    "infinite inertia": (SMALL.replace("2.0", "inf"), "bad.toml: [mount] inertia = inf breaks the rule: input should"),
    "inertia in quotes": (SMALL.replace("2.0", '"2.0"'), "bad.toml: [mount] inertia = '2.0' breaks the rule: input"),
    "no section": ('mount = 3\n[friction]\nmodel = "none"\n', "bad.toml: [mount] = 3 breaks the rule: it must be a"),
    "a number for a name": (SMALL + "[columns]\ntau = 3\n", "bad.toml: [columns] tau = 3 breaks the rule: it must be"),
    "wrong word": (
        SMALL + '[controller]\nkp = 1\nkd = 1\ncompensation = "C9"\n',
        "compensation = 'C9' breaks the rule: input should be 'C1', 'C2a', 'C2b', 'C3a', 'C3b' or 'C2a+C3a'.",
    ),
    "unknown key of the adaptation": (
        SMALL + "[controller]\nkp = 1\nkd = 1\n[controller.adaptation]\nspeed = 1\n",
        "bad.toml: [controller.adaptation] speed is not a key of a card; keys are: memory, slowest,",
    ),
    "unknown law in the controller": (
        SMALL + '[controller]\nkp = 1\nkd = 1\n[controller.friction]\nmodel = "sand"\n',
        "bad.toml: [controller.friction] model = 'sand' is unknown; models are: ",
    ),
    "friction without a law": (SMALL.replace("model", "#"), f"{LAW} model is missing; models are: "),
    "unknown law": (
        SMALL.replace("coulomb", "lugr"),
        f"{LAW} model = 'lugr' is unknown; models are: {', '.join(LAWS)}",
    ),
    "law as a list": (SMALL.replace('"coulomb"', '["coulomb"]'), f"{LAW} model = ['coulomb'] is unknown"),
    "key of another law": (SMALL + "Fs = 2\n", f'{LAW}: "Fs" is not a key here; keys are: smoothing, Fc, sigma2.'),
    "missing level": (SMALL.replace("Fc = 1.0", ""), f"{LAW}: Fc is missing."),
    "level out of bounds": (SMALL.replace("1.0", "-1.0"), f"{LAW}: Fc = -1 is outside 0 .. inf."),
    "side out of bounds": (
        SMALL.replace("1.0", "{ positive = 1, negative = -2 }"),
        f"{LAW}: Fc.negative = -2 is outside 0 .. inf.",
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
    "Stribeck without its speed": (
        SMALL.replace("coulomb", "static") + "Fs = 2.0\n",
        f"{LAW}: Fs needs Vs, the speed over which friction falls.",
    ),
    "Stribeck speed without its level": (
        SMALL.replace("coulomb", "static") + "Vs = 0.04\n",
        f"{LAW}: Vs needs Fs, the level at rest.",
    ),
    "empty unbalance": (SMALL + "[unbalance]\n", "bad.toml: [unbalance]: mgl is missing."),
    "effect without a name": (SMALL + "[[effects]]\namplitude = 1\n", f"{EFFECT}: effect is missing; effects are: "),
    "effect as a list": (SMALL + '[[effects]]\neffect = ["x"]\n', f"{EFFECT}: effect = ['x'] is unknown"),
    "unknown effect": (
        SMALL + '[[effects]]\neffect = "coging"\n',
        f"{EFFECT}: effect = 'coging' is unknown; effects are: {', '.join(CATALOGUE)}.",
    ),
    "effects as one table": (SMALL + '[effects]\neffect = "x"\n', "[effects] is one table; write [[effects]] above"),
    "missing amplitude": (
        SMALL + '[[effects]]\neffect = "cogging"\ncycles_per_rev = 3\n',
        f"{EFFECT} (cogging): amplitude is missing.",
    ),
    "typing error in one form of an effect": (
        f"{SMALL}[[effects]]\n{POSITION}widht = 0.1\n",
        f'{EFFECT} (position_friction): "widht" is not a key here; keys are: q_center, width, relative_amplitude.',
    ),
    "two forms of an effect at once": (
        f"{SMALL}[[effects]]\n{POSITION}width = 0.1\ncycles_per_rev = 3\n",
        f'{EFFECT} (position_friction): "cycles_per_rev" is not a key here',
    ),
    "resonance below antiresonance": (
        SMALL + '[[effects]]\neffect = "compliance"\nantiresonance_hz = 30\nresonance_hz = 20\n',
        f"{EFFECT} (compliance): resonance_hz must be above antiresonance_hz.",
    ),
    "one harmonic without brackets": (
        f"{SMALL}[[effects]]\n{COGGING}harmonics = 0.3\n",
        f"{EFFECT} (cogging): harmonics = 0.3 is not a list of numbers.",
    ),
    "harmonic in quotes": (
        f'{SMALL}[[effects]]\n{COGGING}harmonics = [0.3, "0.1"]\n',
        f"{EFFECT} (cogging): harmonics[2] = '0.1' is not a number.",
    ),
    "second harmonic out of bounds": (
        f"{SMALL}[[effects]]\n{COGGING}harmonics = [0.1, 101.0]\n",
        f"{EFFECT} (cogging): harmonics[2] = 101 is outside -100 .. 100",
    ),
    "second effect without a name": (
        f"{SMALL}[[effects]]\n{COGGING}[[effects]]\n",
        "bad.toml: [[effects]] number 2: effect is missing; effects are: ",
    ),
    "effect by direction": (
        SMALL + '[[effects]]\neffect = "delay"\ndelay_ms = { positive = 1, negative = 2 }\n',
        f"{EFFECT} (delay): delay_ms = {{'positive': 1, 'negative': 2}} is not a number.",
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


def test_a_controller_must_be_on_the_card() -> None:
    with pytest.raises(CardError) as caught:
        parse_card(SMALL, "c.toml").controller_model()
    assert str(caught.value) == "c.toml: there is no [controller] section, so there is no controller to export."


def test_compensation_needs_bristles() -> None:
    text = SMALL + '[controller]\nkp = 225\nkd = 30\ncompensation = "C3a"\n'
    with pytest.raises(CardError) as caught:
        parse_card(text, "c.toml").controller_model()
    assert str(caught.value) == (
        'c.toml: [controller] compensation = "C3a" needs [friction] model = "lugre"; it is "coulomb".'
    )
    assert parse_card(text.replace("C3a", "C1"), "c.toml").controller_model().period == 1e-4


@pytest.mark.parametrize(
    ("section", "sentence"),
    [
        ("learning]\nperiod = 0.01", "period = 0.01 is not a whole number of ticks of 0.0001 s, at least one a knot"),
        ("learning]\nperiod = 0.01005", "period = 0.01005 is not a whole number of ticks of 0.0001 s, at least one"),
        ("adaptation]", 'goes with compensation = "C2a" or "C3a"; it is "C1".'),
    ],
)
def test_what_a_controller_cannot_be_composed_of_is_said(section: str, sentence: str) -> None:
    text = f"{SMALL}[controller]\nkp = 1\nkd = 1\n[controller.{section}\n".replace("0.01\n", "0.01\nknots = 101\n")
    with pytest.raises(CardError, match=re.escape(sentence)):
        parse_card(text, "c.toml").controller_model()


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


def test_what_a_card_does_not_say_is_what_the_documentation_says() -> None:
    assert MountSection(inertia=1.0).model_dump() == {
        "name": "mount",
        "motion": "rotary",
        "inertia": 1.0,
        "torque_limit": 1e6,
        "machine": None,
    }
    assert EncoderSection().model_dump() == {"counts_per_rev": 0.0, "noise_rms": 0.0, "ratio": 1.0}


def test_a_number_of_a_law_is_below_what_arithmetic_takes() -> None:
    assert parse_card(SMALL.replace("1.0", "0.999e300"), "a.toml").friction.Fc == 0.999e300  # type: ignore[attr-defined]


@pytest.mark.parametrize(("length", "good"), [(100, True), (101, False)])
def test_a_name_has_up_to_a_hundred_characters(length: int, good: bool) -> None:
    text = SMALL.replace("[mount]", f'[mount]\nname = "{"m" * length}"')
    if good:
        assert parse_card(text, "a.toml").plant().name == "m" * length
        return
    with pytest.raises(CardError, match=r"\[mount\] name"):
        parse_card(text, "a.toml")


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
