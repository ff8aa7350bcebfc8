"""Two axes on one sky: the star's path, what the axes do to each other, and where the mount then points."""

import warnings
from dataclasses import replace
from functools import partial
from math import atan2, cos, hypot, pi, sin
from pathlib import Path

import numpy as np
import pytest
from effect_examples import evaluate
from hypothesis import assume, given, settings
from hypothesis import strategies as some
from pydantic import ValidationError
from scipy.integrate import solve_ivp
from simulating import simulate
from tiny_fmu import tiny

import cosim.models.cache
from cosim.data.signals import Star
from cosim.data.star import SIDEREAL_RATE, path
from cosim.master.simulate import run
from cosim.support.errors import FmuError, ScenarioError
from cosim.system.scenario import parse_scenario, read_scenario
from pyfmi_models.card import read_card
from pyfmi_models.effects.alt_az import AltitudeInertia, AzimuthCentrifugal
from pyfmi_models.export import export_fmu
from pyfmi_models.friction.coulomb import Frictionless
from pyfmi_models.model import Model
from pyfmi_models.mount import Axis, Mount
from pyfmi_models.pointing import PointingError

__all__ = ["tiny"]

ARCSEC = pi / 648000
DAY = 2 * pi / SIDEREAL_RATE
TUBE, ZENITH_INERTIA, TUBE_INERTIA = 12.0, 24.0, 20.0
latitudes = some.floats(-89, 89)
declinations = some.floats(-89, 89)


# The star


def direction(azimuth: np.ndarray, altitude: np.ndarray) -> np.ndarray:
    """North, east, up."""
    return np.stack([np.cos(altitude) * np.cos(azimuth), np.cos(altitude) * np.sin(azimuth), np.sin(altitude)])


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


def test_stars_rise_in_the_east_culminate_and_set_in_the_west() -> None:
    hours = np.array([-6.0, 0.0, 6.0])
    found = [path(np.zeros(1), np.radians(49), 0.0, hour * pi / 12) for hour in hours]
    azimuths, altitudes = np.degrees([[motion[0][0] for motion in one] for one in found]).T
    np.testing.assert_allclose(azimuths, [90, 180, 270], atol=1e-9)
    np.testing.assert_allclose(altitudes, [0, 41, 0], atol=1e-9)
    assert found[1][1][1][0] == pytest.approx(0, abs=1e-18)  # at culmination the altitude stands still


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


@pytest.mark.parametrize("distance", [10.0, 1.0, 0.01])
def test_near_the_zenith_the_azimuth_rate_grows_as_one_over_the_distance(distance: float) -> None:
    (_, rate, _), _ = path(np.zeros(1), *np.radians([49.0, 49.0 - distance]), 0.0)
    declination, far = np.radians([49.0 - distance, distance])
    assert rate[0] == pytest.approx(SIDEREAL_RATE * cos(declination) / sin(far), rel=1e-9)


def test_a_star_through_the_zenith_is_refused() -> None:
    rule = "declination_deg = 49.0001 is the latitude: the star passes through the zenith, where there is no azimuth"
    with pytest.raises(ValidationError, match=rule):
        Star(kind="star", latitude_deg=49.0, declination_deg=49.0001)
    assert Star(kind="star", latitude_deg=49.0, declination_deg=49.0003).outputs["azimuth_velocity"] == "rad/s"


def test_the_path_is_that_of_astropy() -> None:
    """Its refraction off; the path of an hour differs by what aberration and precession do meanwhile, 0.03 arcsec."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        coordinates = pytest.importorskip("astropy.coordinates")
        from astropy import units
        from astropy.time import Time
        from astropy.utils import iers
    with iers.conf.set_temp("auto_download", False):
        times = Time("2015-06-01T00:00:00") + np.linspace(0, 3600, 5) * units.s
        star = coordinates.SkyCoord(ra=200 * units.deg, dec=45 * units.deg)
        site = coordinates.EarthLocation(lat=49 * units.deg, lon=0 * units.deg, height=0 * units.m)
        frame = {"obstime": times, "location": site, "pressure": 0 * units.hPa}
        seen = star.transform_to(coordinates.AltAz(**frame))
        hours = star.transform_to(coordinates.HADec(**frame))
        seconds = (times - times[0]).sec
    for t, start, allowed in ((np.zeros(1), slice(2, 3), 1e-6), (seconds, slice(0, 5), 0.05)):
        place = np.radians(49), hours.dec.rad[start][0], hours.ha.rad[start][0]
        (azimuth, *_), (altitude, *_) = path(t, *place)
        off = direction(azimuth, altitude) - direction(seen.az.rad[start], seen.alt.rad[start])
        assert np.linalg.norm(off, axis=0).max() < allowed * ARCSEC


# What the axes do to each other


def axes(friction: type[Frictionless] = Frictionless) -> tuple[Model, Model]:
    azimuth = Mount(
        name="azimuth",
        axis=Axis(inertia=ZENITH_INERTIA),
        friction=friction(),
        effects=(AltitudeInertia(tube_inertia=TUBE),),
    )
    altitude = Mount(
        name="altitude",
        axis=Axis(inertia=TUBE_INERTIA),
        friction=friction(),
        effects=(AzimuthCentrifugal(tube_inertia=TUBE),),
    )
    return azimuth.model(), altitude.model()


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


def test_turning_swings_the_tube_down_and_a_sinking_tube_slows_the_turning() -> None:
    slowing, sinking = accelerations(0.7, turning=0.5, swinging=-0.1, torques=(0.0, 0.0))
    assert sinking == pytest.approx(-TUBE * sin(1.4) * 0.5**2 / 2 / TUBE_INERTIA)
    assert slowing < 0


@pytest.fixture(scope="module")
def free(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Both axes without friction, as FMUs."""
    folder = tmp_path_factory.mktemp("axes")
    return {model.name: export_fmu(model, folder / f"{model.name}.fmu") for model in axes()}


