"""A telescope as the ASCOM standard means it (ITelescopeV4), over a simulated mount with altitude over azimuth.

Public properties and methods are the members of the standard, in our spelling: `right_ascension` is RightAscension.
Units are those of the standard: hours of right ascension, degrees, degrees a second. A member that is not here is not
implemented, which the standard allows where a `can_...` says so or for what such a mount does not have.
Reference: ASCOM Initiative, ITelescopeV4 (Platform 7).
"""

from math import degrees, radians

from cosim.support.plain import JsonObject
from cosim.support.version import __version__
from cosim_observatory.pointing import (
    ACTION_NOT_IMPLEMENTED,
    INVALID_VALUE,
    VALUE_NOT_SET,
    DeviceError,
    Pointing,
)
from cosim_observatory.sky import TURN

HOURS, SIDEREAL, TOPOCENTRIC, ALT_AZ = 24 / TURN, 0, 1, 0
RATE = 2.0
"""Fastest rate of an axis moved by hand [deg/s]."""


class Telescope:
    """See the module; `pointing` is what it speaks for."""

    def __init__(self, pointing: Pointing) -> None:
        self.pointing = pointing
        self._connected = False
        self._target: dict[str, float] = {}

    # What it is.

    name = "mount-cosim simulated mount"
    description = "A mount with altitude over azimuth, simulated with its friction and its controllers"
    driver_info = "mount-cosim: ASCOM Alpaca over the co-simulation of a mount; no motor is behind it"
    driver_version = __version__
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
    def device_state(self) -> list[JsonObject]:
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
        return degrees(self.pointing.angles[0]) % 360.0

    @property
    def altitude(self) -> float:
        """Altitude [deg]."""
        return degrees(self.pointing.angles[1])

    @property
    def right_ascension(self) -> float:
        """Right ascension [h] of where the encoders point."""
        return _hours(self.pointing.place[0])

    @property
    def declination(self) -> float:
        """Declination [deg] of where the encoders point."""
        return degrees(self.pointing.place[1])

    @property
    def sidereal_time(self) -> float:
        """Local sidereal time [h]."""
        return _hours(self.pointing.sidereal_time)

    @property
    def utc_date(self) -> str:
        """UTC of the simulation."""
        return self.pointing.utc.isoformat(timespec="milliseconds").replace("+00:00", "Z")

    @property
    def site_latitude(self) -> float:
        """Latitude [deg]."""
        return degrees(self.pointing.latitude)

    @property
    def site_longitude(self) -> float:
        """Longitude [deg], east positive."""
        return degrees(self.pointing.longitude)

    # What it does.

    @property
    def at_park(self) -> bool:
        """Whether it is parked."""
        self.pointing.watch()
        return self.pointing.parked

    @property
    def slewing(self) -> bool:
        """Whether it is on its way, or an axis is moved by hand."""
        self.pointing.watch()
        return self.pointing.slewing

    @property
    def tracking(self) -> bool:
        """Whether it follows the stars, or will after the slew."""
        self.pointing.watch()
        return self.pointing.tracking

    @tracking.setter
    def tracking(self, wanted: bool) -> None:
        self.pointing.track(wanted)

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
        self._target["TargetRightAscension"] = _within("TargetRightAscension", wanted, 0.0, 24.0) % 24.0

    @property
    def target_declination(self) -> float:
        """Declination [deg] to slew to."""
        return self._stated("TargetDeclination")

    @target_declination.setter
    def target_declination(self, wanted: float) -> None:
        self._target["TargetDeclination"] = _within("TargetDeclination", wanted, -90.0, 90.0)

    def slew_to_coordinates_async(self, right_ascension: float, declination: float) -> None:
        """Go to a star and follow it; returns at once."""
        star = {
            "TargetRightAscension": _within("TargetRightAscension", right_ascension, 0.0, 24.0) % 24.0,
            "TargetDeclination": _within("TargetDeclination", declination, -90.0, 90.0),
        }
        self.pointing.slew_to_star(right_ascension / HOURS, radians(declination))
        self._target = star  # a slew that is refused sets nothing

    def slew_to_target_async(self) -> None:
        """Go to the target and follow it; returns at once."""
        self.pointing.slew_to_star(self.target_right_ascension / HOURS, radians(self.target_declination))

    def slew_to_alt_az_async(self, azimuth: float, altitude: float) -> None:
        """Go to a direction and stay there; returns at once."""
        to = _within("Azimuth", azimuth, 0.0, 360.0), _within("Altitude", altitude, -90.0, 90.0)
        self.pointing.slew_to(radians(to[0]), radians(to[1]))

    def abort_slew(self) -> None:
        """Stop; what was tracked before a slew is tracked again, from where it is."""
        self.pointing.abort()

    def park(self) -> None:
        """Go to the parking position and stay there until `unpark`; returns at once."""
        self.pointing.park()

    def unpark(self) -> None:
        """Be ready to move; tracking stays off."""
        self.pointing.unpark()

    def axis_rates(self, axis: int) -> list[dict[str, float]]:
        """Rates [deg/s] at which an axis (0: azimuth, 1: altitude) can be moved by hand."""
        return [{"Minimum": 0.0, "Maximum": RATE}] if self.can_move_axis(axis) else []

    def can_move_axis(self, axis: int) -> bool:
        """Whether there is such an axis."""
        return int(_within("Axis", axis, 0, 2)) < 2

    def move_axis(self, axis: int, rate: float) -> None:
        """Move an axis by hand [deg/s] until its rate is 0 again; what was tracked before then is again."""
        if not self.can_move_axis(axis):
            raise DeviceError(INVALID_VALUE, "Axis 2 is not there; there are 0, azimuth, and 1, altitude.")
        self.pointing.move(axis, radians(_within("Rate", rate, -RATE, RATE)))

    def action(self, action: str, parameters: str) -> str:
        """Do something of our own: there is nothing."""
        raise DeviceError(ACTION_NOT_IMPLEMENTED, f'Action "{action}" is not offered; there are none.')

    def _stated(self, name: str) -> float:
        if name not in self._target:
            raise DeviceError(VALUE_NOT_SET, f"{name} has not been set.")
        return self._target[name]


def _hours(angle: float) -> float:
    """Write an angle from 0 to 2 pi [rad] in hours from 0 to before 24: what rounds to 24 h is 0 h."""
    return angle * HOURS % 24.0


def _within(name: str, value: float, low: float, high: float) -> float:
    if not low <= value <= high:
        raise DeviceError(INVALID_VALUE, f"{name} {value:g} is outside {low:g} to {high:g}.")
    return value
