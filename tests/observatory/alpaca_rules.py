"""The rules of ASCOM Alpaca and of ITelescopeV4 as a table: what is asked in which state, and what must come.

Sources: ASCOM Alpaca API Reference (version 7) for requests and answers; ASCOM Master Interfaces, ITelescopeV4, for
members, values and exceptions; error numbers as both give them.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

NOT_IMPLEMENTED, INVALID_VALUE, NOT_SET, NOT_CONNECTED = 0x400, 0x401, 0x402, 0x407
PARKED, INVALID_OPERATION, NO_ACTION = 0x408, 0x40B, 0x40C
BASE = "/api/v1/telescope/0/"
BAD = 400
Given = dict[str, Any]


@dataclass(frozen=True)
class Rule:
    """`state`: free, tracking, parked or disconnected. `wanted`: an HTTP status, an error number, or of the value."""

    text: str
    state: str
    method: str
    path: str
    given: Given = field(default_factory=dict)
    wanted: int | Callable[[Any], bool] = 0

    def __str__(self) -> str:
        return f"{self.text}: {self.method} {self.path} {self.given or ''}"


def kind(*kinds: type) -> Callable[[Any], bool]:
    return lambda value: type(value) in kinds


def within(low: float, high: float) -> Callable[[Any], bool]:
    return lambda value: type(value) in (int, float) and low <= value <= high


def exactly(wanted: Any) -> Callable[[Any], bool]:
    return lambda value: type(value) is type(wanted) and value == wanted


YES, NO, BOOL, TEXT = exactly(True), exactly(False), kind(bool), kind(str)
COMMON = {
    "connected": BOOL, "connecting": NO, "description": TEXT, "driverinfo": TEXT, "driverversion": TEXT,
    "interfaceversion": exactly(4), "name": TEXT, "supportedactions": exactly([]),
}  # fmt: skip
"""Members of every device, that answer without a connection."""
VALUES: dict[str, Callable[[Any], bool]] = {
    "alignmentmode": within(0, 2), "altitude": within(-90, 90), "athome": BOOL, "atpark": BOOL,
    "azimuth": within(0, 360), "canfindhome": NO, "canpark": YES, "canpulseguide": NO, "cansetdeclinationrate": NO,
    "cansetguiderates": NO, "cansetpark": NO, "cansetpierside": NO, "cansetrightascensionrate": NO,
    "cansettracking": YES, "canslew": NO, "canslewaltaz": NO, "canslewaltazasync": YES, "canslewasync": YES,
    "cansync": NO, "cansyncaltaz": NO, "canunpark": YES, "declination": within(-90, 90),
    "declinationrate": exactly(0.0),
    "devicestate": kind(list), "doesrefraction": BOOL, "equatorialsystem": within(0, 4),
    "rightascension": within(0, 24), "rightascensionrate": exactly(0.0), "siderealtime": within(0, 24),
    "siteelevation": within(-300, 10000), "sitelatitude": within(-90, 90), "sitelongitude": within(-180, 180),
    "slewing": BOOL, "tracking": BOOL, "trackingrate": exactly(0), "trackingrates": exactly([0]),
    "utcdate": lambda value: type(value) is str and value.endswith("Z") and "T" in value,
}  # fmt: skip
"""Members of a telescope and what they may answer."""
ABSENT = (
    "aperturearea", "aperturediameter", "destinationsideofpier", "focallength", "guideratedeclination",
    "guideraterightascension", "ispulseguiding", "sideofpier", "slewsettletime",
)  # fmt: skip
ABSENT_METHODS = (
    "commandblind", "commandbool", "commandstring", "findhome", "pulseguide", "setpark", "slewtoaltaz",
    "slewtocoordinates", "slewtotarget", "synctoaltaz", "synctocoordinates", "synctotarget",
)  # fmt: skip
READ_ONLY = ("altitude", "azimuth", "canpark", "declination", "rightascension", "siderealtime", "slewing", "atpark")
NO_NUMBERS = ("", " 1", "1 ", "0x1", "1_0", "one", "nan", "inf", "-Infinity", "1e999", "1,5", "٣", "--1", "1e", ".")


def members() -> Iterator[Rule]:
    for name, wanted in (COMMON | VALUES).items():
        yield Rule("a member has a value of its kind and range", "free", "GET", BASE + name, {}, wanted)
    for name in COMMON:
        yield Rule("a member of every device answers without a connection", "disconnected", "GET", BASE + name)
    for name in VALUES:
        yield Rule("without a connection there is no value", "disconnected", "GET", BASE + name, {}, NOT_CONNECTED)
    for name in ABSENT:
        yield Rule("what the mount lacks is not implemented", "free", "GET", BASE + name, {}, NOT_IMPLEMENTED)
    for name in ABSENT_METHODS:
        yield Rule("what the mount cannot do is not implemented", "free", "PUT", BASE + name, {}, NOT_IMPLEMENTED)
    for name in READ_ONLY:
        given = {name: 1}
        yield Rule("what can only be read cannot be set", "free", "PUT", BASE + name, given, NOT_IMPLEMENTED)
    for name in ("sitelatitude", "sitelongitude", "siteelevation", "utcdate", "doesrefraction"):
        given = {name: 1}
        yield Rule("what is fixed here cannot be set", "free", "PUT", BASE + name, given, NOT_IMPLEMENTED)


def requests() -> Iterator[Rule]:
    for path in ("/API/v1/telescope/0/name", "/api/V1/telescope/0/name", "/api/v1/Telescope/0/name", BASE + "Name"):
        yield Rule("an address is in lower case", "free", "GET", path, {}, BAD)
    for path in ("/api/v1/telescope/1/name", "/api/v1/telescope/-1/name", "/api/v1/telescope/x/name", BASE + "none"):
        yield Rule("there is no such device or member", "free", "GET", path, {}, BAD)
    for path in ("/api/v2/telescope/0/name", "/api/v1/camera/0/name", "/api/v1/telescope/0", "/", "/api"):
        yield Rule("there is no such version or kind of device", "free", "GET", path, {}, BAD)
    for name in ("park", "unpark", "abortslew", "slewtotargetasync", "moveaxis", "connect", "disconnect", "action"):
        yield Rule("a method is called by PUT", "free", "GET", BASE + name, {}, BAD)
    for name in ("ClientID", "clientid", "CLIENTID", "ClientTransactionID", "clienttransactionid"):
        yield Rule("names in a query may be spelt anyhow", "free", "GET", BASE + "name", {name: 7}, TEXT)
    for number in ("-1", "4294967296", "1.0", "x", ""):
        for name in ("ClientID", "ClientTransactionID"):
            yield Rule("numbers of a client are uint32", "free", "GET", BASE + "name", {name: number}, BAD)
    yield Rule("ClientID may be as large as uint32", "free", "GET", BASE + "name", {"ClientID": 4294967295}, TEXT)
    for name in ("tracking", "TRACKING", "trackinG", "Track"):
        yield Rule("names in a body are spelt exactly", "free", "PUT", BASE + "tracking", {name: "True"}, BAD)
    for text in ("True", "true", "TRUE", "False", "false"):
        yield Rule("a boolean may be written in any case", "free", "PUT", BASE + "tracking", {"Tracking": text})
    for text in ("", "1", "0", "yes", "on", " True", "T"):
        yield Rule("a boolean is True or False", "free", "PUT", BASE + "tracking", {"Tracking": text}, BAD)
    yield Rule("what nobody asked for is ignored", "free", "GET", BASE + "name", {"Colour": "red"}, TEXT)
    yield Rule("the interfaces' versions are told", "free", "GET", "/management/apiversions", {}, exactly([1]))
    yield Rule("the server is told", "free", "GET", "/management/v1/description", {}, kind(dict))
    yield Rule("the devices are told", "free", "GET", "/management/v1/configureddevices", {}, kind(list))


def numbers() -> Iterator[Rule]:
    for text in NO_NUMBERS:
        given = {"Axis": 0, "Rate": text}
        yield Rule("a number is written as a number", "free", "PUT", BASE + "moveaxis", given, BAD)
        given = {"TargetDeclination": text}
        yield Rule("a number is written as a number", "free", "PUT", BASE + "targetdeclination", given, BAD)
    for text in ("1.0", "1e0", "99999999999", *NO_NUMBERS):
        yield Rule("an axis is a whole number", "free", "GET", BASE + "canmoveaxis", {"Axis": text}, BAD)
    for text in ("5", "+5", "5.", "5.0", ".5e1", "5e0", "5E+0", "005"):
        given = {"TargetDeclination": text}
        yield Rule("a number may be written so", "free", "PUT", BASE + "targetdeclination", given)
    for name, values in {"RightAscension": (-0.001, 24.001, 1e300), "Declination": (-90.001, 90.001, -1e300)}.items():
        for value in values:
            given, target = {"RightAscension": 5, "Declination": 20} | {name: value}, f"target{name.lower()}"
            slew = BASE + "slewtocoordinatesasync"
            yield Rule("a place on the sky is within its range", "tracking", "PUT", slew, given, INVALID_VALUE)
            one = {f"Target{name}": value}
            yield Rule("a target is within its range", "free", "PUT", BASE + target, one, INVALID_VALUE)
    for given in ({"Azimuth": -1, "Altitude": 45}, {"Azimuth": 361, "Altitude": 45}, {"Azimuth": 0, "Altitude": 91}):
        slew = BASE + "slewtoaltazasync"
        yield Rule("a direction is within its range", "free", "PUT", slew, given, INVALID_VALUE)
    for name in ("RightAscension", "Declination"):
        yield Rule("every parameter is given", "tracking", "PUT", BASE + "slewtocoordinatesasync", {name: 5}, BAD)
        target = BASE + f"target{name.lower()}"
        yield Rule("a target that was not set is none", "free", "GET", target, {}, NOT_SET)


def behaviour() -> Iterator[Rule]:
    yield Rule("it goes nowhere without a target", "tracking", "PUT", BASE + "slewtotargetasync", {}, NOT_SET)
    star, place = {"RightAscension": 0, "Declination": 80}, {"Azimuth": 180, "Altitude": 45}
    slew, turn = BASE + "slewtocoordinatesasync", BASE + "slewtoaltazasync"
    yield Rule("to a star it goes while it tracks", "tracking", "PUT", slew, star)
    yield Rule("to a star it does not go while it rests", "free", "PUT", slew, star, INVALID_OPERATION)
    yield Rule("to a direction it goes while it rests", "free", "PUT", turn, place)
    yield Rule("to a direction it does not go while it tracks", "tracking", "PUT", turn, place, INVALID_OPERATION)
    below = {"Azimuth": 180, "Altitude": -5}
    yield Rule("it does not go below its horizon", "free", "PUT", turn, below, INVALID_OPERATION)
    parked = {
        "slewtocoordinatesasync": star, "slewtoaltazasync": place, "abortslew": {}, "tracking": {"Tracking": True},
        "moveaxis": {"Axis": 0, "Rate": 1},
    }  # fmt: skip
    for name, given in parked.items():
        yield Rule("parked it does not move", "parked", "PUT", BASE + name, given, PARKED)
    yield Rule("parked it may be parked again", "parked", "PUT", BASE + "park")
    yield Rule("parked it may be unparked", "parked", "PUT", BASE + "unpark")
    yield Rule("unparked it may be unparked again", "free", "PUT", BASE + "unpark")
    yield Rule("parked it says so", "parked", "GET", BASE + "atpark", {}, YES)
    yield Rule("parked it does not track", "parked", "GET", BASE + "tracking", {}, NO)
    yield Rule("parked it does not slew", "parked", "GET", BASE + "slewing", {}, NO)
    yield Rule("tracking it says so", "tracking", "GET", BASE + "tracking", {}, YES)
    for axis, moves in ((0, YES), (1, YES), (2, NO)):
        yield Rule("an axis moves or does not", "free", "GET", BASE + "canmoveaxis", {"Axis": axis}, moves)
        rates = exactly([]) if axis == 2 else lambda value: value[0]["Maximum"] > value[0]["Minimum"] >= 0
        yield Rule(
            "its rates are told, none where it does not move", "free", "GET", BASE + "axisrates", {"Axis": axis}, rates
        )
    for axis in (-1, 3):
        for name in ("canmoveaxis", "axisrates"):
            yield Rule("there are three axes", "free", "GET", BASE + name, {"Axis": axis}, INVALID_VALUE)
        given = {"Axis": axis, "Rate": 0}
        yield Rule("there are three axes", "free", "PUT", BASE + "moveaxis", given, INVALID_VALUE)
    for rate in (2.001, -2.001, 1e300):
        given = {"Axis": 0, "Rate": rate}
        yield Rule("a rate is one of those told", "free", "PUT", BASE + "moveaxis", given, INVALID_VALUE)
    for rate in (2, -2, 0):
        yield Rule("a rate of those told is taken", "free", "PUT", BASE + "moveaxis", {"Axis": 1, "Rate": rate})
    given = {"Axis": 2, "Rate": 1}
    yield Rule("an axis that is not there does not move", "free", "PUT", BASE + "moveaxis", given, INVALID_VALUE)
    yield Rule("the stars' rate is offered", "free", "PUT", BASE + "trackingrate", {"TrackingRate": 0})
    for rate in (1, 2, 3, -1, 9):
        given = {"TrackingRate": rate}
        yield Rule("no other rate is", "free", "PUT", BASE + "trackingrate", given, INVALID_VALUE)
    given = {"Action": "dance", "Parameters": ""}
    yield Rule("an action that is not offered is none", "free", "PUT", BASE + "action", given, NO_ACTION)
    yield Rule("an abort at rest does nothing", "free", "PUT", BASE + "abortslew")
    yield Rule("without a connection it does not move", "disconnected", "PUT", BASE + "park", {}, NOT_CONNECTED)
    yield Rule("connecting is done at once", "disconnected", "PUT", BASE + "connect")
    yield Rule("disconnecting is done at once", "free", "PUT", BASE + "disconnect")


RULES = [*members(), *requests(), *numbers(), *behaviour()]
