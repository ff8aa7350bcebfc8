"""Two axes on one sky: a star's path, what the axes do to each other, and where the mount then points."""

from dataclasses import replace
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from effect_examples import evaluate, mount
from hypothesis import assume, given, settings
from hypothesis import strategies as some
from pydantic import ValidationError

import cosim.models.cache
from cosim.data.signals import Star
from cosim.data.star import SIDEREAL_RATE, path
from cosim.master.simulate import run
from cosim.support.errors import FmuError
from cosim.system.scenario import parse_scenario, read_scenario
from pyfmi_models.effects.alt_az import AltitudeInertia, AzimuthCentrifugal
from pyfmi_models.friction.coulomb import Frictionless
from pyfmi_models.model import Model
from pyfmi_models.mount import Axis

ARCSEC = pi / 648000
TUBE, ZENITH_INERTIA, TUBE_INERTIA = 12.0, 24.0, 20.0


# The path of a star over the sky: rigid, smooth, once a day.


def direction(azimuth: np.ndarray, altitude: np.ndarray) -> np.ndarray:
    """North, east, up."""
    return np.stack([np.cos(altitude) * np.cos(azimuth), np.cos(altitude) * np.sin(azimuth), np.sin(altitude)])


DAY = 2 * pi / SIDEREAL_RATE
latitudes = some.floats(-89, 89)
declinations = some.floats(-89, 89)


def turned(axis: np.ndarray, angle: float, vector: np.ndarray) -> np.ndarray:
    """Rodrigues' rotation about a unit axis."""
    along = axis * (axis @ vector)
    return along + cos(angle) * (vector - along) + sin(angle) * np.cross(axis, vector)


@settings(deadline=None, max_examples=60)
@given(latitude=latitudes, declination=declinations, start=some.floats(-pi, pi), t=some.floats(0, 2 * DAY))
def test_a_star_turns_about_the_pole_as_a_rigid_body_does(
    latitude: float, declination: float, start: float, t: float
) -> None:
    assume(abs(latitude - declination) > 1e-3)
    la, de = np.radians([latitude, declination])
    pole = np.array([cos(la), 0.0, sin(la)])
    culminating = direction(np.array(0.0), la + (pi / 2 - de))  # on the meridian, its polar distance above the pole
    (azimuth, *_), (altitude, *_) = path(np.array([t]), la, de, start)
    # North, east, up is a left-handed frame: a positive turn in it goes from east over south to west.
    expected = turned(pole, start + SIDEREAL_RATE * t, culminating)
    np.testing.assert_allclose(direction(azimuth[0], altitude[0]), expected, atol=1e-9)


@settings(deadline=None, max_examples=60)
@given(latitude=latitudes, declination=declinations, start=some.floats(-30, 30))
def test_velocity_and_acceleration_are_the_derivatives_and_nothing_jumps(
    latitude: float, declination: float, start: float
) -> None:
    assume(min(abs(latitude - declination), abs(latitude + declination)) > 2)
    t = np.arange(0, 1.5 * DAY, 5.0)
    for position, velocity, acceleration in path(t, *np.radians([latitude, declination]), start):
        for whole, slope in ((position, velocity), (velocity, acceleration)):
            difference = (whole[2:] - whole[:-2]) / 10.0
            np.testing.assert_allclose(difference, slope[1:-1], atol=2e-3 * np.abs(slope).max() + 1e-14)


@pytest.mark.parametrize(("latitude", "declination", "turns"), [(49, 20, 1), (49, 60, 0), (-30, 10, -1), (-30, -60, 0)])
def test_azimuth_goes_round_once_a_day_unless_the_star_circles_beside_the_zenith(
    latitude: float, declination: float, turns: int
) -> None:
    (azimuth, *_), _ = path(np.array([0.0, DAY]), *np.radians([latitude, declination]), 0.3)
    assert azimuth[1] - azimuth[0] == pytest.approx(2 * pi * turns, abs=1e-9)


def test_a_star_through_the_zenith_is_refused() -> None:
    rule = "declination_deg = 49.0001 is the latitude: the star passes through the zenith, where there is no azimuth"
    with pytest.raises(ValidationError, match=rule):
        Star(kind="star", latitude_deg=49.0, declination_deg=49.0001)
    assert Star(kind="star", latitude_deg=49.0, declination_deg=49.0003).outputs["azimuth_velocity"] == "rad/s"


# What the axes do to each other


def axes() -> tuple[Model, Model]:
    """Azimuth and altitude, without friction."""
    parts = (
        (ZENITH_INERTIA, AltitudeInertia(tube_inertia=TUBE)),
        (TUBE_INERTIA, AzimuthCentrifugal(tube_inertia=TUBE)),
    )
    made = [mount(effect, axis=Axis(inertia=inertia), friction=Frictionless()).model() for inertia, effect in parts]
    return made[0], made[1]


def energy(altitude: np.ndarray, turning: np.ndarray, swinging: np.ndarray) -> np.ndarray:
    whole = ZENITH_INERTIA + TUBE * np.cos(altitude) ** 2
    return whole * turning**2 / 2 + TUBE_INERTIA * swinging**2 / 2


def accelerations(altitude: float, turning: float, swinging: float, torques: tuple[float, float]) -> tuple[float, ...]:
    azimuth, tube = axes()
    rates = {"speed": turning, "altitude": altitude, "altitude_rate": swinging, "tau": torques[0]}
    one = evaluate(azimuth, **rates)["der(speed)"]
    other = evaluate(tube, position=altitude, speed=swinging, azimuth_rate=turning, tau=torques[1])["der(speed)"]
    return one, other


@settings(deadline=None, max_examples=30)
@given(
    altitude=some.floats(-1.5, 1.5),
    speeds=some.tuples(some.floats(-2, 2), some.floats(-2, 2)),
    torques=some.tuples(some.floats(-9, 9), some.floats(-9, 9)),
)
def test_energy_changes_by_the_work_of_the_torques_alone(
    altitude: float, speeds: tuple[float, float], torques: tuple[float, float]
) -> None:
    turning, swinging = speeds
    found = accelerations(altitude, turning, swinging, torques)
    h = 1e-6
    ends = [energy(altitude + s * swinging, turning + s * found[0], swinging + s * found[1]) for s in (-h, h)]
    power = torques[0] * turning + torques[1] * swinging
    assert (ends[1] - ends[0]) / (2 * h) == pytest.approx(power, abs=1e-6)


# The scenario


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
    shrunk = cos(np.radians(86)) * (table["azimuth_q_d"] - table["azimuth_position"])
    np.testing.assert_allclose(table["cross_elevation"][1:][begun], shrunk[:-1][begun], atol=1e-3 * ARCSEC)
    error = table["sky_error"][begun] / ARCSEC
    assert 0.1 < np.sqrt(np.mean(error**2)) < 2
    assert error.max() < 4
    assert table["azimuth_position"][0] == table["azimuth_q_d"][0]
    assert table["azimuth_v"][0] == pytest.approx(SIDEREAL_RATE * cos(pi / 4) / sin(np.radians(4)), rel=1e-3)


# Start values from signals

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
