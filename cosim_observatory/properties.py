"""The telescope's properties in INDI's standard names: what each shows, and what it does when a client changes it."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

from cosim_observatory.members import LONGEST
from cosim_observatory.members import number as plain
from cosim_observatory.pointing import INVALID_VALUE, NOT_IMPLEMENTED, DeviceError
from cosim_observatory.telescope import Telescope

Read = Callable[[Telescope], dict[str, str]]
Given = Mapping[str, str]
RATE = 1.0
"""Of an axis moved by hand [deg/s]."""
TELESCOPE_INTERFACE = "1"


@dataclass(frozen=True)
class Property:
    """A vector of INDI; `limits` are format, least and greatest by element of a number."""

    name: str
    kind: str
    label: str
    group: str
    read: Read
    write: Callable[[Telescope, Given], None] | None = None
    state: Callable[[Telescope], str] = lambda telescope: "Ok"
    rule: str = "OneOfMany"
    limits: Mapping[str, tuple[str, float, float]] | None = None

    @property
    def permission(self) -> str:
        """What a client may do."""
        return "rw" if self.write else "ro"

    def numbers(self, element: str) -> dict[str, str]:
        """The attributes of a number."""
        shape, low, high = (self.limits or {}).get(element, ("%.6f", 0.0, 0.0))
        return {"format": shape, "min": f"{low:g}", "max": f"{high:g}", "step": "0"}

    def change(self, telescope: Telescope, given: Given) -> None:
        """Do what a client wants.

        Raises:
            DeviceError: it cannot be done, and why.
        """
        if self.write is None:
            raise DeviceError(NOT_IMPLEMENTED, f"{self.name} can only be read.")
        unknown = [name for name in given if name not in self.read(telescope)]
        if unknown or not given:
            names = ", ".join(self.read(telescope))
            raise DeviceError(INVALID_VALUE, f'{self.name} has no element "{(unknown or [""])[0]}"; it has: {names}.')
        if self.kind == "Switch":
            check_switches(self, given)
        self.write(telescope, given)


def number(given: Given, name: str) -> float:
    """Read a number, also one in sixtieths (6:30:00).

    Raises:
        DeviceError: it is missing, or no number.
    """
    text = given.get(name, "")
    parts = text.replace(":", " ").replace(";", " ").split()
    found = [plain(part) for part in parts]
    values = [one for one in found if one is not None]
    sixtieths = all(part[0].isdigit() and 0 <= one < 60 for part, one in zip(parts[1:], values[1:], strict=False))
    if not 1 <= len(found) <= 3 or len(values) < len(found) or not sixtieths:
        raise DeviceError(INVALID_VALUE, f'{name} = "{text[:LONGEST]}" is no number.')
    size = sum(abs(one) / 60.0**k for k, one in enumerate(values))
    return -size if parts[0].startswith("-") else size


def chosen(given: Given) -> str:
    """Return the switch that is on; empty if none is."""
    return next((name for name, text in given.items() if text == "On"), "")


def check_switches(one: "Property", given: Given) -> None:
    """Refuse what is neither On nor Off, and more or fewer that are On than the property's rule wants (DeviceError)."""
    wrong = next((text for text in given.values() if text not in ("On", "Off")), None)
    if wrong is not None:
        raise DeviceError(INVALID_VALUE, f'{one.name}: "{wrong[:LONGEST]}" is neither On nor Off.')
    count = sum(text == "On" for text in given.values())
    if count > 1 or (count == 0 and one.rule == "OneOfMany"):
        wanted = "exactly one" if one.rule == "OneOfMany" else "at most one"
        raise DeviceError(INVALID_VALUE, f"{one.name}: {wanted} must be On, not {count}.")


def switches(**on: bool) -> dict[str, str]:
    """Write switches."""
    return {name: "On" if value else "Off" for name, value in on.items()}


@contextmanager
def _unless_refused(telescope: Telescope, tracking: bool) -> Iterator[None]:
    """Track or not, as the slew within the block needs it; one that is refused leaves it as it was."""
    before = telescope.tracking
    telescope.tracking = tracking
    try:
        yield
    except DeviceError:
        telescope.tracking = before
        raise


def _connect(telescope: Telescope, given: Given) -> None:
    telescope.connected = chosen(given) == "CONNECT"


def _equatorial(telescope: Telescope, given: Given) -> None:
    star = number(given, "RA"), number(given, "DEC")
    with _unless_refused(telescope, True):
        telescope.slew_to_coordinates_async(*star)


def _horizontal(telescope: Telescope, given: Given) -> None:
    to = number(given, "AZ"), number(given, "ALT")
    with _unless_refused(telescope, False):
        telescope.slew_to_alt_az_async(*to)


def _track(telescope: Telescope, given: Given) -> None:
    telescope.tracking = chosen(given) == "TRACK_ON"


