"""A star's path over the sky: rigid, smooth, once a day, and that of astropy."""

import warnings
from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as some
from pydantic import ValidationError
from test_two_axis import ARCSEC, direction

from cosim.data.signals import Star
from cosim.data.star import SIDEREAL_RATE, path

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
