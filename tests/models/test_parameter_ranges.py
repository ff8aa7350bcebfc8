"""What a card may hold for friction laws and effects, and what a number is that it leaves out.

Every number is a promise to the cards that there are: low .. high, ~ the size that an FMU states as nominal, = what it
is where a card says nothing; `fixed` numbers are never fitted to a recording.
"""

from dataclasses import MISSING, fields
from typing import Any

import pytest

import pyfmi_models.friction
from pyfmi_models.effects import FORMS
from pyfmi_models.friction.base import FrictionLaw

LAWS = [
    one
    for one in vars(pyfmi_models.friction).values()
    if isinstance(one, type) and issubclass(one, FrictionLaw) and hasattr(one, "key")
]
RANGES = """
Coulomb
    smoothing 1e-09..inf ~1e-05 = 1e-05 fixed
    Fc 0..inf ~1
    sigma2 0..inf ~1 = 0
Dahl
    sigma0 1e-06..inf ~10000
    Fc 1e-09..inf ~1
    n 0.5..5 ~1 = 1 fixed
    sigma2 0..inf ~1 = 0
Frictionless
    smoothing 1e-09..inf ~1e-05 = 1e-05 fixed
LuGre
    sigma0 1e-06..inf ~10000
    sigma1 0..inf ~100 = 0
    sigma2 0..inf ~1 = 0
    Fc 1e-09..inf ~1
    Fs 1e-09..inf ~1 = None
    Vs 1e-09..inf ~0.01 = None
    delta 0.1..5 ~1 = 2 fixed
MaxwellSlip
    sigma0 1e-06..inf ~10000
    sigma1 0..inf ~100 = 0
    sigma2 0..inf ~1 = 0
    Fc 1e-09..inf ~1
    Fs 1e-09..inf ~1 = None
    Vs 1e-09..inf ~0.01 = None
    delta 0.1..5 ~1 = 2 fixed
    spread 1..1e+06 ~1 = 18 fixed
    attraction 20..1000 ~1 = 50 fixed
Stribeck
    smoothing 1e-09..inf ~1e-05 = 1e-05 fixed
    Fc 0..inf ~1
    Fs 0..inf ~1 = None
    Vs 1e-09..inf ~1 = None
    delta 0.1..5 ~1 = 2 fixed
    sigma2 0..inf ~1 = 0
ActuatorLag
    time_constant_ms 0.02..200 ~1
AltitudeInertia
    tube_inertia 0..inf ~1
AzimuthCentrifugal
    tube_inertia 0..inf ~1
Backlash
    gap_rad 0..inf ~0.001
    load_share 0.01..0.99 ~1 = 0.5
    contact_hz 1..10000 ~1 = 50 fixed
    damping_ratio 0..5 ~1 = 0.75 fixed
    load_friction 0..inf ~1 = 0
    load_viscous 0..inf ~1 = 0
    load_deflection 1e-09..0.1 ~1 = 1e-05
BoucWen
    torque 0..inf ~1
    stroke 1e-09..inf ~0.1
    A 0.001..1000 ~1 = 1 fixed
    beta 0..inf ~1 = 0.5 fixed
    gamma -inf..inf ~1 = 0.5
    n 1..10 ~1 = 1 fixed
CableWrap
    stiffness 0..inf ~1
    home -inf..inf ~1 = 0
    hardening 0..inf ~1 = 0 fixed
ClockSkew
    drift_ppm -100000..100000 ~1 = 0
    offset_ms -1000..1000 ~1 = 0
Cogging
    cycles_per_rev 0..inf ~1 fixed
    amplitude 0..inf ~1
    phase -inf..inf ~1 = 0
Compliance
    antiresonance_hz 0.1..10000 ~1
    resonance_hz 0.1..10000 ~1
    damping_ratio 0..2 ~1 = 0.02
LoadSideCompliance
    resonance_hz 0.1..10000 ~1
    encoder_share 0.05..0.95 ~0.5 fixed
    damping_ratio 0..2 ~1 = 0.02
ConcaveViscous
    thinning_speed 1e-09..inf ~0.1
    exponent -1..1 ~1 = 0
DeadBand
    band 1e-09..inf ~1
    softness 0.2..2 ~1 = 0.25
Delay
    delay_ms 0.02..50 ~1
DwellBreakaway
    torque_per_efold 0..inf ~1
    onset_s 1e-06..inf ~1 = 0.1 fixed
    memory_rad 1e-09..inf ~0.001 = 0.001
EncoderEccentricity
    cycles_per_rev 0..inf ~1 fixed
    amplitude_rad 0..inf ~0.0001
    phase -inf..inf ~1 = 0
    second -10..10 ~1 = 0
FrictionAsymmetry
    level_asymmetry -0.95..0.95 ~1
    viscous_asymmetry -0.95..0.95 ~1 = 0
FrictionWander
    std 0..0.5 ~1
    correlation_time 0.001..inf ~1 = 0.3
    jump_std 0..0.5 ~1 = 0
    jump_period 0.01..inf ~1 = 2.5
    seed 0..1e+06 ~1 = 0
GearFriction
    driving 0..10 ~1
    driven 0..10 ~1
GravityUnbalance
    mgl 0..inf ~1
    phase -inf..inf ~1 = 0
InertiaVariation
    relative_amplitude 0..0.95 ~1
    cycles_per_rev 0..inf ~1 = 1 fixed
    phase -inf..inf ~1 = 0
KnownLoad
    gain 0..1000 ~1 = 1
LearnedTorque
    share 0..1 ~1 = 1 fixed
LearnedFriction
    share 0..1 ~1 = 1 fixed
LearnedViscous
    share 0..1 ~1 = 1 fixed
    at_speed 1e-09..inf ~1 = 1 fixed
LearnedDrive
    share 0..1 ~1 = 1 fixed
LearnedGain
    share 0..1 ~1 = 1 fixed
LearnedHysteresis
    share 0..1 ~1 = 1 fixed
LearnedAfterReversal
    share 0..1 ~1 = 1 fixed
    creep 1e-09..inf ~0.0001 = 0.0001
LoadDependentFriction
    coulomb_per_Nm 0..10 ~1
LoadScaledFriction
    coulomb_per_Nm 0..10 ~1
    at_level 1e-09..inf ~1 fixed
PeriodicDisturbance
    frequency_hz 0.0001..10000 ~1
    amplitude 0..inf ~1
    phase -inf..inf ~1 = 0
PeriodicFriction
    cycles_per_rev 0..inf ~1 fixed
    relative_amplitude 0..0.95 ~1
    phase -inf..inf ~1 = 0
LocalFriction
    q_center -inf..inf ~1
    width 1e-06..inf ~1
    relative_amplitude -0.95..20 ~1
Presliding
    sigma0 1e-06..inf ~10000
    sigma1 0..inf ~100 = 0
QuadraticDrag
    coefficient 0..inf ~1
RoughSpot
    q_center -inf..inf ~1
    width 1e-06..inf ~1
    forward -0.95..20 ~1
    backward -0.95..20 ~1
StribeckEffect
    Fs 1e-09..inf ~1
    Vs 1e-07..inf ~0.01
    delta 0.1..5 ~1 = 2 fixed
ThermalViscosity
    viscous_per_degC -1..1 ~1
    coulomb_per_degC -1..1 ~1 = 0
WarmingViscosity
    viscous_per_degC -1..1 ~1
    coulomb_per_degC -1..1 ~1 = 0
    warm_up_degC 0..200 ~1 fixed
    warm_up_s 0.001..inf ~1 = 600
RubbedViscosity
    viscous_per_degC -1..1 ~1
    coulomb_per_degC -1..1 ~1 = 0
    heat_degC_per_rad 0..1e+06 ~1 fixed
    cooling_s 0.001..inf ~1 = 600
TorqueDroop
    droop 0..0.9 ~1
    rated_torque 1e-06..inf ~1 fixed
WarmTorqueDroop
    droop 0..0.9 ~1
    rated_torque 1e-06..inf ~1 fixed
    per_degC -0.05..0.05 ~1
TorqueOffset
    torque -inf..inf ~1
ConstantForce
    force -inf..inf ~1
AxisCoupling
    inertia -inf..inf ~1 = 0
DampedCoupling
    inertia -inf..inf ~1 = 0
    damping -inf..inf ~1
WeightCoupling
    inertia -inf..inf ~1 = 0
    weight 0..inf ~1
    phase -inf..inf ~1 = 0
    follows -inf..inf ~1 = 1 fixed
TorqueSaturation
    knee_torque 1e-06..inf ~1
    slope 0..1 ~1 = 0
"""
LISTS = {
    "Cogging": ["harmonics -100..100"],
    "LearnedTorque": ["seen -1e+09..1e+09", "by_seen -1e+09..1e+09", "waves 0..40", "torque -1e+09..1e+09"],
    "LearnedFriction": ["seen -1e+09..1e+09", "by_seen -1e+09..1e+09", "waves 0..40", "level_change -5..5"],
    "LearnedViscous": ["seen -1e+09..1e+09", "by_seen -1e+09..1e+09", "waves 0..40", "viscous_torque -1e+09..1e+09"],
    "LearnedGain": ["seen -1e+09..1e+09", "by_seen -1e+09..1e+09", "waves 0..40", "more_command -5..5"],
    "LearnedDrive": ["command_seen -1e+09..1e+09", "missing -1e+09..1e+09"],
    "LearnedHysteresis": ["strokes 1e-09..1e+09", "torque 0..1e+09"],
    "LearnedAfterReversal": ["ways 1e-09..1e+09", "times 1e-09..1e+09", "level_change -5..5"],
}
"""Lists of numbers that shape the equations: what each of a list may be."""


