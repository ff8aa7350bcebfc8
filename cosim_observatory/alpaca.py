"""ASCOM Alpaca: a telescope over HTTP, with discovery by UDP.

    GET /api/v1/telescope/0/rightascension?ClientID=1&ClientTransactionID=2
    PUT /api/v1/telescope/0/slewtocoordinatesasync      RightAscension=5.5&Declination=20

Members are found as `members` says. A request that cannot be understood is answered by 400 and a
sentence; one that the telescope refuses by 200 and the error's number, as the standard wants it.
Reference: ASCOM Alpaca API Reference, version 1 (2019-2024), and its discovery protocol.
"""

import json
import socket
import sys
from collections.abc import Callable
from contextlib import suppress
from html import escape
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import count
from threading import Lock, Thread
from time import monotonic
from typing import Any
from urllib.parse import parse_qsl, urlsplit

from cosim.support.errors import OutputError
from cosim.support.plain import JsonObject
from cosim.support.version import __version__
from cosim_observatory.members import BadRequest, Members, read_parameter
from cosim_observatory.pointing import DeviceError
from cosim_observatory.telescope import Telescope

PORT, DISCOVERY_PORT = 11111, 32227
DISCOVERY = b"alpacadiscovery1"
IDENTITY = "mount-cosim-simulated-mount-0"
LONGEST, FIELDS = 65_536, 100
"""Bytes of a request's body, and parameters in it."""
CONNECTIONS, REQUEST = 64, 30.0
"""At a time; s in which a request must have come and be answered, and after which an idle connection is closed."""