def _park(telescope: Telescope, given: Given) -> None:
    if chosen(given) == "PARK":
        telescope.park()
    else:
        telescope.unpark()


def _abort(telescope: Telescope, given: Given) -> None:
    if chosen(given):
        telescope.abort_slew()


def _mover(axis: int, forward: str, backward: str) -> Callable[[Telescope, Given], None]:
    rates = {forward: RATE, backward: -RATE, "": 0.0}
    return lambda telescope, given: telescope.move_axis(axis, rates[chosen(given)])


def _moves(axis: int, forward: str, backward: str) -> Read:
    def read(telescope: Telescope) -> dict[str, str]:
        rate = telescope.pointing.rates[axis]
        return switches(**{forward: rate > 0, backward: rate < 0})

    return read


def _pointing(telescope: Telescope) -> str:
    return "Busy" if telescope.slewing else "Ok" if telescope.tracking else "Idle"


def _only(telescope: Telescope, given: Given) -> None:
    """There is one element, and it is always on."""


def _parked(telescope: Telescope) -> bool:
    return telescope.at_park or telescope.pointing.parking


def _parking(telescope: Telescope) -> str:
    return "Busy" if telescope.pointing.parking else "Ok" if telescope.at_park else "Idle"


def _exact(**values: float) -> dict[str, str]:
    return {name: f"{value:.10g}" for name, value in values.items()}


MAIN, MOTION, SITE = "Main Control", "Motion Control", "Site Management"
NORTH, EAST = ("MOTION_NORTH", "MOTION_SOUTH"), ("MOTION_EAST", "MOTION_WEST")

CONNECTION = Property(
    "CONNECTION",
    "Switch",
    "Connection",
    MAIN,
    lambda t: switches(CONNECT=t.connected, DISCONNECT=not t.connected),
    _connect,
)
PROPERTIES = (
    CONNECTION,
    Property(
        "DRIVER_INFO", "Text", "Driver", "General Info",
        lambda t: {"DRIVER_NAME": t.name, "DRIVER_EXEC": "cosim hardware indi", "DRIVER_VERSION": t.driver_version,
                   "DRIVER_INTERFACE": TELESCOPE_INTERFACE},
    ),
    Property(
        "EQUATORIAL_EOD_COORD", "Number", "Equatorial, of date", MAIN,
        lambda t: _exact(RA=t.right_ascension, DEC=t.declination), _equatorial, _pointing,
        limits={"RA": ("%010.6m", 0, 24), "DEC": ("%010.6m", -90, 90)},
    ),
    Property(
        "HORIZONTAL_COORD", "Number", "Horizontal", MAIN,
        lambda t: _exact(AZ=t.azimuth, ALT=t.altitude), _horizontal, _pointing,
        limits={"AZ": ("%010.6m", 0, 360), "ALT": ("%010.6m", -90, 90)},
    ),
    Property("ON_COORD_SET", "Switch", "On set", MAIN, lambda t: switches(TRACK=True), _only),
    Property(
        "TELESCOPE_TRACK_STATE", "Switch", "Tracking", MAIN,
        lambda t: switches(TRACK_ON=t.tracking, TRACK_OFF=not t.tracking), _track,
        lambda t: "Busy" if t.tracking else "Idle",
    ),
    Property("TELESCOPE_TRACK_MODE", "Switch", "Track mode", MAIN, lambda t: switches(TRACK_SIDEREAL=True), _only),
    Property(
        "TELESCOPE_PARK", "Switch", "Parking", MAIN,
        lambda t: switches(PARK=_parked(t), UNPARK=not _parked(t)), _park, _parking,
    ),
    Property(
        "TELESCOPE_ABORT_MOTION", "Switch", "Abort", MAIN, lambda t: switches(ABORT=False), _abort, rule="AtMostOne"
    ),
    Property(
        "TELESCOPE_MOTION_NS", "Switch", "Altitude up/down", MOTION,
        _moves(1, *NORTH), _mover(1, *NORTH), rule="AtMostOne",
    ),
    Property(
        "TELESCOPE_MOTION_WE", "Switch", "Azimuth west/east", MOTION,
        _moves(0, *EAST), _mover(0, *EAST), rule="AtMostOne",
    ),
    Property("TIME_UTC", "Text", "UTC", SITE, lambda t: {"UTC": t.utc_date.removesuffix("Z"), "OFFSET": "0"}),
    Property(
        "TIME_LST", "Number", "Sidereal time", SITE, lambda t: _exact(LST=t.sidereal_time),
        limits={"LST": ("%010.6m", 0, 24)},
    ),
    Property(
        "GEOGRAPHIC_COORD", "Number", "Site", SITE,
        lambda t: _exact(LAT=t.site_latitude, LONG=t.site_longitude % 360, ELEV=t.site_elevation),
    ),
)  # fmt: skip
"""Every property, in the order in which clients are told of them."""
