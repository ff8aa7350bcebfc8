"""A program of an observatory, here ASCOM's own Python client, points the simulated mount over Alpaca."""

from datetime import UTC, datetime
from math import degrees
from time import sleep
from typing import Any

import numpy as np
import pytest
from alpaca_mount import ARCSEC, server, telescope, until

from cosim_observatory.pointing import HORIZON
from cosim_observatory.sky import equatorial, horizontal, sidereal_time

__all__ = ["server", "telescope"]


def axis(number: int) -> Any:
    from alpaca.telescope import TelescopeAxes

    return TelescopeAxes(number)


def go(telescope: Any, azimuth: float, altitude: float) -> None:
    telescope.SlewToAltAzAsync(azimuth, altitude)
    assert telescope.Slewing
    until(lambda: not telescope.Slewing)
    sleep(0.1)


def test_a_slew_to_a_direction_ends_there(telescope: Any) -> None:
    go(telescope, 200.0, 60.0)
    assert telescope.Azimuth == pytest.approx(200.0, abs=10 * ARCSEC)
    assert telescope.Altitude == pytest.approx(60.0, abs=10 * ARCSEC)


def test_a_slew_to_a_star_ends_on_it_and_follows_it_at_the_sidereal_rate(telescope: Any) -> None:
    go(telescope, 150.0, 50.0)
    telescope.Tracking = True
    star = (telescope.SiderealTime + 1.0) % 24, 30.0
    telescope.SlewToCoordinatesAsync(*star)
    assert telescope.Slewing
    assert telescope.Tracking
    until(lambda: not telescope.Slewing)
    sleep(0.1)
    first, begun = telescope.Azimuth, telescope.SiderealTime
    for _ in range(3):
        assert telescope.RightAscension == pytest.approx(star[0], abs=20 * ARCSEC / 15)
        assert telescope.Declination == pytest.approx(star[1], abs=10 * ARCSEC)
        sleep(0.1)
    assert (telescope.TargetRightAscension, telescope.TargetDeclination) == star
    turned, passed = telescope.Azimuth - first, 15 * (telescope.SiderealTime - begun)
    assert turned > 0.5 * passed > 10 * ARCSEC


def test_tracking_from_rest_keeps_the_star_in_view_and_without_it_the_sky_moves_on(telescope: Any) -> None:
    go(telescope, 180.0, 45.0)
    before, begun = telescope.RightAscension, telescope.SiderealTime
    until(lambda: telescope.SiderealTime > begun + 4 / 3600)
    drift = telescope.RightAscension - before
    assert drift == pytest.approx(telescope.SiderealTime - begun, rel=0.2)
    telescope.Tracking = True
    until(lambda: not telescope.Slewing)
    sleep(0.1)
    before, begun = telescope.RightAscension, telescope.SiderealTime
    until(lambda: telescope.SiderealTime > begun + 4 / 3600)
    assert abs(telescope.RightAscension - before) < 5 * ARCSEC / 15


def test_an_abort_stops_a_slew_on_its_way_and_goes_on_tracking(telescope: Any) -> None:
    go(telescope, 180.0, 45.0)
    telescope.SlewToAltAzAsync(90.0, 45.0)
    until(lambda: telescope.Azimuth < 175)
    telescope.AbortSlew()
    until(lambda: not telescope.Slewing)
    stopped = telescope.Azimuth
    assert 95 < stopped < 176
    sleep(0.1)
    assert telescope.Azimuth == pytest.approx(stopped, abs=10 * ARCSEC)
    telescope.Tracking = True
    telescope.SlewToCoordinatesAsync(telescope.RightAscension, telescope.Declination - 10)
    telescope.AbortSlew()
    until(lambda: not telescope.Slewing)
    assert telescope.Tracking


def test_a_parked_mount_goes_home(telescope: Any) -> None:
    go(telescope, 170.0, 80.0)
    telescope.Park()
    until(lambda: telescope.AtPark)
    assert telescope.Altitude == pytest.approx(86.0, abs=0.1)
    telescope.Unpark()
    assert not telescope.AtPark
    assert not telescope.Tracking


def test_an_axis_moves_by_hand_until_its_rate_is_zero(telescope: Any) -> None:
    go(telescope, 180.0, 45.0)
    telescope.MoveAxis(axis(0), 1.5)
    until(lambda: telescope.Azimuth > 183.0)
    assert telescope.Slewing
    telescope.MoveAxis(axis(0), 0.0)
    until(lambda: not telescope.Slewing)
    assert 183.0 < telescope.Azimuth < 200.0
    assert telescope.Altitude == pytest.approx(45.0, abs=10 * ARCSEC)


def test_what_moves_down_by_hand_stops_above_the_horizon(telescope: Any) -> None:
    go(telescope, 180.0, 12.0)
    telescope.MoveAxis(axis(1), -2.0)
    until(lambda: not telescope.Slewing)
    assert -5 < telescope.Altitude - degrees(HORIZON) < 0.1
    go(telescope, 180.0, 45.0)


def test_directions_and_places_on_the_sky_are_each_others_inverse() -> None:
    random = np.random.default_rng(4)
    for _ in range(100):
        azimuth, altitude, latitude = random.uniform(0, 6.28), random.uniform(-1.5, 1.5), random.uniform(-1.5, 1.5)
        back = horizontal(*equatorial(azimuth, altitude, latitude), latitude)
        assert np.allclose(back, (azimuth, altitude), atol=1e-9)
    # The pole stands at the latitude; due east on the horizon lies the equator, six hours before it culminates.
    assert horizontal(1.0, np.pi / 2, 0.8)[1] == pytest.approx(0.8)
    assert np.allclose(equatorial(np.pi / 2, 0.0, 0.8), (-np.pi / 2, 0.0), atol=1e-9)


def test_sidereal_time_is_that_of_the_almanac() -> None:
    # Meeus, example 12.b: 10 April 1987, 19h21m00s UT at Greenwich: 8h34m57.0896s.
    found = sidereal_time(datetime(1987, 4, 10, 19, 21, tzinfo=UTC), 0.0)
    assert degrees(found) / 15 == pytest.approx(8 + 34 / 60 + 57.0896 / 3600, abs=0.001 / 3600 * 15)
