"""What a mechanic reads of an effect: whole sentences, by hand from the numbers, for axes that turn and that slide."""

from math import log

import pytest
from effect_examples import EXAMPLES, FORM, example

from cosim.diagnosis.measure.findings import between
from pyfmi_models.effects.shares import higher, percent

TURNING = {
    "ActuatorLag": "The drive builds up its torque slowly, with a time constant of 4 ms.",
    "AltitudeInertia": "The azimuth carries 3 kg·m² more with the tube level than at the zenith.",
    "AzimuthCentrifugal": "Turning in azimuth swings the tube down; it weighs 3 kg·m² against it.",
    "Backlash": "There is play of 0.01 rad in the drive.",
    "BoucWen": "A belt or gear goes round a loop of 1.79 N·m either way, within 0.05 rad.",
    "CableWrap": "A cable or spring pulls towards 0.2 rad with 3 N·m per rad.",
    "ClockSkew": "The clock of the encoder is 4 ms ahead of the torque and drifts by 100 ppm; not mechanical.",
    "Cogging": "The motor torque ripples 24 times per turn, by 0.5 N·m each way.",
    "Compliance": "36 % of the inertia hangs on a spring that rings at 25 Hz.",
    "LoadSideCompliance": "The motor turns the axis through a spring: both ring against each other at 60 Hz.",
    "ConcaveViscous": "Above 0.3 rad/s viscous friction falls: the grease thins.",
    "DeadBand": "The drive gives next to nothing for commands below 0.5 N·m, and less by that above.",
    "Delay": "Actuation delay of 4 ms (drive or bus, not mechanical).",
    "DwellBreakaway": "The longer the axis rests the harder it starts: "
    f"{0.3 * log(10):.2g} N·m more for ten times the rest.",
    "EncoderEccentricity": "The encoder errs by 0.001 rad either way, 8 times per turn.",
    "GearFriction": "The gear's friction rises by 0.3 N·m for each N·m that it lifts and 0.1 that it lowers.",
    "GravityUnbalance": "The axis is out of balance by 1.5 N·m.",
    "InertiaVariation": "The inertia rises and falls by 30 %, 2 times per turn.",
    "KnownLoad": "The known load acts with 1 N·m of drive torque for each N·m.",
    "LearnedAfterReversal": "After a reversal friction is 11 % higher for a while; learned from data.",
    "LearnedDrive": "The drive gives up to 0.25 N·m less or more than its command; a table learned from data.",
    "LearnedHysteresis": "Something goes round a loop of 0.5 N·m either way; learned from data.",
    "LoadDependentFriction": "Friction rises by 0.2 N·m for each N·m of load on the axis.",
    "GearLoadFriction": "Friction rises by 0.2 N·m for each N·m through the gear, to hold a load or to move it.",
    "LoadScaledFriction": "Friction rises by 0.1 N·m for each N·m of load on the axis.",
    "LocalFriction": "Around 1 rad friction is 30 % higher, over about 0.2 rad.",
    "PeriodicDisturbance": "Something shakes the axis 3 times a second with 0.6 N·m.",
    "PeriodicFriction": "Friction rises and falls by 20 %, 3 times per turn.",
    "Presliding": "Before it slides the axis bends like a spring of 2e+04 N·m per rad.",
    "QuadraticDrag": "Drag grows with the square of the speed, 2 N·m at 1 rad/s.",
    "RoughSpot": "Around 0.3 rad friction is 80 % higher moving forward and 30 % lower backward, over about 0.4 rad.",
    "StribeckEffect": "Below about 0.02 rad/s friction changes with speed, to 4 N·m near standstill.",
    "ThermalViscosity": "Viscous friction falls by 4 % per degree and sliding friction falls by 2 % per degree.",
    "WarmingViscosity": "Viscous friction falls by 45 % in the first 90 s.",
    "RubbedViscosity": "Viscous friction falls by 32 % per rad rubbed.",
    "TorqueDroop": "Of a command of 8 N·m the drive loses 20 %, of small ones less.",
    "WarmTorqueDroop": "Of a command of 8 N·m the drive loses 20 %, of small ones less, "
    "and gives 0.2 % less per degree.",
    "TorqueOffset": "A constant 0.7 N·m pushes the axis backward, moving or not.",
    "ConstantForce": "A constant load of 0.7 N·m pushes the axis backward: "
    "a weight, or an offset of the drive's reading.",
    "TorqueSaturation": "The drive saturates at 5 N·m: 40 % of what is asked for beyond it arrives.",
}
"""By the examples of tests/tools/effect_examples.py; 36 % is 1 - (20 / 25)^2, the share that rings."""
SLIDING = {
    "N·m": "N",
    "per rad": "per m",
    " rad ": " m ",
    "rad.": "m.",
    "rad/s": "m/s",
    "per turn": "per metre",
    "of the inertia": "of the moving mass",
    "The inertia rises": "The moving mass rises",
    "constant load of 0.7": "constant force of 0.7",
    "0.7 N pushes the axis backward:": "0.7 N pushes the carriage backward:",
}
"""What the sentence of an axis that slides says in the place of these words, and in nothing else."""


