"""The path of a star over an observer, in the angles of a mount with altitude over azimuth.

    north = cos(lat) sin(dec) - sin(lat) cos(dec) cos(H)
    east  = -cos(dec) sin(H)
    up    = sin(lat) sin(dec) + cos(lat) cos(dec) cos(H),      H = H0 + SIDEREAL_RATE t
    A = atan2(east, north),  h = atan2(up, hypot(north, east))

Azimuth counts from north through east and goes on past a whole turn where the star does. The geometric path: no
refraction (which lifts a star by 34 arcmin at the horizon and 1 arcmin at 45 deg), no aberration, nutation or
precession within the run.
Reference: Explanatory Supplement to the Astronomical Almanac, 3rd edition (2013), section 7.1.
"""

import numpy as np

from cosim.data.profile import Motion
from cosim.support.elementary import arctan2, sine, sine_and_cosine

SIDEREAL_RATE = 7.292115e-5
"""Speed of the stars in rad/s: a turn in a mean sidereal day of 86 164.1 s."""


def path(t: np.ndarray, latitude: float, declination: float, hour_angle: float) -> tuple[Motion, Motion]:
    """Return azimuth and altitude with their derivatives at t [s]; angles in rad, `hour_angle` at t = 0.

    Not defined where the star stands in the zenith itself.
    """
    hours = hour_angle + SIDEREAL_RATE * t
    north, east, up = _direction(hours, latitude, declination)
    reach = np.sqrt(north[0] * north[0] + east[0] * east[0])  # of a unit vector: nothing overflows
    return _azimuth(hours, north, east, reach, latitude, declination), _altitude(up, reach)


def _direction(hours: np.ndarray, latitude: float, declination: float) -> tuple[Motion, Motion, Motion]:
    """Return the unit vector to the star and its derivatives."""
    (s, c), (rise, flat), (lean, stand) = (sine_and_cosine(angle) for angle in (hours, declination, latitude))
    s, c, w = flat * s, flat * c, SIDEREAL_RATE
    north = (stand * rise - lean * c, lean * s * w, lean * c * w * w)
    east = (-s, -c * w, s * w * w)
    up = (lean * rise + stand * c, -stand * s * w, -stand * c * w * w)
    return north, east, up


def _azimuth(
    hours: np.ndarray, north: Motion, east: Motion, reach: np.ndarray, latitude: float, declination: float
) -> Motion:
    (x, dx, ddx), (y, dy, ddy) = north, east
    square = reach * reach
    rate = (x * dy - y * dx) / square
    bend = (x * ddy - y * ddx) / square - 2 * (x * dx + y * dy) / square * rate
    # The angle is measured from where the star culminates, north or south, so it cannot jump there; where it also
    # passes the opposite side it goes round, once a day, which is counted by the hour angle.
    culmination, antipode = sine(declination - latitude), sine(declination + latitude)
    side = 1.0 if culmination > 0 else -1.0
    start = 0.0 if side > 0 else np.pi
    turns = np.floor(hours / (2 * np.pi) + 0.5) if culmination * antipode < 0 else 0.0
    return start + arctan2(side * y, side * x) - side * 2 * np.pi * turns, rate, bend


def _altitude(up: Motion, reach: np.ndarray) -> Motion:
    z, dz, ddz = up
    rate = dz / reach
    return arctan2(z, reach), rate, ddz / reach + z * rate * rate / reach
