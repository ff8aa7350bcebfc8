"""What a telescope does with its mount: track, slew, park, stop, move an axis by hand; angles in rad.

States exclude each other: parked, or on its way to it, or free; free, it tracks the stars or rests, and slews or not. A
command that the state forbids is a `DeviceError` with the number that ASCOM has for the reason.
"""

from datetime import UTC, datetime, timedelta
from math import degrees, radians
from threading import RLock

import numpy as np

from cosim.data.star import SIDEREAL_RATE
from cosim.support.errors import CosimError
from cosim_observatory.guide import Path, steady, still
from cosim_observatory.mount import SimulatedMount
from cosim_observatory.sky import TURN, equatorial, horizontal, sidereal_time, star_path, turned

NOT_IMPLEMENTED, INVALID_VALUE, VALUE_NOT_SET, NOT_CONNECTED = 0x400, 0x401, 0x402, 0x407
WHILE_PARKED, INVALID_OPERATION, ACTION_NOT_IMPLEMENTED, DRIVER_ERROR = 0x408, 0x40B, 0x40C, 0x500
HORIZON, ZENITH = radians(5.0), radians(89.5)
"""Lowest and highest altitude to go to or to follow a star to; higher, the azimuth turns too fast."""


class DeviceError(CosimError):
    """A request that the telescope refuses, with the number that the standard has for the reason."""

    def __init__(self, number: int, message: str) -> None:
        super().__init__(message)
        self.number = number


class Pointing:
    """See the module; `longitude` [rad] and `begun` (UTC at the simulation's start) say which stars are up."""

    def __init__(self, mount: SimulatedMount, longitude: float = 0.0, begun: datetime | None = None) -> None:
        self._mount, self.longitude = mount, longitude
        self.latitude = radians(mount.star.latitude_deg)
        self.lock = RLock()
        self.parked, self.parking, self.tracking, self.slewing = True, False, False, False
        self.rates = np.zeros(2)
        self._begun = begun or datetime.now(UTC)
        self._sidereal = sidereal_time(self._begun, longitude)
        self._home = mount.angles

    @property
    def utc(self) -> datetime:
        """UTC of the simulation."""
        return self._begun + timedelta(seconds=self._mount.time)

    @property
    def sidereal_time(self) -> float:
        """Local sidereal time."""
        return (self._sidereal + SIDEREAL_RATE * self._mount.time) % TURN

    @property
    def angles(self) -> tuple[float, float]:
        """Azimuth and altitude, as the encoders show them."""
        return self._mount.angles

    @property
    def place(self) -> tuple[float, float]:
        """Right ascension and declination where the encoders point."""
        hour_angle, declination = equatorial(*self.angles, self.latitude)
        return (self.sidereal_time - hour_angle) % TURN, declination

    def watch(self) -> None:
        """Notice what has happened meanwhile: an arrival, an altitude out of range, a simulation that failed."""
        if self._mount.failure:
            raise DeviceError(DRIVER_ERROR, f"The simulation has ended: {self._mount.failure}")
        if self.slewing and not self._mount.moving and not self.rates.any():
            self.slewing = False
            self.parked, self.parking = self.parked or self.parking, False
        if not HORIZON <= self._mount.set_point[2] <= ZENITH and (
            self.rates.any() or (self.tracking and not self.slewing)
        ):
            self.tracking = False
            self._leave()

    def track(self, wanted: bool) -> None:
        """Follow the stars from where it is, or rest."""
        self._refuse_parked()
        if wanted and not self.tracking:
            self._stay()
        elif self.tracking and not wanted:
            self._mount.stop()
        self.tracking = wanted

    def slew_to_star(self, right_ascension: float, declination: float) -> None:
        """Go to a star and follow it; it must be tracking."""
        self._refuse_parked()
        if not self.tracking:
            raise DeviceError(INVALID_OPERATION, "Tracking must be on to slew to right ascension and declination.")
        _check_up(horizontal(self.sidereal_time - right_ascension, declination, self.latitude)[1])
        self._follow_star(right_ascension, declination)
        self.slewing = True

    def slew_to(self, azimuth: float, altitude: float) -> None:
        """Go to a direction and stay there; it must not be tracking."""
        self._refuse_parked()
        if self.tracking:
            raise DeviceError(INVALID_OPERATION, "Tracking must be off to slew to azimuth and altitude.")
        _check_up(altitude)
        self._go((azimuth, altitude))

    def abort(self) -> None:
        """Stop; what was tracked before a slew is tracked again, from where it is."""
        self._refuse_parked()
        self.watch()
        if self.slewing:
            self._leave()

    def park(self) -> None:
        """Go to where it began and stay there until `unpark`."""
        self.watch()
        if not self.parked and not self.parking:
            self.tracking, self.parking = False, True
            self.rates[:] = 0
            self._go(self._home)

    def unpark(self) -> None:
        """Be ready to move; tracking stays off."""
        self.watch()
        if self.parking:
            raise DeviceError(INVALID_OPERATION, "The mount is on its way to its parking position.")
        self.parked = False

    def move(self, axis: int, rate: float) -> None:
        """Move an axis by hand until its rate is 0 again; then what was tracked before is tracked from there."""
        self._refuse_parked()
        self.rates[axis] = rate
        if self.rates.any():
            since, *position = self._mount.set_point
            self._follow(steady(np.array(position), self.rates.copy(), since))
            self.slewing = True
        else:
            self._leave()

    def _refuse_parked(self) -> None:
        self.watch()
        if self.parked or self.parking:
            raise DeviceError(WHILE_PARKED, "The mount is parked; unpark it first.")

    def _leave(self) -> None:
        """Come to rest, or back to the stars."""
        self.rates[:] = 0
        if self.tracking:
            self._stay()
        else:
            self._mount.stop()
        self.slewing = True

    def _stay(self) -> None:
        """Follow the stars from where the set point is."""
        since, azimuth, altitude = self._mount.set_point
        hour_angle, declination = equatorial(azimuth, altitude, self.latitude)
        self._follow_star(self._sidereal + SIDEREAL_RATE * since - hour_angle, declination)

    def _follow_star(self, right_ascension: float, declination: float) -> None:
        self._follow(star_path(self._sidereal - right_ascension, declination, self.latitude))

    def _go(self, to: tuple[float, float]) -> None:
        self._follow(still(np.array(to)))
        self.slewing = True

    def _follow(self, path: Path) -> None:
        """Join a path, the azimuth by the shorter way."""
        since, azimuth, _ = self._mount.set_point
        apart = azimuth - path(np.array([since]))[0, 0, 0]
        self._mount.follow(turned(path, round(apart / TURN)))


def _check_up(altitude: float) -> None:
    if not HORIZON <= altitude <= ZENITH:
        low, high, now = (degrees(one) for one in (HORIZON, ZENITH, altitude))
        raise DeviceError(INVALID_OPERATION, f"Altitude {now:.3f} deg is outside {low:g} to {high:g} deg.")
