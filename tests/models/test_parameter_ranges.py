"""What friction laws and effects declare is what was promised: to cards, to other tools, to fits and to readers.

A number: low .. high, ~ the size that an FMU states as nominal, its unit, = what it is where a card says nothing;
`fixed`: never fitted to a recording; `held`: an FMU keeps it from the start of a run to its end. Behind a form stand
the number that tells how large it is and how it is treated. `promised.txt` has all of it; a change of it is a promise
changed, and a line of the changelog. Written anew:

    PYTHONPATH=tests/tools python tests/models/test_parameter_ranges.py
"""

from collections.abc import Iterable, Iterator
from dataclasses import MISSING, fields, replace
from math import inf
from pathlib import Path
from typing import Any

import pytest
from effect_examples import FORM, example

import pyfmi_models.friction
from pyfmi_models.adrc import Adaptation, Gains, Learning
from pyfmi_models.adrc.controller import INPUTS, MEMORY, OUTPUTS
from pyfmi_models.card import EncoderSection, MountSection
from pyfmi_models.controller_section import AdaptationSection, ControllerSection, LearningSection
from pyfmi_models.effects import FORMS, Effect
from pyfmi_models.friction import LuGre
from pyfmi_models.friction.base import FrictionLaw
from pyfmi_models.model import Pair, Variable, parameters_of
from pyfmi_models.pointing import PointingError
from pyfmi_models.setpoint import Sine

PROMISED = Path(__file__).with_name("promised.txt")
LAWS = [
    one
    for one in vars(pyfmi_models.friction).values()
    if isinstance(one, type) and issubclass(one, FrictionLaw) and hasattr(one, "key")
]
ALL: list[type] = [*LAWS, *FORMS]
MARKS = ("is_torque", "at_once", "is_determined", "in_torque", "never_negative", "unit_value", "ordered")
"""How an effect is treated: by a screening, an inverse, a fit; of learned terms what their coefficients are."""


def told(one: Variable) -> str:
    """Name, unit, and what is not as by default."""
    bounds = f" {one.low:g}..{one.high:g}" if (one.low, one.high) != (-inf, inf) else ""
    start = f" = {one.start:g}" if one.start else ""
    return f"{one.name} [{one.unit}]{start}{bounds}{f' ~{one.nominal:g}' if one.nominal != 1 else ''}"


def number(item: Any) -> str:
    """A number of a form."""
    variable, default = item.metadata["variable"], item.default
    value = "" if default is MISSING else " = None" if default is None else f" = {default:g}"
    fixed = "" if item.metadata.get("fitted") else " fixed"
    return f"{item.name} {variable.low:g}..{variable.high:g} ~{variable.nominal:g} [{variable.unit}]{value}{fixed}"


def treated(form: type[Effect]) -> Iterator[str]:
    """The main number of an effect, its marks, and the states and inputs that it brings."""
    yield f"main {getattr(form, 'main', None)}"
    yield " ".join(f"{name}={getattr(form, name)}" for name in MARKS if hasattr(form, name))
    effect = example(form)
    yield from (f"state {told(one)}" for one in effect.states())
    yield from (f"input {told(one)}" for one in effect.inputs())
    yield from (f"held {one.name}" for one in parameters_of(effect) if not one.tunable)


def declared(form: type) -> list[str]:
    """What a form declares, a line each."""
    lists = {item.name: item.metadata["structure"] for item in fields(form) if "structure" in item.metadata}
    return [
        *(number(item) for item in fields(form) if "variable" in item.metadata),
        *(f"list {name} {one.low:g}..{one.high:g}" for name, one in lists.items()),
        *(treated(form) if issubclass(form, Effect) else ()),
    ]


def promised() -> dict[str, list[str]]:
    """The lines of `promised.txt` by form."""
    found: dict[str, list[str]] = {}
    for line in PROMISED.read_text("utf-8").splitlines():
        if line.startswith(" "):
            found[list(found)[-1]].append(line.strip())
        else:
            found[line] = []
    return found


@pytest.mark.parametrize("form", ALL, ids=lambda one: one.__name__)
def test_a_form_declares_what_was_promised(form: type) -> None:
    assert declared(form) == promised().get(form.__name__, [])


def test_the_table_names_only_forms_that_there_are() -> None:
    assert set(promised()) == {one.__name__ for one in ALL}


# Sizes, starts and numbers beside those that stand in the classes of laws and effects.


@pytest.mark.parametrize(
    ("name", "changes", "number"),
    [
        ("RoughSpot", {"forward": 0.2, "backward": -0.3}, "backward"),
        ("RoughSpot", {"forward": -0.3, "backward": 0.3}, "forward"),
        ("FrictionAsymmetry", {"level_asymmetry": -0.1, "viscous_asymmetry": 0.2}, "viscous_asymmetry"),
        ("FrictionAsymmetry", {"level_asymmetry": 0.2, "viscous_asymmetry": -0.2}, "level_asymmetry"),
        ("ThermalViscosity", {"viscous_per_degC": 0.01, "coulomb_per_degC": -0.02}, "coulomb_per_degC"),
        ("ThermalViscosity", {"viscous_per_degC": 0.02, "coulomb_per_degC": -0.02}, "viscous_per_degC"),
        ("WarmingViscosity", {"viscous_per_degC": 0.01, "coulomb_per_degC": -0.02}, "coulomb_per_degC"),
        ("GearFriction", {"driving": 0.1, "driven": 0.2}, "driven"),
        ("GearFriction", {"driving": 0.2, "driven": 0.2}, "driving"),
    ],
)
def test_of_two_directions_the_larger_number_is_told(name: str, changes: dict[str, float], number: str) -> None:
    effect = replace(example(FORM[name]), **changes)
    assert effect.leading().parameter == number


