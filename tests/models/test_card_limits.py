"""Numbers, names and words of a card at their limits: the last that is taken, the first that is refused."""

from typing import Any

import pytest

from pyfmi_models.card import EncoderSection, MountSection, parse_card
from pyfmi_models.errors import CardError
from pyfmi_models.near import did_you_mean, near
from pyfmi_models.numbers import shown

CARD = '[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\n'
RANGES: dict[type, dict[str, tuple[float, float, float, float]]] = {
    MountSection: {"inertia": (1e-9, 1e12, 0.99e-9, 1.001e12), "torque_limit": (1e-9, 1e12, 0.99e-9, 1.001e12)},
    EncoderSection: {
        "counts_per_rev": (0.0, 2.0**53, -1e-9, 2.0**53 + 2),
        "noise_rms": (0.0, 1e12, -1e-300, 1.001e12),
        "ratio": (1e-9, 1e12, 0.99e-9, 1.001e12),
    },
}


@pytest.mark.parametrize(("section", "key"), [(section, key) for section, keys in RANGES.items() for key in keys])
def test_a_section_takes_numbers_up_to_their_limits(section: Any, key: str) -> None:
    low, high, under, over = RANGES[section][key]
    needed = {"inertia": 1.0} if section is MountSection else {}
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


@pytest.mark.parametrize(("value", "good"), [("0.999e300", True), ("1e300", False), ("-1e300", False), ("true", False)])
def test_a_number_of_a_law_is_below_what_arithmetic_takes(value: str, good: bool) -> None:
    text = CARD.replace("Fc = 1.0", f"Fc = {value}")
    if good:
        assert parse_card(text, "a.toml").friction.Fc == float(value)  # type: ignore[attr-defined]
        return
    with pytest.raises(CardError, match=r"a.toml: \[friction\]: Fc = .* is not a number"):
        parse_card(text, "a.toml")


@pytest.mark.parametrize(("length", "good"), [(100, True), (101, False)])
def test_a_name_has_up_to_a_hundred_characters(length: int, good: bool) -> None:
    text = CARD.replace("[mount]", f'[mount]\nname = "{"m" * length}"')
    if good:
        assert parse_card(text, "a.toml").plant().name == "m" * length
        return
    with pytest.raises(CardError, match=r"\[mount\] name"):
        parse_card(text, "a.toml")


@pytest.mark.parametrize(
    ("index", "text"), [(1, "[[effects]]"), (2, "[[effects]]\neffect = 'delay'\ndelay_ms = 1.0\n[[effects]]")]
)
def test_an_effect_is_named_by_its_number_from_one_on(index: int, text: str) -> None:
    with pytest.raises(CardError, match=rf"a.toml: \[\[effects\]\] number {index}: effect is missing; effects are: "):
        parse_card(f"{CARD}{text}\n", "a.toml")


def test_of_a_list_the_number_that_is_wrong_is_told_from_one_on() -> None:
    text = f'{CARD}[[effects]]\neffect = "cogging"\ncycles_per_rev = 3\namplitude = 1.0\nharmonics = [0.1, 101.0]\n'
    with pytest.raises(CardError, match=r"harmonics\[2\] = 101 is outside -100 .. 100"):
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
    assert did_you_mean(name, choices) == (f' Did you mean "{meant}"?' if meant else "")


def test_a_name_that_is_right_is_not_suggested() -> None:
    assert did_you_mean("demo", ["demo", "demos"]) == ""