@pytest.mark.parametrize("name", TURNING)
def test_a_sentence_says_the_numbers_of_an_axis_that_turns_and_of_one_that_slides(name: str) -> None:
    effect, sliding = example(FORM[name]), TURNING[name]
    assert effect.statement() == TURNING[name]
    for one, other in SLIDING.items():
        sliding = sliding.replace(one, other)
    assert effect.statement("N") == sliding


@pytest.mark.parametrize(
    ("name", "numbers", "expected"),
    [
        ("ClockSkew", {"offset_ms": -4.0}, "The clock of the encoder is 4 ms behind the torque; not mechanical."),
        ("ClockSkew", {"drift_ppm": -50.0}, "The clock of the encoder drifts by -50 ppm; not mechanical."),
        ("ClockSkew", {}, "The clock of the encoder is right; not mechanical."),
        ("TorqueOffset", {"torque": -0.7}, "A constant 0.7 N·m pushes the axis forward, moving or not."),
        ("TorqueSaturation", {"knee_torque": 5.0}, "The drive saturates at 5 N·m: no more arrives."),
        (
            "WarmTorqueDroop",
            {"droop": 0.2, "rated_torque": 8.0, "per_degC": 0.002},
            TURNING["WarmTorqueDroop"].replace("less per", "more per"),
        ),
        ("ThermalViscosity", {"viscous_per_degC": 0.0}, "Friction keeps its size."),
        (
            "WarmingViscosity",
            {"viscous_per_degC": 0.01, "coulomb_per_degC": -0.02, "warm_up_degC": 10.0, "warm_up_s": 60.0},
            "Viscous friction grows by 11 % in the first 3 min and sliding friction falls by 18 % in the first 3 min.",
        ),
        ("ThermalViscosity", {"viscous_per_degC": 0.04}, "Viscous friction grows by 4 % per degree."),
        (
            "ConcaveViscous",
            {"thinning_speed": 0.3, "exponent": 0.4},
            "Above 0.3 rad/s viscous friction rises less than the speed: the grease thins.",
        ),
        (
            "FrictionAsymmetry",
            {"level_asymmetry": -0.1, "viscous_asymmetry": 0.009},
            "Sliding friction differs by 20 % between directions (of the mean; higher backward).",
        ),
        (
            "FrictionAsymmetry",
            {"level_asymmetry": 0.1, "viscous_asymmetry": -0.2},
            "Viscous friction differs by 40 % between directions (of the mean; higher backward), "
            "sliding friction differs by 20 % between directions (of the mean; higher forward).",
        ),
        (
            "GearFriction",
            {"driving": 0.6, "driven": 1.2},
            "The gear's friction rises by 0.6 N·m for each N·m that it lifts and 1.2 that it lowers; "
            "it holds its load by itself.",
        ),
        (
            "FrictionWander",
            {"std": 0.25, "correlation_time": 0.3, "jump_std": 0.1, "jump_period": 2.5},
            "Friction wanders by 25 % (RMS) within 0.3 s, and jumps by 10 % every 2.5 s: "
            "the same motion twice meets another friction.",
        ),
    ],
)
def test_a_sentence_says_signs_and_leaves_out_what_is_not_there(
    name: str, numbers: dict[str, float], expected: str
) -> None:
    assert FORM[name](**numbers).statement() == expected


def test_what_was_learned_says_over_what_and_how_large_it_is() -> None:
    """Half the range between the greatest and the least of a table is what it does either way."""
    said = {type(one).__name__: one.statement() for one in EXAMPLES}
    assert said["LearnedTorque"] == "Something that depends on position, 0.6 N·m; a table learned from data."
    assert said["LearnedFriction"].startswith(
        "Something that depends on position and temperature, 46 % of the friction;"
    )


@pytest.mark.parametrize(
    ("ends", "text"),
    [
        ((28.93, 31.42), "28.9 to 31.4"),
        ((5.9953, 6.0047), "5.995 to 6.005"),
        ((0.19769, 0.19831), "0.1977 to 0.1983"),
        ((0.541, 0.578), "0.541 to 0.578"),
        ((123456.0, 234567.0), "123456 to 234567"),
        ((0.0, 0.0), "0 to 0"),
    ],
)
def test_a_range_tells_its_ends_apart_with_equally_many_digits(ends: tuple[float, float], text: str) -> None:
    assert between(*ends) == text


@pytest.mark.parametrize(
    ("share", "text"), [(0.4226, "42 %"), (1.893, "189 %"), (0.997, "100 %"), (0.0123, "1.2 %"), (0.994, "99 %")]
)
def test_a_share_is_written_without_a_power_of_ten(share: float, text: str) -> None:
    assert percent(share) == text
    assert higher(-share) == f"{text} lower"
