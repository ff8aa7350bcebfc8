"""From a direction of the mount to a place on the sky and back, where geometry alone puts the stars.

    sin(dec) = sin(lat) sin(h) + cos(lat) cos(h) cos(A)
    H = atan2(-sin(A) cos(h), cos(lat) sin(h) - sin(lat) cos(h) cos(A)),     right ascension = sidereal time - H

Azimuth A from north through east, altitude h, all in rad. No refraction, so `star` takes back exactly what this gives.
Reference: Meeus, Astronomical Algorithms, 2nd edition (1998), chapters 12 and 13.
"""

from datetime import UTC, datetime
from math import asin, atan2, cos, pi, radians, sin

import numpy as np

from cosim.data.star import path
from cosim_observatory.guide import Path

TURN = 2 * pi
_EPOCH = datetime(2000, 1, 1, 12, tzinfo=UTC)


def sidereal_time(when: datetime, longitude: float) -> float:
    """Mean sidereal time [rad] at a longitude [rad, east positive]; UTC is taken for UT1 (0.9 s at most)."""
    days = (when - _EPOCH).total_seconds() / 86400
    return (radians(280.46061837 + 360.98564736629 * days) + longitude) % TURN


def equatorial(azimuth: float, altitude: float, latitude: float) -> tuple[float, float]:
    """Hour angle and declination of a direction."""
    lean, stand, up, flat = sin(latitude), cos(latitude), sin(altitude), cos(altitude)
    declination = asin(max(-1.0, min(1.0, lean * up + stand * flat * cos(azimuth))))
    return atan2(-sin(azimuth) * flat, stand * up - lean * flat * cos(azimuth)), declination


def horizontal(hour_angle: float, declination: float, latitude: float) -> tuple[float, float]:
    """Azimuth (0 to 2 pi) and altitude of a place on the sky."""
    azimuth, altitude = equatorial(hour_angle, declination, latitude)  # the triangle is the same from either end
    return azimuth % TURN, altitude


def star_path(hour_angle: float, declination: float, latitude: float) -> Path:
    """Return where a star with this hour angle at t = 0 stands, as a path of the two axes."""
    return lambda t: np.array(path(t, latitude, declination, hour_angle))


def turned(found: Path, turns: int) -> Path:
    """Return a path with whole turns added to its azimuth."""

    def path_of(t: np.ndarray) -> np.ndarray:
        values = found(t)
        values[0, 0] += TURN * turns
        return values

    return path_of
