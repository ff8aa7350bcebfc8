"""Whole models against their equations: a plant with all in a row, corrections, set points, two axes on one sky."""

import math
from dataclasses import replace
from itertools import product
from pathlib import Path
from random import Random
from typing import Any

import casadi as ca
import numpy as np
import pytest
from effect_examples import FORM, INERTIA, evaluate, example, mount
from hypothesis import assume, given, settings
from hypothesis import strategies as some
from pydantic import ValidationError

import cosim.models.cache
from cosim.data.signals import Star
from cosim.data.star import SIDEREAL_RATE, path
from cosim.master.simulate import run
from cosim.support.errors import FmuError
from cosim.system.scenario import parse_scenario, read_scenario
from pyfmi_models.correction import correction
from pyfmi_models.effects import ActuatorLag, Cogging, GravityUnbalance, PeriodicFriction, TorqueOffset
from pyfmi_models.friction import Coulomb, Frictionless, LuGre
from pyfmi_models.model import Model
from pyfmi_models.mount import Axis
from pyfmi_models.pointing import PointingError
from pyfmi_models.setpoint import Sine

ROW: dict[str, Any] = {
    "motor": FORM["LoadSideCompliance"](resonance_hz=60.0, encoder_share=0.6),
    "spring": FORM["Compliance"](antiresonance_hz=20.0, resonance_hz=25.0),
    "play": FORM["Backlash"](gap_rad=1e-3, load_share=0.3, load_friction=0.2, load_viscous=0.4, load_deflection=1e-3),
    "varies": FORM["InertiaVariation"](relative_amplitude=0.3, cycles_per_rev=2.0, phase=0.4),
    "tube": FORM["AltitudeInertia"](tube_inertia=0.5),
    "cable": FORM["CableWrap"](stiffness=3.0, home=0.2),
    "encoder": FORM["EncoderEccentricity"](cycles_per_rev=8.0, amplitude_rad=1e-3, phase=0.3),
    "clock": FORM["ClockSkew"](offset_ms=4.0, drift_ppm=100.0),
}
PLANT = mount(*ROW.values(), friction=Coulomb(Fc=1.0, sigma2=3.0, smoothing=1e-3)).model()
"""An axis of 2 kg m2 with a motor in front of it, a spring and a play behind, and errors of encoder and clock."""


STATES = [one.name for one in PLANT.states]


def number(value: Any) -> float:
    return float(ca.DM(value))


@pytest.mark.parametrize("seed", range(6))
def test_each_body_of_a_row_obeys_newton_and_outputs_are_what_they_say(seed: int) -> None:
    ends = [name.rsplit(".", 1)[-1] for name in STATES]
    assert ends == ["position", "speed", *["twist", "twist_rate"] * 3, "bristle"]
    dice = Random(seed)
    t, q, v, tau, pushed, h, hr = (dice.uniform(-1, 1) for _ in range(7))
    v = 0.0 if seed == 0 else v
    twists = [(dice.uniform(-2e-3, 2e-3), dice.uniform(-0.1, 0.1)) for _ in range(3)]
    bristle = dice.uniform(-5e-4, 5e-4)
    values = [q, v, *(one for twist in twists for one in twist), bristle]
    inputs = {"tau": tau, "disturbance": pushed, "altitude": h, "altitude_rate": hr}
    found = evaluate(PLANT, t, **dict(zip(STATES, values, strict=True)), **inputs)

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
    told = [found[f"der({name})"] for name in STATES]
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


def direction(azimuth: Any, altitude: Any) -> Any:
    """North, east, up."""
    return np.stack([np.cos(altitude) * np.cos(azimuth), np.cos(altitude) * np.sin(azimuth), np.sin(altitude)])


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


# What an axis declares, and the limit of its drive.


@pytest.mark.parametrize("tau", [-9.0, -5.0, 3.0, 5.0, 50.0])
def test_the_drive_gives_no_more_than_its_limit(tau: float) -> None:
    found = evaluate(mount(axis=Axis(inertia=INERTIA, torque_limit=5.0)).model(), tau=tau)
    assert found["applied"] == np.clip(tau, -5, 5)
    assert found["der(speed)"] == pytest.approx(np.clip(tau, -5, 5) / INERTIA)