def swing(free: dict[str, Path], step: float) -> np.ndarray:
    """Let both axes go for 2 s: altitude, azimuth rate and altitude rate at the end."""
    wires = [
        ("altitude_plant.q", "azimuth_plant.altitude"),
        ("altitude_plant.v", "azimuth_plant.altitude_rate"),
        ("azimuth_plant.v", "altitude_plant.azimuth_rate"),
    ]
    done = simulate(
        free,
        wires,
        record={"h": "altitude_plant.q", "v": "azimuth_plant.v", "w": "altitude_plant.v"},
        step=step,
        ticks=round(2 / step) + 1,
        parameters={"azimuth_plant": {"speed": 0.8}, "altitude_plant": {"position": 0.9, "speed": 0.5}},
    ).recording
    return np.array([done[name][-1] for name in "hvw"])


def test_two_fmus_swing_as_one_body_does_to_the_order_of_their_coupling(free: dict[str, Path]) -> None:
    def rates(_: float, state: np.ndarray) -> list[float]:
        h, v, w = state
        inertia = ZENITH_INERTIA + TUBE * cos(h) ** 2
        return [w, TUBE * sin(2 * h) * w * v / inertia, -TUBE * sin(2 * h) * v**2 / 2 / TUBE_INERTIA]

    exact = solve_ivp(rates, (0, 2), [0.9, 0.8, 0.5], rtol=1e-12, atol=1e-12).y[:, -1]
    assert energy(*exact) == pytest.approx(energy(0.9, 0.8, 0.5), rel=1e-10)
    errors = [np.abs(swing(free, step) - exact).max() for step in (4e-3, 2e-3, 1e-3)]
    assert errors[2] < 2e-4
    np.testing.assert_allclose([errors[0] / errors[1], errors[1] / errors[2]], 2, rtol=0.05)


# Where the mount points


def pointing(*angles: float) -> tuple[float, float, float]:
    names = ("azimuth_d", "altitude_d", "azimuth", "altitude")
    found = evaluate(PointingError().model(), **dict(zip(names, angles, strict=True)))
    return found["cross_elevation"], found["elevation"], found["error"]


@settings(deadline=None, max_examples=60)
@given(some.tuples(some.floats(-7, 7), some.floats(-1.5, 1.5)), some.tuples(some.floats(-7, 7), some.floats(-1.5, 1.5)))
def test_the_error_on_the_sky_is_the_angle_between_two_directions(
    wanted: tuple[float, float], real: tuple[float, float]
) -> None:
    one, other = direction(*map(np.array, wanted)), direction(*map(np.array, real))
    angle = atan2(float(np.linalg.norm(np.cross(one, other))), float(one @ other))
    assert pointing(*wanted, *real)[2] == pytest.approx(angle, abs=1e-7)


@pytest.mark.parametrize("turns", [0, 1, -3])
def test_azimuth_errors_shrink_with_the_cosine_of_the_altitude_and_whole_turns_do_not_count(turns: int) -> None:
    altitude, off = np.radians(80.0), np.array([3.0, -2.0]) * ARCSEC
    cross, up, whole = pointing(1.0 + off[0] + 2 * pi * turns, altitude + off[1], 1.0, altitude)
    assert abs(cross) == pytest.approx(cos(altitude) * off[0], rel=1e-6)
    assert up == pytest.approx(off[1], rel=1e-6)
    assert whole == pytest.approx(hypot(cross, up), rel=1e-5)


# The scenario


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


def test_the_shipped_scenario_keeps_the_star_within_four_arcsec_of_gusts(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cosim.models.cache, "_home", lambda: cache)
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


@pytest.mark.parametrize("name", ["altaz_azimuth", "altaz_altitude"])
def test_the_cards_of_the_two_axes_say_how_they_are_coupled(name: str) -> None:
    card = read_card(name)
    (effect,) = (one for one in card.effects if one.id in ("altitude_inertia", "azimuth_centrifugal"))
    assert effect.tube_inertia == TUBE  # type: ignore[attr-defined]
    assert card.mount.inertia == {"altaz_azimuth": ZENITH_INERTIA, "altaz_altitude": TUBE_INERTIA}[name]
    assert effect.statement().endswith(".")


# Start values from signals, models without a card

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


def test_a_component_has_one_source_and_a_model_that_exists() -> None:
    wrong = partial(TEXT.replace, 'fmu = "tiny3.fmu"')
    with pytest.raises(ScenarioError, match=r'components.one breaks a rule: give fmu = "...", or card ='):
        parse_scenario(wrong('fmu = "tiny3.fmu"\nmodel = "pointing_error"'), "x.toml", Path())
    with pytest.raises(ScenarioError, match=r"components.one.model = 'pointing' breaks a rule: input should be"):
        parse_scenario(wrong('model = "pointing"'), "x.toml", Path())
    with pytest.raises(ScenarioError, match='the component "one" has no FMU yet'):
        run(parse_scenario(wrong('model = "pointing_error"'), "x.toml", Path()))
