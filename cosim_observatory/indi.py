"""INDI: a telescope over TCP, as an indiserver with one driver would show it.

    client: <getProperties version="1.7"/>
    server: <defNumberVector device="..." name="EQUATORIAL_EOD_COORD" state="Ok"><defNumber name="RA">5.5...
    client: <newNumberVector device="..." name="EQUATORIAL_EOD_COORD"><oneNumber name="RA">6:30:00</oneNumber>...
    server: <setNumberVector ... state="Busy">...

Properties are those of `properties`, in INDI's standard names. All but the connection appear once a client has
connected; what changes is sent to everybody who asked for properties. What the telescope refuses is a message and the
state Alert. Reference: E. C. Downey, INDI: Instrument-Neutral Distributed Interface, version 1.7 (2007).
"""

import socket
from contextlib import suppress
from datetime import UTC, datetime
from socketserver import BaseRequestHandler, ThreadingTCPServer
from threading import Event, RLock, Thread
from time import monotonic
from typing import Any
from xml.etree.ElementTree import Element, ParseError, SubElement, XMLPullParser, tostring

from cosim.support.errors import OutputError
from cosim_observatory.pointing import DeviceError
from cosim_observatory.properties import CONNECTION, PROPERTIES, Property
from cosim_observatory.telescope import Telescope

PORT = 7624
EVERY = 0.25
"""Seconds between two looks for what has changed."""
CLIENTS, GREETING = 16, 30.0
"""At a time; s that a client has to ask for properties. Later it may be silent for a night."""
LONGEST, DEEPEST = 65_536, 4
"""Bytes and nesting of one element from a client."""


class IndiServer(ThreadingTCPServer):
    """Serves one telescope; as a context it does so in threads of its own."""

    daemon_threads, allow_reuse_address = True, True

    def __init__(self, telescope: Telescope, address: str = "127.0.0.1", port: int = PORT) -> None:
        self.telescope, self._clients = telescope, set[_Client]()
        self._lock, self._stop = RLock(), Event()
        self._shown: dict[str, tuple[str, dict[str, str]]] = {}
        try:
            super().__init__((address, port), _Client)
        except OSError as error:
            message = f"Port {port} of {address} cannot be served: {(error.strerror or str(error)).lower()}."
            raise OutputError(message, culprit=str(port)) from error
        self._serving = [Thread(target=one, daemon=True) for one in (self.serve_forever, self._look)]

    @property
    def port(self) -> int:
        """The port that is served."""
        return int(self.server_address[1])

    def __enter__(self) -> "IndiServer":
        for thread in self._serving:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self.shutdown()
        with self._lock:
            for client in self._clients:
                client.hang_up()
        self.server_close()

    def join(self, client: "_Client") -> bool:
        """Count a client in; there are so many at most."""
        with self._lock:
            if len(self._clients) >= CLIENTS:
                return False
            self._clients.add(client)
            return True

    def leave(self, client: "_Client") -> None:
        """Count a client out."""
        with self._lock:
            self._clients.discard(client)

    def define(self, client: "_Client", name: str | None) -> None:
        """Tell a client of one property or of all that there are now."""
        with self._lock, self.telescope.pointing.lock:
            for one in self._present():
                if name in (None, one.name):
                    client.send(self._vector("def", one, *self._state(one)))

    def change(self, name: str, given: dict[str, str]) -> None:
        """Do what a client wants of a property; everybody is told what came of it."""
        with self._lock, self.telescope.pointing.lock:
            found = {one.name: one for one in self._present()}.get(name)
            if found is None:
                self._tell(f'There is no property "{name}" now.')
                return
            try:
                found.change(self.telescope, given)
                alert = False
            except DeviceError as error:
                self._tell(str(error))
                alert = True
            state, values = self._state(found)
            self._broadcast(self._vector("set", found, "Alert" if alert else state, values))
            self._refresh()

    def _look(self) -> None:
        while not self._stop.wait(EVERY):
            with self._lock, self.telescope.pointing.lock:
                try:
                    self.telescope.pointing.watch()
                    self._refresh()
                except DeviceError as error:
                    self._tell(str(error))
                    return

    def _refresh(self) -> None:
        """Tell what is new, what is gone and what has changed."""
        present = {one.name: one for one in self._present()}
        for name in [one for one in self._shown if one not in present]:
            del self._shown[name]
            self._broadcast(Element("delProperty", device=self.telescope.name, name=name))
        for name, one in present.items():
            now = self._state(one)
            if self._shown.get(name) != now:
                self._broadcast(self._vector("set" if name in self._shown else "def", one, *now))
                self._shown[name] = now

    def _present(self) -> list[Property]:
        return list(PROPERTIES) if self.telescope.connected else [CONNECTION]

    def _state(self, one: Property) -> tuple[str, dict[str, str]]:
        return one.state(self.telescope), one.read(self.telescope)

    def _vector(self, verb: str, one: Property, state: str, values: dict[str, str]) -> Element:
        root = Element(
            f"{verb}{one.kind}Vector", device=self.telescope.name, name=one.name, state=state, timestamp=_now()
        )
        if verb == "def":
            root.attrib |= {"label": one.label, "group": one.group, "timeout": "60"}
            root.attrib |= {} if one.kind == "Light" else {"perm": one.permission}
            root.attrib |= {"rule": one.rule} if one.kind == "Switch" else {}
        for name, text in values.items():
            item = SubElement(root, f"{'def' if verb == 'def' else 'one'}{one.kind}", name=name)
            if verb == "def":
                item.attrib |= {"label": name} | (one.numbers(name) if one.kind == "Number" else {})
            item.text = text
        return root

    def _tell(self, text: str) -> None:
        self._broadcast(Element("message", device=self.telescope.name, timestamp=_now(), message=text))

    def _broadcast(self, element: Element) -> None:
        for client in [one for one in self._clients if one.asked]:
            client.send(element)