def test_a_repeated_effect_has_parameters_of_its_own() -> None:
    twice = (Cogging(cycles_per_rev=k, amplitude=1.0) for k in (4, 8, 12))
    names = {v.name: v.start for v in mount(*twice, TorqueOffset(torque=1)).parameters()}
    assert [names[f"{one}.cycles_per_rev"] for one in ("cogging", "cogging2", "cogging3")] == [4, 8, 12]
    assert names["torque_offset.torque"] == 1


def test_a_linear_axis_has_linear_units() -> None:
    law = LuGre(sigma0=9.23e4, sigma1=497.0, sigma2=32.77, Fc=2.322, Fs=3.322, Vs=0.04129)
    forms = ("GravityUnbalance", "Cogging", "RoughSpot", "WarmTorqueDroop", "BoucWen", "GearFriction")
    effects = [example(FORM[name]) for name in (*forms, "EncoderEccentricity")]
    model = mount(*effects, friction=law, motion="linear").model()
    units = {v.name: v.unit for part in (model.inputs, model.outputs, model.states, model.parameters) for v in part}
    expected = {
        **{"tau": "N", "disturbance": "N", "q": "m", "v": "m/s", "friction": "N", "applied": "N"},
        **{"position": "m", "speed": "m/s", "friction.bristle": "N", "axis.inertia": "kg", "axis.torque_limit": "N"},
        **{"friction.sigma0": "N/m", "friction.sigma1": "N.s/m", "friction.sigma2": "N.s/m"},
        **{"friction.Fc": "N", "friction.Fs": "N", "friction.Vs": "m/s", "friction.delta": "1"},
        **{"gravity_unbalance.mgl": "N", "gravity_unbalance.phase": "rad"},
        **{"cogging.cycles_per_rev": "1", "cogging.amplitude": "N", "cogging.phase": "rad"},
        **{"rough_spot.q_center": "m", "rough_spot.width": "m", "rough_spot.forward": "1"},
        **{"torque_droop.rated_torque": "N", "torque_droop.droop": "1", "torque_droop.per_degC": "1/K"},
        **{"bouc_wen.stroke": "m", "bouc_wen.torque": "N", "gear_friction.driving": "1", "gear_friction.driven": "1"},
        "encoder_eccentricity.amplitude_rad": "m",
    }
    assert {name: units[name] for name in expected} == expected
    rotary = {variable.name: variable.unit for variable in mount(*effects, friction=law).parameters()}
    assert rotary["axis.inertia"] == "kg.m2"
    assert rotary["friction.sigma0"] == "N.m/rad"


# The torque that makes a plant do what a better model of it does, at single points of its motion.

WEIGHT = GravityUnbalance(mgl=5.0, phase=0.1)
WAVE = PeriodicFriction(cycles_per_rev=3, relative_amplitude=0.2, phase=0.4)
RIPPLE = Cogging(cycles_per_rev=4, amplitude=0.7, phase=0.2)


@pytest.mark.parametrize("v", [0.2, -0.3])
@pytest.mark.parametrize("tau", [0.0, 4.0])
def test_the_plant_gets_what_the_better_one_needs_and_its_own_friction_back(v: float, tau: float) -> None:
    plant = mount()
    better = replace(mount(WEIGHT, WAVE), axis=Axis(inertia=3.0))
    model, q = correction(plant, better), 0.7
    (corrected,) = model.outputs
    assert (corrected.name, corrected.unit) == ("corrected", "N.m")
    found = evaluate(model, tau=tau, q=q, v=v)[corrected.name]
    own = np.sign(v) + 3 * v
    needed = np.sign(v) * (1 + 0.2 * np.cos(3 * q + 0.4)) + 3 * v + 5 * np.sin(q + 0.1)
    assert found == pytest.approx((tau - needed) * 2 / 3 + own, rel=1e-12)
    assert (found - own) / 2 == pytest.approx((tau - needed) / 3), "the acceleration of the better one"


