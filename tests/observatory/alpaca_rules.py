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


def get(text: str, name: str, wanted: Any = 0, given: Given | None = None, state: str = "free") -> Rule:
    """A rule of a value; `name` is that of a member, or an address."""
    return Rule(text, state, "GET", name if name.startswith("/") else BASE + name, given or {}, wanted)


def put(text: str, name: str, wanted: int = 0, given: Given | None = None, state: str = "free") -> Rule:
    """A rule of a method or of setting a value."""
    return Rule(text, state, "PUT", BASE + name, given or {}, wanted)


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
READ_ONLY = (
    "altitude", "azimuth", "canpark", "declination", "rightascension", "siderealtime", "slewing", "atpark",
    "sitelatitude", "sitelongitude", "siteelevation", "utcdate", "doesrefraction",
)  # fmt: skip
NO_NUMBERS = ("", " 1", "1 ", "0x1", "1_0", "one", "nan", "inf", "-Infinity", "1e999", "1,5", "٣", "--1", "1e", ".")


def members() -> Iterator[Rule]:
    for name, wanted in (COMMON | VALUES).items():
        yield get("a member has a value of its kind and range", name, wanted)
    for name in COMMON:
        yield get("a member of every device answers without a connection", name, state="disconnected")
    for name in VALUES:
        yield get("without a connection there is no value", name, NOT_CONNECTED, state="disconnected")
    for name in ABSENT:
        yield get("what the mount lacks is not implemented", name, NOT_IMPLEMENTED)
    for name in ABSENT_METHODS:
        yield put("what the mount cannot do is not implemented", name, NOT_IMPLEMENTED)
    for name in READ_ONLY:
        yield put("what can only be read or is fixed here cannot be set", name, NOT_IMPLEMENTED, {name: 1})


def requests() -> Iterator[Rule]:
    for path in ("/API/v1/telescope/0/name", "/api/V1/telescope/0/name", "/api/v1/Telescope/0/name", BASE + "Name"):
        yield get("an address is in lower case", path, BAD)
    for path in ("/api/v1/telescope/1/name", "/api/v1/telescope/-1/name", "/api/v1/telescope/x/name", BASE + "none"):
        yield get("there is no such device or member", path, BAD)
    for path in ("/api/v2/telescope/0/name", "/api/v1/camera/0/name", "/api/v1/telescope/0", "/", "/api"):
        yield get("there is no such version or kind of device", path, BAD)
    for name in ("park", "unpark", "abortslew", "slewtotargetasync", "moveaxis", "connect", "disconnect", "action"):
        yield get("a method is called by PUT", name, BAD)
    for name in ("ClientID", "clientid", "CLIENTID", "ClientTransactionID", "clienttransactionid"):
        yield get("names in a query may be spelt anyhow", "name", TEXT, {name: 7})
    for number in ("-1", "4294967296", "1.0", "x", ""):
        for name in ("ClientID", "ClientTransactionID"):
            yield get("numbers of a client are uint32", "name", BAD, {name: number})
    yield get("ClientID may be as large as uint32", "name", TEXT, {"ClientID": 4294967295})
    for name in ("tracking", "TRACKING", "trackinG", "Track"):
        yield put("names in a body are spelt exactly", "tracking", BAD, {name: "True"})
    for text in ("True", "true", "TRUE", "False", "false"):
        yield put("a boolean may be written in any case", "tracking", given={"Tracking": text})
    for text in ("", "1", "0", "yes", "on", " True", "T"):
        yield put("a boolean is True or False", "tracking", BAD, {"Tracking": text})
    yield get("what nobody asked for is ignored", "name", TEXT, {"Colour": "red"})
    yield get("the interfaces' versions are told", "/management/apiversions", exactly([1]))
    yield get("the server is told", "/management/v1/description", kind(dict))
    yield get("the devices are told", "/management/v1/configureddevices", kind(list))