def told(item: Any) -> str:
    """A number of a form, as the table writes it."""
    variable, default = item.metadata["variable"], item.default
    value = "" if default is MISSING else " = None" if default is None else f" = {default:g}"
    fixed = "" if item.metadata.get("fitted") else " fixed"
    return f"{item.name} {variable.low:g}..{variable.high:g} ~{variable.nominal:g}{value}{fixed}"


def promised() -> dict[str, list[str]]:
    """The table by form."""
    found: dict[str, list[str]] = {}
    for line in RANGES.strip().splitlines():
        if line.startswith(" "):
            found[list(found)[-1]].append(line.strip())
        else:
            found[line] = []
    return found


@pytest.mark.parametrize("form", [*LAWS, *FORMS], ids=lambda one: one.__name__)
def test_a_form_takes_the_numbers_that_its_cards_were_promised(form: type) -> None:
    here = [told(item) for item in fields(form) if "variable" in item.metadata]
    assert here == promised().get(form.__name__, [])


@pytest.mark.parametrize("form", FORMS, ids=lambda one: one.__name__)
def test_a_form_takes_the_lists_that_its_cards_were_promised(form: type) -> None:
    lists = {item.name: item.metadata["structure"] for item in fields(form) if "structure" in item.metadata}
    assert [f"{name} {one.low:g}..{one.high:g}" for name, one in lists.items()] == LISTS.get(form.__name__, [])


def test_the_table_names_only_forms_that_there_are() -> None:
    assert set(promised()) | set(LISTS) <= {one.__name__ for one in [*LAWS, *FORMS]}
