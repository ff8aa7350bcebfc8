"""A telescope as the ASCOM standard means it (ITelescopeV4), over a simulated mount with altitude over azimuth.

Public properties and methods are the members of the standard, in our spelling: `right_ascension` is RightAscension.
Units are those of the standard: hours of right ascension, degrees, degrees a second. A member that is not here is not
implemented, which the standard allows where a `can_...` says so or for what such a mount does not have.
Reference: ASCOM Initiative, ITelescopeV4 (Platform 7).
"""

from datetime import UTC, datetime, timedelta
from math import degrees, pi, radians
from typing import Any

import numpy as np

import cosim
from cosim.errors import CosimError
from cosim.star import SIDEREAL_RATE
from cosim.supervisor.guide import Path, steady, still
from cosim.supervisor.mount import SimulatedMount
from cosim.supervisor.sky import TURN, equatorial, horizontal, sidereal_time, star_path, turned

NOT_IMPLEMENTED, INVALID_VALUE, VALUE_NOT_SET, NOT_CONNECTED = 0x400, 0x401, 0x402, 0x407
WHILE_PARKED, INVALID_OPERATION, ACTION_NOT_IMPLEMENTED, DRIVER_ERROR = 0x408, 0x40B, 0x40C, 0x500
HORIZON = radians(5.0)
"""Lowest altitude to go to or to follow a star to."""
ZENITH = radians(89.5)
"""Highest altitude to go to: above, the azimuth of a star turns too fast."""
HOURS, SIDEREAL, TOPOCENTRIC, ALT_AZ = 12 / pi, 0, 1, 0
RATE = 2.0
"""Fastest rate of an axis moved by hand [deg/s]."""


class DeviceError(CosimError):
    """A request that the telescope refuses, with the number that the standard has for the reason."""

    def __init__(self, number: int, message: str) -> None:
        super().__init__(message)
        self.number = number


