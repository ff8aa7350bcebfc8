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
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import count
from threading import Thread
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import cosim
from cosim.errors import OutputError
from cosim.supervisor.members import BadRequest, Members, read_parameter
from cosim.supervisor.pointing import DeviceError
from cosim.supervisor.telescope import Telescope

PORT, DISCOVERY_PORT = 11111, 32227
DISCOVERY = b"alpacadiscovery1"
IDENTITY = "mount-cosim-simulated-mount-0"
LONGEST = 65_536
"""Bytes of a request's body."""


class Server(ThreadingHTTPServer):
    """Serves one telescope; as a context it does so in threads of its own, with discovery unless its port is taken."""

    daemon_threads = True

    def __init__(
        self, telescope: Telescope, address: str = "127.0.0.1", port: int = PORT, discovery: int = DISCOVERY_PORT
    ):
        self.telescope, self.members, self.transactions = telescope, Members(telescope), count(1)
        try:
            super().__init__((address, port), _Handler)
        except OSError as error:
            message = f"Port {port} of {address} cannot be served: {(error.strerror or str(error)).lower()}."
            raise OutputError(message, culprit=str(port)) from error
        self.discovery = _discovery(discovery)
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

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Stay silent where a client has gone in the middle of an answer."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)

    def _answer_discovery(self) -> None:
        assert self.discovery is not None
        here = str(self.server_address[0]).startswith("127.")
        while True:
            try:
                asked, sender = self.discovery.recvfrom(64)
                if asked[:16] == DISCOVERY and (not here or sender[0].startswith("127.")):
                    self.discovery.sendto(json.dumps({"AlpacaPort": self.port}).encode(), sender)
            except OSError:
                return  # closed


def _discovery(port: int) -> socket.socket | None:
    """Open the socket on which clients ask everybody who is there; None where another program has it for itself."""
    found = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
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
    server_version = f"mount-cosim/{cosim.__version__}"
    wbufsize = -1  # an answer is one packet; in two, the second one waits for the client's acknowledgement

    def do_GET(self) -> None:
        self._answer(dict(parse_qsl(urlsplit(self.path).query, keep_blank_values=True)))

    def do_PUT(self) -> None:
        length = self.headers.get("Content-Length") or "0"
        if not length.isascii() or not length.isdigit() or int(length) > LONGEST:
            self.close_connection = True
            self._send(400, f"Content-Length must be a number of at most {LONGEST} bytes", "text/plain; charset=utf-8")
            return
        body = self.rfile.read(int(length)).decode("utf-8", "replace")
        self._answer(dict(parse_qsl(body, keep_blank_values=True)))

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