def test_what_no_thermometer_has_seen_is_told_over_time_or_way() -> None:
    """exp(-0.04 x 15) - 1 in three time constants of 30 s; 0.04 x 8 per radian."""
    mains = [example(FORM[name]).leading() for name in ("WarmingViscosity", "RubbedViscosity")]
    said = {main.unit: -0.04 * main.factor for main in mains}
    assert said == {"% in the first 90 s": pytest.approx(-45.12, abs=0.01), "% per rad rubbed": pytest.approx(-32.0)}


@pytest.mark.parametrize(
    ("breakaway", "level"),
    [({"Fc": 2.0}, 2.0), ({"Fc": 2.0, "Fs": 4.0, "Vs": 0.1}, 4.0), ({"Fc": Pair(2.0, 5.0)}, 3.5)],
)
def test_identification_starts_from_the_model_and_with_its_doubt(breakaway: dict[str, Any], level: float) -> None:
    """Variances: doubt squared of factors, and of a bias up to the doubt's share of break-away."""
    states = {one.name: one for one in Adaptation(law=LuGre(sigma0=1e4, **breakaway), doubt=0.2).states()}
    started = {name.removeprefix("adaptation."): one.start for name, one in states.items() if one.start}
    assert started == pytest.approx({"level": 1, "stiffness": 1, "P00": 0.04, "P11": 0.04, "P22": (0.2 * level) ** 2})
    chain = [f"adaptation.seen.{name}{k}" for name in ("level", "stiffness") for k in range(3)]
    assert [name for name in states if "seen" in name] == chain
    assert [name[-2:] for name in states if ".P" in name] == ["00", "01", "02", "11", "12", "22"]
    assert all(one.unit == ("1" if ".P" in name else "N.m") for name, one in states.items() if "slope" in name)


# Numbers of a controller and of a set point as their FMUs have them.

SINE = """\
frequency [Hz] = 1 1e-09..inf
amplitude [rad] = 2
phase [rad]
smooth_start [s] 0..inf"""
GAINS = """\
inertia [kg.m2] = 1 1e-09..inf
kp [1/s2] = 2 0..inf ~100
kd [1/s] = 3 0..inf ~10
observer_bandwidth [rad/s] = 4 0.001..inf ~100
torque_limit [N.m] = 1e+06 0..inf"""
ADAPTATION = """\
adaptation.memory [s] = 20 0.1..inf ~10
adaptation.slowest [rad/s] = 2e-05 0..inf ~1e-05
adaptation.widest [1] = 3 1..inf
adaptation.noise [N.m] = 0.5 1e-06..inf"""
LEARNING = """\
learning.gain [1] = 0.5 0..1
learning.lead [s] = 0.0136 0..1
learning.limit [N.m] = 1e+06 0..inf"""


def lines(variables: Iterable[Variable]) -> str:
    return "\n".join(map(told, variables))


def test_set_points_and_pointing_declare_their_numbers() -> None:
    sine = Sine(name="s", frequency=1.0, amplitude=2.0).model()
    assert lines(sine.parameters) == SINE
    assert not any(one.tunable for one in sine.parameters)
    linear = Sine(name="s", unit="m", frequency=1.0, amplitude=2.0).model()
    assert [one.unit for one in linear.parameters] == ["Hz", "m", "rad", "s"]
    assert lines(PointingError().model().outputs) == "cross_elevation [rad]\nelevation [rad]\nerror [rad]"


def test_a_controller_declares_its_numbers_as_its_fmus_do() -> None:
    law = LuGre(sigma0=1e4, Fc=2.0, Fs=4.0, Vs=0.1)
    assert lines(parameters_of(Gains(inertia=1, kp=2, kd=3, observer_bandwidth=4))) == GAINS
    assert lines(Adaptation(law=law).parameters()[-4:]) == ADAPTATION
    assert lines(Learning(ticks=100).parameters()) == LEARNING
    assert Learning(ticks=100).knots == 100
    inputs, outputs = ("q", "q_d", "v_d", "a_d"), ("tau", "friction_estimate", "zeta1", "zeta2", "zeta3")
    assert [one.name for one in (*INPUTS, *OUTPUTS)] == [*inputs, *outputs]
    assert {one.start for one in (*INPUTS, *MEMORY, *OUTPUTS)} == {0.0}


def test_what_a_card_does_not_say_is_what_the_documentation_says() -> None:
    mount = {"name": "mount", "motion": "rotary", "inertia": 1.0, "torque_limit": 1e6, "machine": None}
    assert MountSection(inertia=1.0).model_dump() == mount
    assert EncoderSection().model_dump() == {"counts_per_rev": 0.0, "noise_rms": 0.0, "ratio": 1.0}
    said = ControllerSection(kp=1.0, kd=1.0)
    assert (said.loop_hz, said.record_hz, said.observer_bandwidth, said.observer_order) == (10_000, 1_000, 220, 3)
    assert (said.velocity, said.compensation, said.period) == ("observer", "C1", 1e-4)
    assert LearningSection(period=1.0).model_dump() == {"period": 1.0, "knots": 100, "gain": 0.5}
    adaptation = {"memory": 20.0, "slowest": 2e-5, "widest": 3.0, "doubt": 0.3, "noise": 0.5}
    assert AdaptationSection().model_dump() == adaptation


if __name__ == "__main__":
    PROMISED.write_text("".join("\n    ".join([one.__name__, *declared(one)]) + "\n" for one in ALL), "utf-8")