def test_states_of_both_sides_follow_the_motion_of_the_plant() -> None:
    """Each side's bristles bend by its own law, each drive lags behind the command by its own time."""
    law = LuGre(sigma0=1e4, sigma1=20.0, sigma2=3.0, Fc=1.0, Fs=1.5, Vs=0.1)
    other = replace(law, sigma0=2e4, Fc=2.0, Fs=2.5)
    plant = mount(ActuatorLag(time_constant_ms=40.0), friction=law)
    better = mount(ActuatorLag(time_constant_ms=10.0), RIPPLE, friction=other)
    model = correction(plant, better)
    bent = {"before.friction.bristle": 0.3, "after.friction.bristle": -0.6}
    own_lag, lag = (one.name for one in model.states if "actuator_lag" in one.name)
    found = evaluate(model, tau=4.0, q=0.3, v=0.02, **bent, **{own_lag: 3.5, lag: 2.5})
    for name, one in (("before", law), ("after", other)):
        z = bent[f"{name}.friction.bristle"]
        assert found[f"der({name}.friction.bristle)"] == pytest.approx(float(one.rate(z, 0.02, one.level(0.02))))
    assert found[f"der({own_lag})"] == pytest.approx((4.0 - 3.5) / 40e-3)
    assert found[f"der({lag})"] == pytest.approx((4.0 - 2.5) / 10e-3)
    own, needed = (
        float(one.contact(z, 0.02, one.level(0.02)) + one.viscous(0.02)) for one, z in ((law, 0.3), (other, -0.6))
    )
    needed += float(RIPPLE.load(mount().at(0.0, 0.3, 0.02)))
    assert found["corrected"] == pytest.approx(2.5 - needed + own, rel=1e-12)


# Two axes on one sky: the path of a star, rigid, smooth, once a day.

ARCSEC = math.pi / 648000
TUBE, ZENITH_INERTIA, TUBE_INERTIA = 12.0, 24.0, 20.0
DAY = 2 * math.pi / SIDEREAL_RATE
latitudes = some.floats(-89, 89)
declinations = some.floats(-89, 89)


def turned(axis: np.ndarray, angle: float, vector: np.ndarray) -> np.ndarray:
    """Rodrigues' rotation about a unit axis."""
    along = axis * (axis @ vector)
    return along + math.cos(angle) * (vector - along) + math.sin(angle) * np.cross(axis, vector)


@settings(deadline=None, max_examples=60)
@given(latitude=latitudes, declination=declinations, start=some.floats(-math.pi, math.pi), t=some.floats(0, 2 * DAY))
def test_a_star_turns_rigidly_about_the_pole(latitude: float, declination: float, start: float, t: float) -> None:
    assume(abs(latitude - declination) > 1e-3)
    la, de = np.radians([latitude, declination])
    pole = np.array([math.cos(la), 0.0, math.sin(la)])
    highest = la + (math.pi / 2 - de)  # on the meridian, its polar distance above the pole
    culminating = direction(np.array(0.0), highest)
    (azimuth, *_), (altitude, *_) = path(np.array([t]), la, de, start)
    # North, east, up is a left-handed frame: a positive turn in it goes from east over south to west.
    expected = turned(pole, start + SIDEREAL_RATE * t, culminating)
    np.testing.assert_allclose(direction(azimuth[0], altitude[0]), expected, atol=1e-9)


@settings(deadline=None, max_examples=60)
@given(latitude=latitudes, declination=declinations, start=some.floats(-30, 30))
def test_its_velocity_and_acceleration_are_derivatives(latitude: float, declination: float, start: float) -> None:
    """And nothing jumps: azimuth goes round once a day unless the star circles beside the zenith."""
    assume(min(abs(latitude - declination), abs(latitude + declination)) > 2)
    t = np.arange(0, 1.5 * DAY, 5.0)
    for position, velocity, acceleration in path(t, *np.radians([latitude, declination]), start):
        for whole, slope in ((position, velocity), (velocity, acceleration)):
            difference = (whole[2:] - whole[:-2]) / 10.0
            np.testing.assert_allclose(difference, slope[1:-1], atol=2e-3 * np.abs(slope).max() + 1e-14)


def test_a_star_through_the_zenith_is_refused() -> None:
    rule = "declination_deg = 49.0001 is the latitude: the star passes through the zenith, where there is no azimuth"
    with pytest.raises(ValidationError, match=rule):
        Star(kind="star", latitude_deg=49.0, declination_deg=49.0001)
    assert Star(kind="star", latitude_deg=49.0, declination_deg=49.0003).outputs["azimuth_velocity"] == "rad/s"