class Telescope:
    """See the module; `longitude` [rad] and `begun` (UTC at the simulation's start) say which stars are up."""

    def __init__(self, mount: SimulatedMount, longitude: float = 0.0, begun: datetime | None = None) -> None:
        self._mount = mount
        self._begun = begun or datetime.now(UTC)
        self._latitude, self._longitude = radians(mount.star.latitude_deg), longitude
        self._sidereal = sidereal_time(self._begun, longitude)
        self._home = mount.angles
        self._connected = self._tracking = self._parking = False
        self._parked, self._slewing = True, False
        self._rates = np.zeros(2)
        self._target: dict[str, float] = {}

    # What it is.

    name = "mount-cosim simulated mount"
    description = "A mount with altitude over azimuth, simulated with its friction and its controllers"
    driver_info = "mount-cosim: ASCOM Alpaca over the co-simulation of a mount; no motor is behind it"
    driver_version = cosim.__version__
    interface_version = 4
    supported_actions: tuple[str, ...] = ()
    alignment_mode, equatorial_system, does_refraction = ALT_AZ, TOPOCENTRIC, False
    can_slew_async = can_slew_alt_az_async = can_park = can_unpark = can_set_tracking = True
    can_slew = can_slew_alt_az = can_sync = can_sync_alt_az = can_find_home = can_pulse_guide = False
    can_set_park = can_set_guide_rates = can_set_pier_side = False
    can_set_right_ascension_rate = can_set_declination_rate = False
    right_ascension_rate = declination_rate = 0.0
    tracking_rates = (SIDEREAL,)
    at_home = connecting = False
    site_elevation = 0.0

    # Connection.

    @property
    def connected(self) -> bool:
        """Whether a client has connected."""
        return self._connected

    @connected.setter
    def connected(self, wanted: bool) -> None:
        self._connected = wanted

    def connect(self) -> None:
        """Connect; done at once."""
        self._connected = True

    def disconnect(self) -> None:
        """Disconnect; the mount goes on with what it does."""
        self._connected = False

    @property
    def device_state(self) -> list[dict[str, Any]]:
        """What changes, in one answer."""
        names = {
            "Altitude": "altitude", "AtHome": "at_home", "AtPark": "at_park", "Azimuth": "azimuth",
            "Declination": "declination", "RightAscension": "right_ascension", "SiderealTime": "sidereal_time",
            "Slewing": "slewing", "Tracking": "tracking", "UTCDate": "utc_date",
        }  # fmt: skip
        found = [{"Name": name, "Value": getattr(self, attribute)} for name, attribute in names.items()]
        return [*found, {"Name": "TimeStamp", "Value": self.utc_date}]

    # Where it is.

    @property
    def azimuth(self) -> float:
        """Azimuth [deg] from north through east, 0 to 360."""
        return degrees(self._mount.angles[0]) % 360.0

    @property
    def altitude(self) -> float:
        """Altitude [deg]."""
        return degrees(self._mount.angles[1])

    @property
    def right_ascension(self) -> float:
        """Right ascension [h] of where the encoders point."""
        return self._hours(self._sky()[0])

    @property
    def declination(self) -> float:
        """Declination [deg] of where the encoders point."""
        return degrees(self._sky()[1])

    @property
    def sidereal_time(self) -> float:
        """Local sidereal time [h]."""
        return self._hours(0.0)

    @property
    def utc_date(self) -> str:
        """UTC of the simulation."""
        now = self._begun + timedelta(seconds=self._mount.time)
        return now.isoformat(timespec="milliseconds").replace("+00:00", "Z")

    @property
    def site_latitude(self) -> float:
        """Latitude [deg]."""
        return degrees(self._latitude)

    @property
    def site_longitude(self) -> float:
        """Longitude [deg], east positive."""
        return degrees(self._longitude)

    # What it does.

    @property
    def at_park(self) -> bool:
        """Whether it is parked."""
        self.watch()
        return self._parked

    @property
    def slewing(self) -> bool:
        """Whether it is on its way, or an axis is moved by hand."""
        self.watch()
        return self._slewing

    @property
    def tracking(self) -> bool:
        """Whether it follows the stars, or will after the slew."""
        self.watch()
        return self._tracking

    @tracking.setter
    def tracking(self, wanted: bool) -> None:
        self._refuse_parked()
        if wanted and not self.tracking:
            self._stay()
        elif self.tracking and not wanted:
            self._mount.stop()
        self._tracking = wanted

    @property
    def tracking_rate(self) -> int:
        """The stars' rate; there is no other."""
        return SIDEREAL

    @tracking_rate.setter
    def tracking_rate(self, wanted: int) -> None:
        if wanted != SIDEREAL:
            raise DeviceError(INVALID_VALUE, f"TrackingRate {wanted} is not offered; there is only 0, sidereal.")

    @property
    def target_right_ascension(self) -> float:
        """Right ascension [h] to slew to."""
        return self._stated("TargetRightAscension")

    @target_right_ascension.setter
    def target_right_ascension(self, wanted: float) -> None:
        self._target["TargetRightAscension"] = _within("TargetRightAscension", wanted, 0.0, 24.0)

    @property
    def target_declination(self) -> float:
        """Declination [deg] to slew to."""
        return self._stated("TargetDeclination")

    @target_declination.setter
    def target_declination(self, wanted: float) -> None:
        self._target["TargetDeclination"] = _within("TargetDeclination", wanted, -90.0, 90.0)

    def slew_to_coordinates_async(self, right_ascension: float, declination: float) -> None:
        """Go to a star and follow it; returns at once."""
        self._refuse_parked()
        if not self.tracking:
            raise DeviceError(INVALID_OPERATION, "Tracking must be on to slew to right ascension and declination.")
        self.target_right_ascension, self.target_declination = right_ascension, declination
        star = right_ascension / HOURS, radians(declination)
        self._check_up(horizontal(self._now() - star[0], star[1], self._latitude)[1])
        self._track(*star)
        self._slewing = True

    def slew_to_target_async(self) -> None:
        """Go to the target and follow it."""
        self.slew_to_coordinates_async(self.target_right_ascension, self.target_declination)

    def slew_to_alt_az_async(self, azimuth: float, altitude: float) -> None:
        """Go to a direction and stay there; returns at once."""
        self._refuse_parked()
        if self.tracking:
            raise DeviceError(INVALID_OPERATION, "Tracking must be off to slew to azimuth and altitude.")
        to = radians(_within("Azimuth", azimuth, 0.0, 360.0)), radians(_within("Altitude", altitude, -90.0, 90.0))
        self._check_up(to[1])
        self._go(to)

    def abort_slew(self) -> None:
        """Stop; what was tracked before a slew is tracked again, from where it is."""
        self._refuse_parked()
        if self.slewing:
            self._leave()

    def park(self) -> None:
        """Go to the parking position and stay there until `unpark`; returns at once."""
        if not self.at_park and not self._parking:
            self._tracking, self._parking = False, True
            self._go(self._home)

    def unpark(self) -> None:
        """Be ready to move; tracking stays off."""
        self.watch()
        if self._parking:
            raise DeviceError(INVALID_OPERATION, "The mount is on its way to its parking position.")
        self._parked = False

    def axis_rates(self, axis: int) -> list[dict[str, float]]:
        """Rates [deg/s] at which an axis (0: azimuth, 1: altitude) can be moved by hand."""
        return [{"Minimum": 0.0, "Maximum": RATE}] if self.can_move_axis(axis) else []

    def can_move_axis(self, axis: int) -> bool:
        """Whether there is such an axis."""
        return int(_within("Axis", axis, 0, 2)) < 2

    def move_axis(self, axis: int, rate: float) -> None:
        """Move an axis by hand until its rate is 0 again; then what was tracked before is tracked from there."""
        self._refuse_parked()
        if not self.can_move_axis(axis):
            raise DeviceError(INVALID_VALUE, "Axis 2 is not there; there are 0, azimuth, and 1, altitude.")
        self._rates[axis] = radians(_within("Rate", rate, -RATE, RATE))
        if self._rates.any():
            since, *position = self._mount.set_point
            self._follow(steady(np.array(position), self._rates.copy(), since))
            self._slewing = True
        else:
            self._leave()

    def action(self, action: str, parameters: str) -> str:
        """Do something of our own: there is nothing."""
        raise DeviceError(ACTION_NOT_IMPLEMENTED, f'Action "{action}" is not offered; there are none.')

    def watch(self) -> None:
        """Notice what has happened meanwhile: an arrival, a star that sets, a simulation that failed."""
        if self._mount.failure:
            raise DeviceError(DRIVER_ERROR, f"The simulation has ended: {self._mount.failure}")
        if self._slewing and not self._mount.moving and not self._rates.any():
            self._slewing = False
            self._parked, self._parking = self._parked or self._parking, False
        altitude = self._mount.set_point[2]
        out = altitude < HORIZON or altitude > ZENITH
        if out and (self._rates.any() or (self._tracking and not self._slewing)):
            self._tracking = False
            self._leave()

    # How.

    def _now(self) -> float:
        return self._sidereal + SIDEREAL_RATE * self._mount.time

    def _hours(self, hour_angle: float) -> float:
        return (self._now() - hour_angle) % TURN * HOURS

    def _sky(self) -> tuple[float, float]:
        return equatorial(*self._mount.angles, self._latitude)

    def _track(self, right_ascension: float, declination: float) -> None:
        """Follow a star [rad], the azimuth by the shorter way."""
        self._follow(star_path(self._sidereal - right_ascension, declination, self._latitude))

    def _stay(self) -> None:
        """Follow the stars from where the set point is."""
        since, azimuth, altitude = self._mount.set_point
        hour_angle, declination = equatorial(azimuth, altitude, self._latitude)
        self._track(self._sidereal + SIDEREAL_RATE * since - hour_angle, declination)

    def _go(self, to: tuple[float, float]) -> None:
        self._follow(still(np.array(to)))
        self._slewing = True

    def _follow(self, path: Path) -> None:
        since, azimuth, _ = self._mount.set_point
        apart = azimuth - path(np.array([since]))[0, 0, 0]
        self._mount.follow(turned(path, round(apart / TURN)))

    def _leave(self) -> None:
        """Come to rest, or back to the stars."""
        self._rates[:] = 0
        self._parking = False
        if self._tracking:
            self._stay()
        else:
            self._mount.stop()
        self._slewing = True

    def _stated(self, name: str) -> float:
        if name not in self._target:
            raise DeviceError(VALUE_NOT_SET, f"{name} has not been set.")
        return self._target[name]

    def _refuse_parked(self) -> None:
        if self.at_park or self._parking:
            raise DeviceError(WHILE_PARKED, "The mount is parked; unpark it first.")

    def _check_up(self, altitude: float) -> None:
        if not HORIZON <= altitude <= ZENITH:
            low, high, now = (degrees(one) for one in (HORIZON, ZENITH, altitude))
            raise DeviceError(INVALID_OPERATION, f"Altitude {now:.3f} deg is outside {low:g} to {high:g} deg.")


def _within(name: str, value: float, low: float, high: float) -> float:
    if not low <= value <= high:
        raise DeviceError(INVALID_VALUE, f"{name} {value:g} is outside {low:g} to {high:g}.")
    return value