def numbers() -> Iterator[Rule]:
    for text in NO_NUMBERS:
        yield put("a number is written as a number", "moveaxis", BAD, {"Axis": 0, "Rate": text})
        yield put("a number is written as a number", "targetdeclination", BAD, {"TargetDeclination": text})
    for text in ("1.0", "1e0", "99999999999", *NO_NUMBERS):
        yield get("an axis is a whole number", "canmoveaxis", BAD, {"Axis": text})
    for text in ("5", "+5", "5.", "5.0", ".5e1", "5e0", "5E+0", "005"):
        yield put("a number may be written so", "targetdeclination", given={"TargetDeclination": text})
    slew, star = "slewtocoordinatesasync", {"RightAscension": 5, "Declination": 20}
    for name, values in {"RightAscension": (-0.001, 24.001, 1e300), "Declination": (-90.001, 90.001, -1e300)}.items():
        for value in values:
            yield put("a place is within its range", slew, INVALID_VALUE, star | {name: value}, "tracking")
            yield put("a target is within its range", f"target{name.lower()}", INVALID_VALUE, {f"Target{name}": value})
        yield put("every parameter is given", slew, BAD, {name: 5}, "tracking")
        yield get("a target that was not set is none", f"target{name.lower()}", NOT_SET)
    for azimuth, altitude in ((-1, 45), (361, 45), (0, 91)):
        given = {"Azimuth": azimuth, "Altitude": altitude}
        yield put("a direction is within its range", "slewtoaltazasync", INVALID_VALUE, given)


def behaviour() -> Iterator[Rule]:
    yield put("it goes nowhere without a target", "slewtotargetasync", NOT_SET, state="tracking")
    star, place = {"RightAscension": 0, "Declination": 80}, {"Azimuth": 180, "Altitude": 45}
    slew, turn = "slewtocoordinatesasync", "slewtoaltazasync"
    yield put("to a star it goes while it tracks", slew, given=star, state="tracking")
    yield put("to a star it does not go while it rests", slew, INVALID_OPERATION, star)
    yield put("to a direction it goes while it rests", turn, given=place)
    yield put("to a direction it does not go while it tracks", turn, INVALID_OPERATION, place, "tracking")
    yield put("it does not go below its horizon", turn, INVALID_OPERATION, {"Azimuth": 180, "Altitude": -5})
    parked = {slew: star, turn: place, "abortslew": {}, "tracking": {"Tracking": True}}
    for name, given in (parked | {"moveaxis": {"Axis": 0, "Rate": 1}}).items():
        yield put("parked it does not move", name, PARKED, given, "parked")
    yield put("parked it may be parked again", "park", state="parked")
    yield put("parked it may be unparked", "unpark", state="parked")
    yield put("unparked it may be unparked again", "unpark")
    for name, wanted in {"atpark": YES, "tracking": NO, "slewing": NO}.items():
        yield get("parked it says so, and does not move", name, wanted, state="parked")
    yield get("tracking it says so", "tracking", YES, state="tracking")
    for axis, moves in ((0, YES), (1, YES), (2, NO)):
        yield get("an axis moves or does not", "canmoveaxis", moves, {"Axis": axis})
        rates = exactly([]) if axis == 2 else lambda value: value[0]["Maximum"] > value[0]["Minimum"] >= 0
        yield get("its rates are told, none where it does not move", "axisrates", rates, {"Axis": axis})
    for axis in (-1, 3):
        for name in ("canmoveaxis", "axisrates"):
            yield get("there are three axes", name, INVALID_VALUE, {"Axis": axis})
        yield put("there are three axes", "moveaxis", INVALID_VALUE, {"Axis": axis, "Rate": 0})
    for rate in (2.001, -2.001, 1e300):
        yield put("a rate is one of those told", "moveaxis", INVALID_VALUE, {"Axis": 0, "Rate": rate})
    for rate in (2, -2, 0):
        yield put("a rate of those told is taken", "moveaxis", given={"Axis": 1, "Rate": rate})
    yield put("an axis that is not there does not move", "moveaxis", INVALID_VALUE, {"Axis": 2, "Rate": 1})
    yield put("the stars' rate is offered", "trackingrate", given={"TrackingRate": 0})
    for rate in (1, 2, 3, -1, 9):
        yield put("no other rate is", "trackingrate", INVALID_VALUE, {"TrackingRate": rate})
    yield put("an action that is not offered is none", "action", NO_ACTION, {"Action": "dance", "Parameters": ""})
    yield put("an abort at rest does nothing", "abortslew")
    yield put("without a connection it does not move", "park", NOT_CONNECTED, state="disconnected")
    yield put("connecting is done at once", "connect", state="disconnected")
    yield put("disconnecting is done at once", "disconnect")


RULES = [*members(), *requests(), *numbers(), *behaviour()]
