"""Whole models against their equations: a plant with all that can stand in a row, set points, pointing."""

import math
from itertools import product
from random import Random
from typing import Any

import casadi as ca
import numpy as np
import pytest
from effect_examples import evaluate, mount

from pyfmi_models.effects.alt_az import AltitudeInertia
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.cable_wrap import CableWrap
from pyfmi_models.effects.clock_skew import ClockSkew
from pyfmi_models.effects.compliance import Compliance, LoadSideCompliance
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity
from pyfmi_models.effects.inertia_variation import InertiaVariation
from pyfmi_models.friction import Coulomb
from pyfmi_models.model import Model
from pyfmi_models.pointing import PointingError
from pyfmi_models.setpoint import Sine

ROW: dict[str, Any] = {
    "motor": LoadSideCompliance(resonance_hz=60.0, encoder_share=0.6),
    "spring": Compliance(antiresonance_hz=20.0, resonance_hz=25.0),
    "play": Backlash(gap_rad=1e-3, load_share=0.3, load_friction=0.2, load_viscous=0.4, load_deflection=1e-3),
    "varies": InertiaVariation(relative_amplitude=0.3, cycles_per_rev=2.0, phase=0.4),
    "tube": AltitudeInertia(tube_inertia=0.5),
    "cable": CableWrap(stiffness=3.0, home=0.2),
    "encoder": EncoderEccentricity(cycles_per_rev=8.0, amplitude_rad=1e-3, phase=0.3),
    "clock": ClockSkew(offset_ms=4.0, drift_ppm=100.0),
}
PLANT = mount(*ROW.values(), friction=Coulomb(Fc=1.0, sigma2=3.0, smoothing=1e-3)).model()
"""An axis of 2 kg m2 with a motor in front of it, a spring and a play behind, and errors of encoder and clock."""


def state_names() -> list[str]:
    return [one.name for one in PLANT.states]


def number(value: Any) -> float:
    return float(ca.DM(value))


def test_the_states_of_a_row_are_those_of_its_parts() -> None:
    ends = [name.rsplit(".", 1)[-1] for name in state_names()]
    assert ends == ["position", "speed", *["twist", "twist_rate"] * 3, "bristle"]


@pytest.mark.parametrize("seed", range(6))
def test_each_body_of_a_row_obeys_newton_and_outputs_are_what_they_say(seed: int) -> None:
    dice = Random(seed)
    t, q, v, tau, pushed, h, hr = (dice.uniform(-1, 1) for _ in range(7))
    v = 0.0 if seed == 0 else v
    twists = [(dice.uniform(-2e-3, 2e-3), dice.uniform(-0.1, 0.1)) for _ in range(3)]
    bristle = dice.uniform(-5e-4, 5e-4)
    values = [q, v, *(one for twist in twists for one in twist), bristle]
    inputs = {"tau": tau, "disturbance": pushed, "altitude": h, "altitude_rate": hr}
    found = evaluate(PLANT, t, **dict(zip(state_names(), values, strict=True)), **inputs)

    (mt, mr), (st, sr), (pt, pr) = twists
    J, friction = 2.0, math.tanh(v / 1e-3) + 3.0 * v
    axis_all = 0.6 * J
    passed = number(ROW["motor"].torque(mt, mr, axis_all))
    motor = (tau - passed) / (J - axis_all)
    far = axis_all * 0.36
    to_far = number(ROW["spring"].torque(st, sr, far))
    last = far * 0.3
    to_last = number(ROW["play"].torque(pt, pr, last))
    angle = 2 * q + 0.4
    near = (axis_all - far) * (1 + 0.3 * math.cos(angle)) + 0.5 * math.cos(h) ** 2
    by_q, by_h = -(axis_all - far) * 0.3 * 2 * math.sin(angle), -0.5 * math.sin(2 * h)
    push = passed - pushed - friction - 3.0 * (q - 0.2) - to_far - (by_q * v / 2 + by_h * hr) * v
    a = push / near
    far_a = (to_far - to_last) / (far - last)
    last_speed = v - sr - pr
    last_a = (to_last - 0.2 * bristle / 1e-3 - 0.4 * last_speed) / last
    rates = [v, a, mr, motor - a, sr, a - far_a, pr, far_a - last_a]
    rates.append(last_speed - abs(last_speed) * bristle / 1e-3)
    told = [found[f"der({name})"] for name in state_names()]
    np.testing.assert_allclose(told, rates, rtol=1e-9, atol=1e-9)

    def read(place: float) -> float:
        return place + 1e-3 * math.sin(8 * place + 0.3)

    ahead = 4e-3 + 1e-4 * t
    later = q + ahead * v + ahead**2 / 2 * a
    outputs = {"q": read(q), "v": v, "friction": friction, "applied": tau, "q_true": q, "q_recorded": read(later)}
    outputs |= {"q_load": q - st - pt, "q_motor": q + mt}
    for name, expected in outputs.items():
        assert found[name] == pytest.approx(expected, abs=1e-12), name


