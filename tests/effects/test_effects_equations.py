"""Every effect's equation, written again in plain Python from its docstring and asked at random motions."""

import cmath
import math
from collections.abc import Callable
from itertools import product
from random import Random
from typing import Any

import casadi as ca
import numpy as np
import pytest
from effect_examples import FORM, example

from pyfmi_models.effects import Effect, Motion

Rows = list[float]


def sign(x: float) -> float:
    return float((x > 0) - (x < 0))


def wave(a: float) -> float:
    """Of the example of cogging: harmonics 0.4 and -0.2."""
    return math.sin(a) + 0.4 * math.sin(2 * a) - 0.2 * math.sin(3 * a)


HALF = float(np.ptp([wave(a) for a in np.linspace(0, 2 * math.pi, 100001)])) / 2


def soft(x: float, w: float) -> float:
    return w * math.log(1 + math.exp(x / w)) if x < 500 * w else x


def held(x: float) -> float:
    return min(max(x, -1.0), 1.0)


def drooped(e: Any, u: float) -> float:
    def s(x: float) -> float:
        return math.sqrt(x**2 + 0.05**2) - 0.05

    c = (1 / (1 - e.droop) - 1) / s(1)
    return u / (1 + c * s(u / e.rated_torque))


def table(e: Any, coefficients: Rows, low: float, high: float, value: float, other: float = 0.0) -> float:
    """The sum of waves over [low, high]; of the example of products over 15 to 35 degC with one wave."""
    x = min(max((value - low) / (high - low), 0), 1)
    if not e.by:
        return sum(c * math.cos(math.pi * k * x) for k, c in enumerate(coefficients))
    y = min(max((other - 15) / 20, 0), 1)
    shapes = (math.cos(math.pi * k * x) * math.cos(math.pi * n * y) for k, n in product(range(3), range(2)))
    return sum(c * shape for c, shape in zip(coefficients, shapes, strict=True))


def missing(e: Any, u: float) -> float:
    """Of the example of a learned drive: -20 to 20 N m, dense where a command is below 1 N m."""
    x = (u / (abs(u) + 1) + 20 / 21) / (40 / 21)
    return sum(c * math.cos(math.pi * k * min(max(x, 0), 1)) for k, c in enumerate(e.missing))


def bent(e: Any, m: Motion) -> float:
    z, v = m.state[0], m.v
    size = (z * z + 1e-6) ** ((e.n - 1) / 2)
    return float(e.A * v - e.beta * abs(v) * size * z - e.gamma * v * size * abs(z)) / e.stroke


def bump(x: float) -> float:
    return math.exp(-min(x * x, 1000) / 2)


def gear(e: Any, m: Motion, level: float) -> float:
    way = m.payload * sign(m.v)
    if way == 0:
        return level + (e.driving + e.driven) / 2 * abs(m.payload)
    return level + (e.driving if way > 0 else e.driven) * abs(m.payload)


def through(e: Any, m: Motion, level: float) -> float:
    """The root of g = level (1 + c/Fc |payload + s push + f others + taking g|), halved to from both sides."""
    taking = e.friction_share * sign(m.v) - e.inertia_share * m.balance.taken
    given = m.payload + e.inertia_share * m.balance.push + e.friction_share * m.balance.others
    low, high = level, 100 * (abs(level) + abs(given))
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if middle < level * (1 + 0.1 * abs(given + taking * middle)) else (low, middle)
    return low


def spot(e: Any, m: Motion, level: float) -> float:
    rise = (e.forward + e.backward) / 2 if m.v == 0 else e.forward if m.v > 0 else e.backward
    return level * (1 + rise * bump((m.q - e.q_center) / e.width))


