"""The members of a telescope as requests name them: properties are read by GET and set by PUT, methods called by PUT.

`right_ascension` of `Telescope` is "rightascension" in an address and RightAscension as a parameter; what a method
takes and of which kind is read from its signature. A method that only asks is called by GET.
"""

import inspect
import re
from collections.abc import Callable, Mapping
from functools import cached_property
from math import isfinite
from typing import Any, get_type_hints

from cosim_observatory.pointing import NOT_CONNECTED, NOT_IMPLEMENTED, DeviceError
from cosim_observatory.telescope import Telescope

ASKING = ("axis_rates", "can_move_axis")
"""Methods that are called by GET."""
ALWAYS = (
    *("connect", "connected", "connecting", "description", "disconnect", "driver_info", "driver_version"),
    *("interface_version", "name", "supported_actions"),
)
"""Members that answer without a connection."""
ABSENT = (
    *("aperturearea", "aperturediameter", "commandblind", "commandbool", "commandstring", "destinationsideofpier"),
    *("findhome", "focallength", "guideratedeclination", "guideraterightascension", "ispulseguiding", "pulseguide"),
    *("setpark", "sideofpier", "slewsettletime", "slewtoaltaz", "slewtocoordinates", "slewtotarget"),
    *("synctoaltaz", "synctocoordinates", "synctotarget"),
)
"""Members of the standard that such a mount does not have."""
NAMES = {"utc_date": "UTCDate"}


INTEGER, NUMBER = re.compile(r"[-+]?[0-9]{1,10}"), re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
"""What is a number: no blanks, no underscores, no digits of other scripts, no words."""
LONGEST = 60
"""Characters of a number, and of a wrong one in an answer."""


class BadRequest(Exception):
    """A request that cannot be understood; its text is the answer's."""


class Members:
    """The members of a telescope by their names in an address."""

    def __init__(self, telescope: Telescope) -> None:
        self._telescope, self._lock = telescope, telescope.pointing.lock
        kind = type(telescope)
        self._attributes = {name.replace("_", ""): name for name in dir(kind) if not name.startswith("_")}

    def get(self, member: str, given: Mapping[str, str]) -> Any:
        """Read a property, or ask a method."""
        name = self._name(member)
        with self._lock:
            self._refuse_unconnected(name)
            found = getattr(self._telescope, name)
            if callable(found):
                if name not in ASKING:
                    raise BadRequest(f"{member} is called by PUT")
                spelt = {key.lower(): value for key, value in given.items()}
                return found(**_arguments(found, lambda parameter: spelt.get(parameter.lower())))
            return found

    def put(self, member: str, given: Mapping[str, str]) -> Any:
        """Set a property, or call a method."""
        name = self._name(member)
        with self._lock:
            self._refuse_unconnected(name)
            described = getattr(type(self._telescope), name)
            if isinstance(described, property):
                if described.fset is None:
                    raise DeviceError(NOT_IMPLEMENTED, f"{member} can only be read.")
                (value,) = _arguments(described.fset, given.get, _spelt(name)).values()
                setattr(self._telescope, name, value)
                return None
            if not callable(described):
                raise DeviceError(NOT_IMPLEMENTED, f"{member} can only be read.")
            return getattr(self._telescope, name)(**_arguments(described, given.get))

    def watch(self) -> None:
        """Let the telescope look after itself."""
        with self._lock:
            self._telescope.pointing.watch()

    @cached_property
    def title(self) -> str:
        """Name of the device."""
        return self._telescope.name

    def _name(self, member: str) -> str:
        if member in ABSENT:
            raise DeviceError(NOT_IMPLEMENTED, f"{member} is not implemented by this mount.")
        if member not in self._attributes:
            raise BadRequest(f"a telescope has no member {member}")
        return self._attributes[member]

    def _refuse_unconnected(self, name: str) -> None:
        if name not in ALWAYS and not self._telescope.connected:
            raise DeviceError(NOT_CONNECTED, "Connect first.")


def _spelt(name: str) -> str:
    """Return the standard's spelling of a name of ours."""
    return NAMES.get(name, name.title().replace("_", ""))


def _arguments(function: Callable[..., Any], given: Callable[[str], str | None], only: str = "") -> dict[str, Any]:
    """Read the parameters of a function from texts; `only` is the spelling of the one of a property."""
    hints, found = get_type_hints(function), {}
    for name in inspect.signature(function).parameters:
        if name != "self":
            spelt = only or _spelt(name)
            found[name] = read_parameter(spelt, given(spelt), hints[name])
    return found


def read_parameter(name: str, text: str | None, kind: type) -> Any:
    """Read a parameter from a text.

    Raises:
        BadRequest: it is missing, or not of the kind.
    """
    if text is None:
        raise BadRequest(f"{name} is missing")
    if kind is bool and text.lower() in ("true", "false"):
        return text.lower() == "true"
    if kind is str:
        return text
    value = number(text) if kind in (int, float) else None
    if value is None or (kind is int and not INTEGER.fullmatch(text)):
        raise BadRequest(f'{name} = "{text[:LONGEST]}" is no {kind.__name__}')
    return kind(value)


def number(text: str) -> float | None:
    """Read a number as JSON and C write it; None where it is none, or too large for a double."""
    if len(text) > LONGEST or not NUMBER.fullmatch(text):
        return None
    return float(text) if isfinite(float(text)) else None