def at(model: Model, t: float, inputs: Any = ()) -> list[float]:
    parameters = [one.start for one in model.parameters]
    return [float(one) for one in model.equations(t, [], list(inputs), parameters)[1].full().ravel()]


@pytest.mark.parametrize("smooth", [0.0, 2.0])
def test_a_set_point_is_a_sine_that_starts_smoothly_with_its_exact_derivatives(smooth: float) -> None:
    numbers: dict[str, float] = {"frequency": 0.3, "amplitude": 1.7, "phase": 0.4, "smooth_start": smooth}
    model = Sine(name="s", **numbers).model()
    w = 2 * math.pi * 0.3
    for t in (0.01, 0.7, 1.3, 1.99, 2.01, 5.0):
        x = t / smooth if smooth and t < smooth else 1.0
        s = 10 * x**3 - 15 * x**4 + 6 * x**5
        ds, dds = (30 * x**2 - 60 * x**3 + 30 * x**4, 60 * x - 180 * x**2 + 120 * x**3) if x < 1 else (0.0, 0.0)
        ds, dds = (ds / smooth, dds / smooth**2) if smooth else (0.0, 0.0)
        sine, cosine = math.sin(w * t + 0.4), math.cos(w * t + 0.4)
        expected = [s * sine, ds * sine + s * w * cosine, dds * sine + 2 * ds * w * cosine - s * w**2 * sine]
        np.testing.assert_allclose(at(model, t), [1.7 * one for one in expected], rtol=1e-9, atol=1e-12)


def direction(azimuth: float, altitude: float) -> np.ndarray:
    flat = math.cos(altitude)
    return np.array([flat * math.sin(azimuth), flat * math.cos(azimuth), math.sin(altitude)])


@pytest.mark.parametrize("altitude", [-0.3, 0.2, 1.2])
@pytest.mark.parametrize("azimuth", [0.0, 2.9])
def test_a_pointing_error_is_the_angle_between_two_directions(azimuth: float, altitude: float) -> None:
    model = PointingError().model()
    for da, dh in product((-0.2, 1e-5, 0.4), (-0.1, 2e-5)):
        across, up, error = at(model, 0.0, [azimuth + da, altitude + dh, azimuth, altitude])
        one, other = direction(azimuth + da, altitude + dh), direction(azimuth, altitude)
        angle = 2 * math.asin(np.linalg.norm(one - other) / 2)
        assert error == pytest.approx(angle, rel=1e-9)
        assert up == pytest.approx(dh, rel=1e-9)
        same_height = direction(azimuth + da, altitude) - other
        assert abs(across) == pytest.approx(2 * math.asin(np.linalg.norm(same_height) / 2), rel=1e-9)
        assert math.copysign(1, across) == math.copysign(1, da)
    turned = at(model, 0.0, [azimuth + 2 * math.pi, altitude, azimuth, altitude])
    np.testing.assert_allclose(turned, 0.0, atol=1e-9)
    opposite = at(model, 0.0, [azimuth + math.pi, -altitude, azimuth, altitude])
    assert opposite[2] == pytest.approx(math.pi, abs=1e-7)