LEVELS: dict[str, Callable[[Any, Motion, float], float]] = {
    "FrictionAsymmetry": lambda e, m, g: g * (1 + e.level_asymmetry * sign(m.v)),
    "StribeckEffect": lambda e, m, g: g + (e.Fs - g) * math.exp(-(abs(m.v / e.Vs) ** e.delta)),
    "PeriodicFriction": lambda e, m, g: g * (1 + 0.2 * math.cos(3 * m.angle + 0.4)),
    "LocalFriction": lambda e, m, g: g * (1 + 0.3 * bump((m.q - 1) / 0.05)),
    "RoughSpot": spot,
    "GearFriction": gear,
    "GearLoadFriction": through,
    "LoadDependentFriction": lambda e, m, g: g + 0.2 * abs(m.payload),
    "LoadScaledFriction": lambda e, m, g: g * (1 + 0.1 * abs(m.payload) / 2),
    "DwellBreakaway": lambda e, m, g: g + 0.3 * math.log(1 + m.state[0] / 0.1),
    "ThermalViscosity": lambda e, m, g: g * math.exp(-0.02 * (m.inputs["temperature"] - 20)),
    "LearnedFriction": lambda e, m, g: (
        g * math.exp(table(e, e.level_change, -1, 1.2, m.q, float(m.inputs["temperature"])))
    ),
    "LearnedAfterReversal": lambda e, m, g: (
        g * math.exp(sum(c * (1 - math.tanh(m.v / 1e-4) * held(m.state[k])) / 2 for k, c in enumerate(e.level_change)))
    ),
}


def followed(e: Any, m: Motion, f: float) -> float:
    """Of the example of learned drag: over -2 to 2 rad/s2, dense below 0.6, told at 0.5 rad/s."""
    a = (m.v - m.state[0]) / 0.02
    x = min(max((a / (abs(a) + 0.6) + 2 / 2.6) / (4 / 2.6), 0), 1)
    told = sum(c * math.cos(math.pi * k * x) for k, c in enumerate(e.viscous_torque))
    more = told * m.v / 0.5
    return f + more if told >= 0 else f * abs(f) / (abs(f) + abs(more))


