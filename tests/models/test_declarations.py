"""What parts of a model declare beside their equations: states, inputs, what is held, what texts and fits take.

An FMU states these numbers to other tools, a report its sizes by them, and a fit decides by the marks: they are
promises as the ranges are (`test_parameter_ranges.py`).
"""

from dataclasses import replace
from math import inf
from typing import Any

import pytest
from effect_examples import EXAMPLES, example

from pyfmi_models.adrc import Adaptation
from pyfmi_models.effects import FORMS, Effect
from pyfmi_models.effects.base import Main
from pyfmi_models.friction import LuGre
from pyfmi_models.model import Pair, Variable, parameters_of
from pyfmi_models.pointing import PointingError
from pyfmi_models.setpoint import Sine

TWIST = ["twist [rad] ~0.001", "twist_rate [rad/s] ~0.01"]
WARM = ["temperature [degC] = 20"]
STATES: dict[str, list[str]] = {
    "ActuatorLag": ["x [N.m]"],
    "Backlash": [*TWIST, "bristle [rad] ~1e-05"],
    "BoucWen": ["z [1]"],
    "Compliance": TWIST,
    "LoadSideCompliance": TWIST,
    "Delay": ["x1 [N.m]", "x2 [N.m]", "x3 [N.m]"],
    "DwellBreakaway": ["age [s] 0..inf"],
    "LearnedHysteresis": ["memory1 [1] -1..1", "memory2 [1] -1..1"],
    "LearnedAfterReversal": ["memory1 [1] -1..1", "memory2 [1] -1..1"],
    "LearnedViscous": ["followed_speed [rad/s]"],
    "WarmingViscosity": ["rise [K]"],
    "RubbedViscosity": ["rise [K]"],
}
READ: dict[str, list[str]] = {
    "AltitudeInertia": ["altitude [rad] ~0.7", "altitude_rate [rad/s] ~0.01"],
    "AzimuthCentrifugal": ["azimuth_rate [rad/s] ~0.1"],
    "KnownLoad": ["load_torque [N.m]"],
    "AxisCoupling": ["neighbour_acceleration [rad/s2]"],
    "DampedCoupling": ["neighbour_acceleration [rad/s2]", "neighbour_speed [rad/s]"],
    "WeightCoupling": ["neighbour_acceleration [rad/s2]", "neighbour_position [rad]"],
    **dict.fromkeys(("LearnedFriction", "ThermalViscosity", "WarmingViscosity", "RubbedViscosity"), WARM),
    "WarmTorqueDroop": WARM,
}
HELD = {
    "Backlash": {"gap_rad", "load_share", "contact_hz"},
    "Compliance": {"antiresonance_hz", "resonance_hz"},
    "LoadSideCompliance": {"resonance_hz", "encoder_share"},
    "Delay": {"delay_ms"},
    "LearnedAfterReversal": {"creep"},
    "LearnedViscous": {"at_speed"},
    "LoadScaledFriction": {"at_level"},
}
"""Numbers that an FMU keeps from the start of a run to its end: they shape states, or are no machine's to change."""
PERCENT, PLACE = 100.0, {"is_size": False}
MAINS: dict[str, Main] = {
    "ActuatorLag": Main("time_constant_ms", unit="ms"),
    "Backlash": Main("gap_rad", unit="rad", **PLACE),
    "BoucWen": Main("torque"),
    "CableWrap": Main("stiffness", unit="N.m/rad"),
    "ClockSkew": Main("offset_ms", unit="ms", **PLACE),
    "Cogging": Main("amplitude"),
    "Compliance": Main("resonance_hz", unit="Hz", **PLACE),
    "LoadSideCompliance": Main("resonance_hz", unit="Hz", **PLACE),
    "ConcaveViscous": Main("exponent", unit="as power of speed", **PLACE),
    "DeadBand": Main("band"),
    "Delay": Main("delay_ms", unit="ms"),
    "DwellBreakaway": Main("torque_per_efold"),
    "EncoderEccentricity": Main("amplitude_rad", unit="rad"),
    "FrictionAsymmetry": Main("level_asymmetry", 200.0, "%"),
    "GearFriction": Main("driving", PERCENT, "% of the load"),
    "GravityUnbalance": Main("mgl"),
    "InertiaVariation": Main("relative_amplitude", PERCENT, "%"),
    **dict.fromkeys(
        (
            *("LearnedTorque", "LearnedFriction", "LearnedViscous", "LearnedDrive", "LearnedGain"),
            *("LearnedHysteresis", "LearnedAfterReversal"),
        ),
        Main("share", unit="1", **PLACE),
    ),
    "LoadDependentFriction": Main("coulomb_per_Nm", PERCENT, "% of the load"),
    "LoadScaledFriction": Main("coulomb_per_Nm", PERCENT, "% of the load"),
    "PeriodicDisturbance": Main("amplitude"),
    "PeriodicFriction": Main("relative_amplitude", PERCENT, "%"),
    "LocalFriction": Main("relative_amplitude", PERCENT, "%"),
    "Presliding": Main("sigma0", unit="N.m/rad", **PLACE),
    "QuadraticDrag": Main("coefficient", unit="N.m.s2/rad2"),
    "RoughSpot": Main("forward", PERCENT, "%"),
    "StribeckEffect": Main("Fs", **PLACE),
    **dict.fromkeys(
        ("ThermalViscosity", "WarmingViscosity", "RubbedViscosity"), Main("viscous_per_degC", PERCENT, "%/K")
    ),
    "TorqueDroop": Main("droop", PERCENT, "% at the rated torque"),
    "WarmTorqueDroop": Main("droop", PERCENT, "% at the rated torque"),
    "TorqueOffset": Main("torque"),
    "ConstantForce": Main("force"),
    "AxisCoupling": Main("inertia", unit="kg.m2"),
    "DampedCoupling": Main("damping", unit="N.m.s/rad"),
    "WeightCoupling": Main("weight"),
    "TorqueSaturation": Main("knee_torque", **PLACE),
}
NO_TORQUE = {
    "AltitudeInertia",
    "Backlash",
    "ClockSkew",
    "Compliance",
    "LoadSideCompliance",
    "EncoderEccentricity",
    "InertiaVariation",
}
"""What no torque added to the command can do: couplings, sensors, clocks, and an inertia that changes."""
LATER = NO_TORQUE - {"AltitudeInertia", "EncoderEccentricity", "InertiaVariation"}
LATER |= {"ActuatorLag", "Delay", "LearnedDrive"}
"""What changes what drive, springs and clocks make of a motion, not what each moment of it needs."""
NOT_TOLD = {"BoucWen", "FrictionWander"}
"""Of what a recorded motion cannot tell: chance, a memory that is not linear."""