# What the axes do to each other


def energy(altitude: float, turning: float, swinging: float) -> float:
    whole = ZENITH_INERTIA + TUBE * math.cos(altitude) ** 2
    return whole * turning**2 / 2 + TUBE_INERTIA * swinging**2 / 2


@settings(deadline=None, max_examples=30)
@given(
    altitude=some.floats(-1.5, 1.5),
    speeds=some.tuples(some.floats(-2, 2), some.floats(-2, 2)),
    torques=some.tuples(some.floats(-9, 9), some.floats(-9, 9)),
)
def test_energy_changes_by_the_work_of_the_torques_alone(altitude: float, speeds: Any, torques: Any) -> None:
    effects = FORM["AltitudeInertia"](tube_inertia=TUBE), FORM["AzimuthCentrifugal"](tube_inertia=TUBE)
    azimuth, tube = (
        mount(effect, axis=Axis(inertia=inertia), friction=Frictionless()).model()
        for effect, inertia in zip(effects, (ZENITH_INERTIA, TUBE_INERTIA), strict=True)
    )
    turning, swinging = speeds
    rates = {"speed": turning, "altitude": altitude, "altitude_rate": swinging, "tau": torques[0]}
    one = evaluate(azimuth, **rates)["der(speed)"]
    other = evaluate(tube, position=altitude, speed=swinging, azimuth_rate=turning, tau=torques[1])["der(speed)"]
    h = 1e-6
    ends = [energy(altitude + s * swinging, turning + s * one, swinging + s * other) for s in (-h, h)]
    power = torques[0] * turning + torques[1] * swinging
    assert (ends[1] - ends[0]) / (2 * h) == pytest.approx(power, abs=1e-6)


# Scenarios


def test_the_shipped_scenario_keeps_the_star_within_four_arcsec_of_gusts(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr(cosim.models.cache, "_home", lambda: tmp_path)
    scenario = replace(cosim.models.cache.with_fmus(read_scenario("two_axis")), ticks=50_000, decimation=1)
    done = run(scenario)
    table, begun = done.recording, slice(10_000, None)
    assert done.statistics["unconnected"] == []
    # The sky sees the angles of the tick before: the same formula on the recorded ones, one row apart.
    wanted, real = (direction(table[f"azimuth_{of}"], table[f"altitude_{of}"]) for of in ("q_d", "position"))
    apart = np.linalg.norm(wanted - real, axis=0)
    np.testing.assert_allclose(table["sky_error"][1:], apart[:-1], atol=1e-4 * ARCSEC)
    shrunk = math.cos(np.radians(86)) * (table["azimuth_q_d"] - table["azimuth_position"])
    np.testing.assert_allclose(table["cross_elevation"][1:][begun], shrunk[:-1][begun], atol=1e-3 * ARCSEC)
    error = table["sky_error"][begun] / ARCSEC
    assert 0.1 < np.sqrt(np.mean(error**2)) < 2
    assert error.max() < 4
    assert table["azimuth_position"][0] == table["azimuth_q_d"][0]
    fast = math.cos(math.pi / 4) / math.sin(np.radians(4))
    assert table["azimuth_v"][0] == pytest.approx(SIDEREAL_RATE * fast, rel=1e-3)


TEXT = """
step = 0.1
stop = 1.0
[components.one]
fmu = "tiny3.fmu"
parameters = { k = "r.velocity", mode = 2.0 }
[signals.r]
kind = "ramp"
start = 5.0
velocity = 0.25
[[connections]]
from = "r.position"
to = "one.a"
[record]
signals = { y = "one.y" }
"""


def test_a_component_may_start_at_the_value_of_a_signal(tiny: dict[int, Path]) -> None:
    done = run(parse_scenario(TEXT, "start.toml", tiny[3].parent)).recording
    assert done.origin["components"]["one"]["parameters"] == {"k": 0.25, "mode": 2.0}
    np.testing.assert_allclose(done["y"][2], 0.25 * 5.025)  # k a, seen a tick later
    with pytest.raises(FmuError, match=r'"one.k" is "r.speed"; it must be a number, or an output of a signal'):
        run(parse_scenario(TEXT.replace("r.velocity", "r.speed"), "start.toml", tiny[3].parent))
