"""ASCOM Alpaca: a telescope over HTTP, with discovery by UDP.

    GET /api/v1/telescope/0/rightascension?ClientID=1&ClientTransactionID=2
    PUT /api/v1/telescope/0/slewtocoordinatesasync      RightAscension=5.5&Declination=20

The members of the standard are those of `Telescope`, found by their names: a property is read by GET and set by PUT, a
method is called by PUT (by GET where it only asks). A request that cannot be understood is answered by 400 and a
sentence; one that the telescope refuses by 200 and the error's number, as the standard wants it.
Reference: ASCOM Alpaca API Reference, version 1 (2019-2024), and its discovery protocol.
"""

import inspect
import json
import socket
from collections.abc import Callable, Mapping
from functools import cached_property
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import count
from math import isfinite
from threading import RLock, Thread
from typing import Any, get_type_hints
from urllib.parse import parse_qsl, urlsplit

import cosim
from cosim.errors import OutputError
from cosim.supervisor.telescope import NOT_CONNECTED, NOT_IMPLEMENTED, DeviceError, Telescope

PORT, DISCOVERY_PORT = 11111, 32227
DISCOVERY = b"alpacadiscovery1"
IDENTITY = "mount-cosim-simulated-mount-0"
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


class BadRequest(Exception):
    """A request that cannot be understood; its text is the answer's."""


class Members:
    """The members of a telescope by their names in an address."""

    def __init__(self, telescope: Telescope) -> None:
        self._telescope, self._lock = telescope, RLock()
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
            self._telescope.watch()

    @cached_property
    def title(self) -> str:
        """Name of the device."""
        return self._telescope.name

    def _name(self, member: str) -> str:
        if member in ABSENT:
            raise DeviceError(NOT_IMPLEMENTED, f"{member} is not implemented by this mount.")
        if member not in self._attributes or member == "watch":
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
            found[name] = _read(spelt, given(spelt), hints[name])
    return found


def _read(name: str, text: str | None, kind: type) -> Any:
    if text is None:
        raise BadRequest(f"{name} is missing")
    if kind is bool and text.lower() in ("true", "false"):
        return text.lower() == "true"
    if kind is str:
        return text
    try:
        value = kind(text)
    except ValueError:
        value = None
    if kind is bool or value is None or not isfinite(value):
        raise BadRequest(f'{name} = "{text}" is no {kind.__name__}')
    return value


class Server(ThreadingHTTPServer):
    """Serves one telescope; as a context it does so in threads of its own, with discovery unless its port is taken."""

    daemon_threads = True

    def __init__(
        self, telescope: Telescope, address: str = "127.0.0.1", port: int = PORT, discovery: int = DISCOVERY_PORT
    ):
        self.members, self.transactions = Members(telescope), count(1)
        try:
            super().__init__((address, port), _Handler)
        except OSError as error:
            message = f"Port {port} of {address} cannot be served: {(error.strerror or str(error)).lower()}."
            raise OutputError(message, culprit=str(port)) from error
        self.discovery = _discovery(address, discovery)
        self._serving = [Thread(target=self.serve_forever, daemon=True)]
        if self.discovery:
            self._serving.append(Thread(target=self._answer_discovery, daemon=True))

    @property
    def port(self) -> int:
        """The port that is served."""
        return int(self.server_address[1])

    def __enter__(self) -> "Server":
        for thread in self._serving:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.shutdown()
        self.server_close()
        if self.discovery:
            self.discovery.close()

    def service_actions(self) -> None:
        """Look after the telescope between requests."""
        try:
            self.members.watch()
        except DeviceError:
            return  # the next request is told

    def _answer_discovery(self) -> None:
        assert self.discovery is not None
        while True:
            try:
                asked, sender = self.discovery.recvfrom(64)
                if asked[:16] == DISCOVERY:
                    self.discovery.sendto(json.dumps({"AlpacaPort": self.port}).encode(), sender)
            except OSError:
                return  # closed


def _discovery(address: str, port: int) -> socket.socket | None:
    """Open the socket on which clients ask who is there; None where another program has it for itself."""
    found = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        found.bind(("" if address != "127.0.0.1" else address, port))
    except OSError:
        found.close()
        return None
    return found


class _Handler(BaseHTTPRequestHandler):
    """Answers one request."""

    server: Server
    protocol_version = "HTTP/1.1"
    server_version = f"mount-cosim/{cosim.__version__}"
    wbufsize = -1  # an answer is one packet; in two, the second one waits for the client's acknowledgement

    def do_GET(self) -> None:
        self._answer(dict(parse_qsl(urlsplit(self.path).query, keep_blank_values=True)))

    def do_PUT(self) -> None:
        length = int(self.headers.get("Content-Length") or 0)
        self._answer(dict(parse_qsl(self.rfile.read(length).decode("utf-8", "replace"), keep_blank_values=True)))

    def log_message(self, format: str, *args: Any) -> None:
        """Stay silent."""

    def _answer(self, given: dict[str, str]) -> None:
        try:
            self._send(200, json.dumps(self._answered(given)), "application/json")
        except BadRequest as error:
            self._send(400, str(error), "text/plain; charset=utf-8")

    def _answered(self, given: dict[str, str]) -> dict[str, Any]:
        exact = self.command == "PUT"
        spelt = given if exact else {key.lower(): value for key, value in given.items()}
        numbers = [
            _read(one, spelt.get(one if exact else one.lower(), "0"), int)
            for one in ("ClientID", "ClientTransactionID")
        ]
        if any(not 0 <= number < 2**32 for number in numbers):
            raise BadRequest("ClientID and ClientTransactionID are numbers of 32 bits without a sign")
        story = {"ClientTransactionID": numbers[1], "ServerTransactionID": next(self.server.transactions)}
        try:
            value = self._value(urlsplit(self.path).path, given)
        except DeviceError as error:
            return story | {"ErrorNumber": error.number, "ErrorMessage": str(error)}
        return story | {"ErrorNumber": 0, "ErrorMessage": ""} | ({} if value is None else {"Value": value})

    def _value(self, path: str, given: dict[str, str]) -> Any:
        members = self.server.members
        if self.command == "GET" and path in MANAGEMENT:
            return MANAGEMENT[path](members.title)
        head, _, member = path.rpartition("/")
        if head != "/api/v1/telescope/0":
            raise BadRequest(f"{path} is not here; there is /api/v1/telescope/0/...")
        return members.get(member, given) if self.command == "GET" else members.put(member, given)

    def _send(self, status: int, text: str, kind: str) -> None:
        body = text.encode()
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)


MANAGEMENT: dict[str, Callable[[str], Any]] = {
    "/management/apiversions": lambda title: [1],
    "/management/v1/description": lambda title: {
        "ServerName": "mount-cosim",
        "Manufacturer": "mount-cosim",
        "ManufacturerVersion": cosim.__version__,
        "Location": "simulated",
    },
    "/management/v1/configureddevices": lambda title: [
        {"DeviceName": title, "DeviceType": "Telescope", "DeviceNumber": 0, "UniqueID": IDENTITY}
    ],
}