class Server(ThreadingHTTPServer):
    """Serves one telescope; as a context it does so in threads of its own, with discovery unless its port is taken."""

    daemon_threads, request_queue_size = True, CONNECTIONS

    def __init__(
        self, telescope: Telescope, address: str = "127.0.0.1", port: int = PORT, discovery: int = DISCOVERY_PORT
    ):
        self.telescope, self.members, self.transactions = telescope, Members(telescope), count(1)
        self._open: dict[socket.socket, float] = {}
        self._lock = Lock()
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

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection, of which there are so many at most."""
        with self._lock:
            full = len(self._open) >= CONNECTIONS
            if not full:
                self._open[request] = monotonic()
        if full:
            self.shutdown_request(request)
        else:
            super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        """End a connection, and count it no more."""
        with self._lock:
            self._open.pop(request, None)
        super().shutdown_request(request)

    def answered(self, request: socket.socket) -> None:
        """Hear that a connection has had its answer: its time begins anew."""
        with self._lock:
            self._open[request] = monotonic()

    def service_actions(self) -> None:
        """Look after the telescope between requests, and after connections on which nothing gets done."""
        with self._lock:
            late = [one for one, since in self._open.items() if monotonic() - since > REQUEST]
        for one in late:
            with suppress(OSError):  # it is just ending
                one.shutdown(socket.SHUT_RDWR)
        try:
            self.members.watch()
        except DeviceError:
            return  # the next request is told

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Stay silent where a client has gone in the middle of an answer."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)

    def _answer_discovery(self) -> None:
        assert self.discovery is not None
        here = is_local(str(self.server_address[0]))
        while self.discovery.fileno() >= 0:  # it is closed at the end
            with suppress(OSError):  # who asked cannot be answered
                asked, sender = self.discovery.recvfrom(64)
                if asked[:16] == DISCOVERY and (not here or is_local(sender[0])):
                    self.discovery.sendto(json.dumps({"AlpacaPort": self.port}).encode(), sender)


def is_local(address: str) -> bool:
    """Whether an address is one of this machine alone."""
    return address == "localhost" or address.startswith("127.")


def _discovery(address: str, port: int) -> socket.socket | None:
    """Open the socket on which clients ask everybody who is there; None where another program has it for itself.

    A server of this machine alone is bound to the loopback where the system can do that, and answers nobody else.
    """
    found = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    if is_local(address) and hasattr(socket, "SO_BINDTODEVICE"):
        with suppress(OSError):  # not permitted by an older system
            found.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, b"lo")
    try:
        found.bind(("", port))  # an address of its own would not hear what is sent to all
    except OSError:
        found.close()
        return None
    return found


class _Handler(BaseHTTPRequestHandler):
    """Answers one request."""

    server: Server
    protocol_version = "HTTP/1.1"
    server_version = f"mount-cosim/{__version__}"
    timeout = REQUEST
    wbufsize = -1  # an answer is one packet; in two, the second one waits for the client's acknowledgement

    def handle_expect_100(self) -> bool:
        """Tell a client at once to go on that waits for it before it sends a body."""
        goes_on = super().handle_expect_100()
        self.wfile.flush()
        return goes_on

    def do_GET(self) -> None:
        if self.headers.get("Content-Length", "0") != "0" or self.headers.get("Transfer-Encoding"):
            self.close_connection = True  # what follows is no request
        if urlsplit(self.path).path in SETUP:
            self._send(200, SETUP_PAGE.format(title=escape(self.server.members.title)), "text/html; charset=utf-8")
        else:
            self._answer(lambda: urlsplit(self.path).query)

    def do_PUT(self) -> None:
        self._answer(self._body)

    def _body(self) -> str:
        """Return the body, which must be as long as it says, and text."""
        length = self.headers.get("Content-Length") or "0"
        self.close_connection = True  # until it is read, what follows is no request
        if self.headers.get("Transfer-Encoding"):
            raise BadRequest("a body must come with a Content-Length, in one piece")
        if not (length.isascii() and length.isdigit() and len(length) < 10 and int(length) <= LONGEST):
            raise BadRequest(f"Content-Length must be a number of at most {LONGEST} bytes")
        body = self.rfile.read(int(length))
        if len(body) < int(length):
            raise BadRequest(f"the body has {len(body)} bytes of {length}")
        self.close_connection = self.headers.get("Connection", "").lower() == "close"
        try:
            return body.decode("utf-8")
        except UnicodeDecodeError:
            raise BadRequest("the body is no text in UTF-8") from None

    def log_message(self, format: str, *args: Any) -> None:
        """Stay silent."""

    def _answer(self, text: Callable[[], str]) -> None:
        """Answer a request whose parameters stand in a text."""
        try:
            self._send(200, json.dumps(self._answered(parameters(text(), self.command == "PUT"))), "application/json")
        except BadRequest as error:
            self._send(400, str(error), "text/plain; charset=utf-8")

    def _answered(self, given: dict[str, str]) -> JsonObject:
        exact = self.command == "PUT"
        spelt = given if exact else {key.lower(): value for key, value in given.items()}
        numbers = [
            read_parameter(one, spelt.get(one if exact else one.lower(), "0"), int)
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
        self.server.answered(self.request)


def parameters(text: str, exact: bool) -> dict[str, str]:
    """Read the parameters of a request; each is given once, and only in a body is their spelling exact.

    Raises:
        BadRequest: there are too many, or one is given twice.
    """
    try:
        pairs = parse_qsl(text, keep_blank_values=True, max_num_fields=FIELDS)
    except ValueError:
        raise BadRequest(f"there are more than {FIELDS} parameters") from None
    names = [name if exact else name.lower() for name, _ in pairs]
    doubled = next((name for name in names if names.count(name) > 1), None)
    if doubled is not None:
        raise BadRequest(f"{doubled[:60]} is given twice")
    return dict(pairs)


SETUP = ("/setup", "/setup/v1/telescope/0/setup")
SETUP_PAGE = (
    "<!DOCTYPE html><html lang=en><title>{title}</title><h1>{title}</h1>"
    "<p>There is nothing to set here; <code>cosim hardware alpaca --help</code> says what the command takes.</html>"
)
"""What a browser is shown; by the standard every device has such a page."""
MANAGEMENT: dict[str, Callable[[str], Any]] = {
    "/management/apiversions": lambda title: [1],
    "/management/v1/description": lambda title: {
        "ServerName": "mount-cosim",
        "Manufacturer": "mount-cosim",
        "ManufacturerVersion": __version__,
        "Location": "simulated",
    },
    "/management/v1/configureddevices": lambda title: [
        {"DeviceName": title, "DeviceType": "Telescope", "DeviceNumber": 0, "UniqueID": IDENTITY}
    ],
}
