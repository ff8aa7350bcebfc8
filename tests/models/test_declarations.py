"""What parts of a model declare beside what stands in their classes (`test_parameter_ranges.py`): sizes, starts."""

from dataclasses import replace
from typing import Any

import pytest
from effect_examples import example
from test_parameter_ranges import told

from pyfmi_models.adrc import Adaptation, Gains, Learning
from pyfmi_models.adrc.controller import INPUTS, MEMORY, OUTPUTS
from pyfmi_models.controller_section import AdaptationSection, ControllerSection, LearningSection
from pyfmi_models.effects import FORMS
from pyfmi_models.friction import LuGre
from pyfmi_models.model import Pair, parameters_of
from pyfmi_models.pointing import PointingError
from pyfmi_models.setpoint import Sine


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
def test_of_two_directions_the_larger_number_says_how_large_an_effect_is(
    name: str, changes: dict[str, float], number: str
) -> None:
    effect = replace(example(next(form for form in FORMS if form.__name__ == name)), **changes)
    assert effect.leading().parameter == number


def test_what_no_thermometer_has_seen_is_told_over_time_or_way() -> None:
    """exp(-0.04 x 15) - 1 in three time constants of 30 s; 0.04 x 8 per radian."""
    forms = {form.__name__: form for form in FORMS}
    said = {}
    for name in ("WarmingViscosity", "RubbedViscosity"):
        main = example(forms[name]).leading()
        said[main.unit] = -0.04 * main.factor
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


def test_set_points_and_pointing_declare_their_numbers() -> None:
    sine = Sine(name="s", frequency=1.0, amplitude=2.0).model()
    assert list(map(told, sine.parameters)) == [
        "frequency [Hz] = 1 1e-09..inf",
        "amplitude [rad] = 2",
        "phase [rad]",
        "smooth_start [s] 0..inf",
    ]
    assert not any(one.tunable for one in sine.parameters)
    assert [one.unit for one in Sine(name="s", unit="m", frequency=1.0, amplitude=2.0).model().parameters] == [
        *("Hz", "m", "rad", "s")
    ]
    assert [told(one) for one in PointingError().model().outputs] == [
        *("cross_elevation [rad]", "elevation [rad]", "error [rad]")
    ]


# What a controller declares: its numbers as its FMUs have them, the limits of a card, what a card leaves out.

GAINS = """
inertia [kg.m2] = 1 1e-09..inf
kp [1/s2] = 2 0..inf ~100
kd [1/s] = 3 0..inf ~10
observer_bandwidth [rad/s] = 4 0.001..inf ~100
torque_limit [N.m] = 1e+06 0..inf
"""
ADAPTATION = """
adaptation.memory [s] = 20 0.1..inf ~10
adaptation.slowest [rad/s] = 2e-05 0..inf ~1e-05
adaptation.widest [1] = 3 1..inf
adaptation.noise [N.m] = 0.5 1e-06..inf
"""
LEARNING = """
learning.gain [1] = 0.5 0..1
learning.lead [s] = 0.0136 0..1
learning.limit [N.m] = 1e+06 0..inf
"""


def lines(text: str) -> list[str]:
    return text.strip().splitlines()


def test_a_controller_declares_its_numbers_as_its_fmus_do() -> None:
    law = LuGre(sigma0=1e4, Fc=2.0, Fs=4.0, Vs=0.1)
    assert list(map(told, parameters_of(Gains(inertia=1, kp=2, kd=3, observer_bandwidth=4)))) == lines(GAINS)
    assert list(map(told, Adaptation(law=law).parameters()))[-4:] == lines(ADAPTATION)
    assert list(map(told, Learning(ticks=100).parameters())) == lines(LEARNING)
    assert Learning(ticks=100).knots == 100
    assert [one.name for one in (*INPUTS, *OUTPUTS)] == [
        *("q", "q_d", "v_d", "a_d"),
        *("tau", "friction_estimate", "zeta1", "zeta2", "zeta3"),
    ]
    assert {one.start for one in (*INPUTS, *MEMORY, *OUTPUTS)} == {0.0}


def test_what_a_card_does_not_say_of_its_controller_is_what_the_documentation_says() -> None:
    said = ControllerSection(kp=1.0, kd=1.0)
    assert (said.loop_hz, said.record_hz, said.observer_bandwidth, said.observer_order) == (10_000, 1_000, 220, 3)
    assert (said.velocity, said.compensation, said.period) == ("observer", "C1", 1e-4)
    assert LearningSection(period=1.0).model_dump() == {"period": 1.0, "knots": 100, "gain": 0.5}
    assert AdaptationSection().model_dump() == {
        "memory": 20.0,
        "slowest": 2e-5,
        "widest": 3.0,
        "doubt": 0.3,
        "noise": 0.5,
    }