class _Client(BaseRequestHandler):
    """One connection; what it sends is one document without an end."""

    server: IndiServer
    request: socket.socket

    def setup(self) -> None:
        self.asked = False
        self.request.settimeout(GREETING)
        self.request.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)

    def handle(self) -> None:
        if not self.server.join(self):
            return
        parser: Any = XMLPullParser(("start", "end"))
        parser.feed("<indi>")  # also keeps out document types, which come before a root only
        depth, root, size, begun = 0, Element("nothing"), 0, monotonic()
        try:
            while data := self.request.recv(LONGEST):
                size += len(data)
                parser.feed(data)
                for event, element in parser.read_events():
                    root = element if depth == 0 else root
                    depth += 1 if event == "start" else -1
                    if not 0 < depth <= DEEPEST:
                        return
                    if event == "end" and depth == 1:
                        self._obey(element)
                        root.clear()
                        size = 0
                if size > LONGEST or (not self.asked and monotonic() - begun > GREETING):
                    return
        except (OSError, ParseError):
            return  # gone, or not speaking INDI
        finally:
            self.server.leave(self)

    def send(self, element: Element) -> None:
        """Send one element; a client that does not read is hung up on."""
        try:
            self.request.settimeout(2.0)
            self.request.sendall(tostring(element) + b"\n")
            self.request.settimeout(None)
        except OSError:
            self.hang_up()

    def hang_up(self) -> None:
        """End the connection."""
        with suppress(OSError):
            self.request.shutdown(socket.SHUT_RDWR)

    def _obey(self, element: Element) -> None:
        if element.get("device", self.server.telescope.name) != self.server.telescope.name:
            return
        if element.tag == "getProperties":
            self.request.settimeout(None)
            self.asked = True
            self.server.define(self, element.get("name"))
        elif element.tag in ("newNumberVector", "newSwitchVector", "newTextVector"):
            given = {item.get("name", ""): (item.text or "").strip() for item in element}
            self.server.change(element.get("name", ""), given)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds").removesuffix("+00:00")