VISCOUS: dict[str, Callable[[Any, Motion, float], float]] = {
    "LearnedViscous": followed,
    "FrictionAsymmetry": lambda e, m, f: f * (1 + e.viscous_asymmetry * sign(m.v)),
    "ConcaveViscous": lambda e, m, f: f * (1 + (m.v / 0.3) ** 2) ** ((-0.4 - 1) / 2),
    "ThermalViscosity": lambda e, m, f: f * math.exp(-0.04 * (m.inputs["temperature"] - 20)),
    "WarmingViscosity": lambda e, m, f: f * math.exp(-0.04 * (m.inputs["temperature"] + m.state[0] - 20)),
    "RubbedViscosity": lambda e, m, f: f * math.exp(-0.04 * (m.inputs["temperature"] + m.state[0] - 20)),
}
LOADS: dict[str, Callable[[Any, Motion], float]] = {
    "Cogging": lambda e, m: 0.5 / HALF * wave(24 * m.angle + 0.3 + math.pi / 2),
    "GravityUnbalance": lambda e, m: 1.5 * math.sin(m.angle + 0.2),
    "TorqueOffset": lambda e, m: 0.7,
    "ConstantForce": lambda e, m: 0.7,
    "QuadraticDrag": lambda e, m: 2 * m.v * abs(m.v),
    "CableWrap": lambda e, m: 3 * (m.q - 0.2) * (1 + 0.5 * (m.q - 0.2) ** 2),
    "AzimuthCentrifugal": lambda e, m: 3 * math.sin(m.q) * math.cos(m.q) * m.inputs["azimuth_rate"] ** 2,
    "KnownLoad": lambda e, m: e.gain * m.inputs["load_torque"],
    "AxisCoupling": lambda e, m: 0.4 * m.inputs["neighbour_acceleration"],
    "DampedCoupling": lambda e, m: 0.4 * m.inputs["neighbour_acceleration"] + 0.3 * m.inputs["neighbour_speed"],
    "WeightCoupling": lambda e, m: (
        0.4 * m.inputs["neighbour_acceleration"] + 1.5 * math.sin(m.angle + m.inputs["neighbour_position"] + 0.2)
    ),
    "ChainCoupling": lambda e, m: (
        1.5 * math.sin(m.angle + m.inputs["neighbour_position"] - m.inputs["second_neighbour_position"] + 0.2)
    ),
    "SpaceCoupling": lambda e, m: (
        (
            0.7 * math.sin(m.angle) * math.sin(m.inputs["neighbour_position"])
            - 1.5 * math.cos(m.angle) * math.cos(m.inputs["neighbour_position"])
        )
        * math.cos(m.inputs["second_neighbour_position"])
    ),
    "BoucWen": lambda e, m: 0.8 * m.state[0],
    "PeriodicDisturbance": lambda e, m: 0.6 * math.sin(2 * math.pi * 3 * m.t + 0.2),
    "LearnedTorque": lambda e, m: table(e, e.torque, -1, 1.2, m.q),
    "LearnedHysteresis": lambda e, m: 0.2 * held(m.state[0]) + 0.3 * held(m.state[1]),
}
INERTIAS: dict[str, Callable[[Any, Motion, float], float]] = {
    "InertiaVariation": lambda e, m, J: J * (1 + 0.3 * math.cos(2 * m.angle + 0.4)),
    "AltitudeInertia": lambda e, m, J: J + 3 * math.cos(m.inputs["altitude"]) ** 2,
}
READINGS: dict[str, Callable[[Any, Motion, float], float]] = {
    "EncoderEccentricity": lambda e, m, q: (
        q + 1e-3 * (math.sin(8 * m.angle + 0.3) + 0.2 * math.sin(2 * (8 * m.angle + 0.3)))
    ),
}
AHEAD: dict[str, Callable[[Any, Motion], float]] = {"ClockSkew": lambda e, m: 4e-3 + 1e-4 * m.t}
RATES: dict[str, Callable[[Any, Motion], Rows]] = {
    "DwellBreakaway": lambda e, m: [1 - m.state[0] * abs(m.v) / 1e-3],
    "WarmingViscosity": lambda e, m: [(15 - m.state[0]) / 30],
    "RubbedViscosity": lambda e, m: [8 * abs(m.v) - m.state[0] / 30],
    "BoucWen": lambda e, m: [bent(e, m)],
    "LearnedViscous": lambda e, m: [(m.v - m.state[0]) / 0.02],
    "LearnedHysteresis": lambda e, m: [(m.v - abs(m.v) * m.state[k]) / way for k, way in enumerate((0.1, 0.4))],
    "LearnedAfterReversal": lambda e, m: [
        (math.tanh(m.v / 1e-4) - m.state[k]) / time for k, time in enumerate((0.1, 0.4))
    ],
}
APPLIED: dict[str, Callable[[Any, Rows, float], float]] = {
    "ActuatorLag": lambda e, x, u: x[0],
    "Delay": lambda e, x, u: x[0] - 0.4 * x[1] + 0.05 * x[2],
    "TorqueSaturation": lambda e, x, u: u - 0.6 * (soft(u - 5, 0.1) - soft(-u - 5, 0.1)),
    "DeadBand": lambda e, x, u: soft(u - 0.5, 0.125) - soft(-u - 0.5, 0.125),
    "TorqueDroop": lambda e, x, u: drooped(e, u),
    "LearnedDrive": lambda e, x, u: u - missing(e, u),
}
DRIVEN: dict[str, Callable[[Any, Rows, float], Rows]] = {
    "ActuatorLag": lambda e, x, u: [(u - x[0]) / 4e-3],
    "Delay": lambda e, x, u: [x[1] / 4e-3, x[2] / 4e-3, (60 * u - 60 * x[0] - 36 * x[1] - 9 * x[2]) / 4e-3],
}
RESPONSES: dict[str, Callable[[float], complex]] = {
    "ActuatorLag": lambda w: 1 / complex(1, w * 4e-3),
    "Delay": lambda w: cmath.exp(-1j * w * 4e-3),
}