def told(one: Variable) -> str:
    """Name, unit, and what is not as by default."""
    bounds = f" {one.low:g}..{one.high:g}" if (one.low, one.high) != (-inf, inf) else ""
    start = f" = {one.start:g}" if one.start else ""
    return f"{one.name} [{one.unit}]{start}{bounds}{f' ~{one.nominal:g}' if one.nominal != 1 else ''}"


@pytest.mark.parametrize("effect", EXAMPLES, ids=lambda one: type(one).__name__)
def test_an_effect_declares_states_inputs_and_what_is_held_as_its_fmus_do(effect: Effect) -> None:
    name = type(effect).__name__
    assert list(map(told, effect.states())) == STATES.get(name, [])
    assert list(map(told, effect.inputs())) == READ.get(name, [])
    assert {one.name for one in parameters_of(effect) if not one.tunable} == HELD.get(name, set())


@pytest.mark.parametrize("form", FORMS, ids=lambda one: one.__name__)
def test_an_effect_is_told_by_its_number_and_treated_by_its_kind(form: type[Effect]) -> None:
    name = form.__name__
    assert getattr(form, "main", None) == MAINS.get(name)
    assert form.is_torque == (name not in NO_TORQUE)
    assert form.at_once == (name not in LATER)
    assert form.is_determined == (name not in NOT_TOLD)


def test_learned_terms_say_what_their_coefficients_are() -> None:
    marks = {name: (form.in_torque, form.never_negative) for name, form in learned().items()}
    assert marks == {
        "LearnedTorque": (True, False),
        "LearnedFriction": (False, False),
        "LearnedViscous": (True, False),
        "LearnedDrive": (True, False),
        "LearnedGain": (False, False),
        "LearnedHysteresis": (True, True),
        "LearnedAfterReversal": (False, False),
    }
    doubled = pytest.approx(0.6931471805599453)
    assert {name: form.unit_value for name, form in learned().items() if form.unit_value != 1} == {
        "LearnedFriction": doubled,
        "LearnedGain": doubled,
    }, "the logarithm of two: of what is doubled"


def learned() -> dict[str, Any]:
    return {form.__name__: form for form in FORMS if form.id == "learned"}


def test_a_spring_is_fitted_with_its_resonance_above_its_antiresonance() -> None:
    """A hundredth of the inertia at least hangs on it: fr / fa = 1 / sqrt(0.99)."""
    ordered = {form.__name__: form.ordered for form in FORMS if form.ordered}
    assert ordered == {"Compliance": (("antiresonance_hz", "resonance_hz", pytest.approx(0.99**-0.5)),)}


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