def motions(effect: Effect, seed: int) -> list[Motion]:
    """Forward, backward and at rest; states within and beyond their range."""
    dice, found = Random(seed), []
    for k in range(12):
        names = ("temperature", "altitude", "azimuth_rate", "load_torque", "altitude_rate")
        names += ("neighbour_position", "neighbour_speed", "neighbour_acceleration", "second_neighbour_position")
        inputs = {name: dice.uniform(10, 40) if name == "temperature" else dice.uniform(-2, 2) for name in names}
        speed = (0.0, dice.uniform(0.01, 2), -dice.uniform(0.01, 2), dice.uniform(-2e-4, 2e-4))[k % 4]
        state = [abs(dice.uniform(-1.5, 1.5)) if one.low >= 0 else dice.uniform(-1.5, 1.5) for one in effect.states()]
        place = dice.uniform(-1.5, 1.5)
        found.append(Motion(dice.uniform(0, 9), place, speed, place + 0.2, inputs, dice.uniform(-3, 3), state))
    return found


def near(found: Any, expected: Any, rtol: float = 1e-7) -> None:
    np.testing.assert_allclose(ca.DM(found).full().ravel(), np.ravel(expected), rtol=rtol, atol=1e-12)


OF_A_VALUE = {"level": LEVELS, "viscous": VISCOUS, "inertia": INERTIAS, "reading": READINGS}
OF_A_MOTION: dict[str, Any] = {"load": LOADS, "ahead": AHEAD, "rate": RATES}
ASKED = [(method, name) for method, forms in (OF_A_VALUE | OF_A_MOTION).items() for name in forms]


@pytest.mark.parametrize(("method", "name"), ASKED)
def test_what_an_effect_makes_of_a_motion_is_its_equation(method: str, name: str) -> None:
    expected, effect = (OF_A_VALUE | OF_A_MOTION)[method][name], example(FORM[name])
    for k, motion in enumerate(motions(effect, 2)):
        value = (1.7 if k % 2 else 0.3,) if method in OF_A_VALUE else ()
        rtol = 2e-6 if name == "Cogging" else 1e-7  # its half is the highest of 3072 points, not of all
        near(getattr(effect, method)(*value, motion), expected(effect, motion, *value), rtol)


@pytest.mark.parametrize("name", APPLIED)
def test_what_a_drive_makes_of_a_command_is_its_equation(name: str) -> None:
    effect = example(FORM[name])
    for command in (-30.0, -5.0, -1.1, -0.3, 0.0, 0.02, 0.6, 4.9, 5.2, 25.0):
        state = [0.3, -1.2, 2.0][: len(effect.states())]
        near(effect.applied(ca.DM(state), command), APPLIED[name](effect, state, command))
        near(effect.rate(ca.DM(state), command), DRIVEN[name](effect, state, command) if name in DRIVEN else [])


@pytest.mark.parametrize("name", RESPONSES)
def test_the_response_of_a_drive_is_that_of_its_equation(name: str) -> None:
    omega = np.array([0.0, 1.0, 40.0, 250.0, 3e3])
    np.testing.assert_allclose(example(FORM[name]).response(omega), [RESPONSES[name](w) for w in omega], rtol=1e-12)


def warm(e: Any, m: Motion) -> float:
    return drooped(e, 6.0) * max(0.1, 1 - 0.002 * (m.inputs["temperature"] - 20))


GIVEN: dict[str, Callable[[Any, Motion], float]] = {
    "WarmTorqueDroop": warm,
    "LearnedGain": lambda e, m: 6 * math.exp(-table(e, list(e.more_command), -1, 1.2, m.q)),
}


@pytest.mark.parametrize("name", GIVEN)
@pytest.mark.parametrize(("q", "degrees"), [(-3.0, -40.0), (-0.4, 20.0), (0.6, 60.0), (1.3, 700.0)])
def test_a_drive_that_goes_with_the_motion_is_its_equation(name: str, q: float, degrees: float) -> None:
    """A warm drive gives never less than a tenth."""
    effect, motion = example(FORM[name]), Motion(0.0, q, 0.0, q, {"temperature": degrees})
    near(effect.given(motion).applied((), 6.0), GIVEN[name](effect, motion))


def test_every_form_with_an_equation_of_its_own_is_asked_here() -> None:
    asked = {*(name for _, name in ASKED), *APPLIED, *RESPONSES, *GIVEN}
    others = {"Compliance", "LoadSideCompliance", "Backlash", "FrictionWander", "Presliding"}
    assert set(FORM) == asked | others, "those in test_effects_masses.py"
