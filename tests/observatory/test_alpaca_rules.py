"""Every rule of `alpaca_rules.py` over HTTP; and what a server does with clients that keep no rule at all."""

import http.client
import json
import socket
import threading
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from math import radians
from time import monotonic
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlencode

import numpy as np
import pytest
from alpaca_rules import BAD, BASE, RULES, Rule

import cosim_observatory.alpaca as alpaca
from cosim_observatory.alpaca import CONNECTIONS, Server
from cosim_observatory.pointing import DeviceError, Pointing
from cosim_observatory.properties import PROPERTIES
from cosim_observatory.telescope import Telescope

INDI = {one.name: one for one in PROPERTIES}


class Prompt:
    """A mount that is at once where it is sent: rules need no friction."""

    def __init__(self) -> None:
        self.star, self.failure, self.moving, self.time = SimpleNamespace(latitude_deg=49.0), "", False, 0.0
        self._at = (radians(180.0), radians(45.0))

    @property
    def angles(self) -> tuple[float, float]:
        return self._at

    @property
    def set_point(self) -> tuple[float, float, float]:
        return (self.time, *self._at)

    def follow(self, path: Any) -> None:
        found = path(np.array([self.time]))
        self._at = float(found[0, 0, 0]), float(found[1, 0, 0])

    def stop(self) -> None:
        """It is at rest already."""


def free() -> Telescope:
    mount: Any = Prompt()
    telescope = Telescope(Pointing(mount, radians(9.0), datetime(2026, 11, 21, 20, tzinfo=UTC)))
    telescope.connected = True
    telescope.unpark()
    return telescope


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with Server(free(), port=0, discovery=0) as one:
        yield one


def bring(server: Server, state: str) -> None:
    """Make a telescope new, in a state."""
    fresh = free()
    server.telescope.__dict__.update(fresh.__dict__)
    server.members._lock = fresh.pointing.lock
    if state == "tracking":
        server.telescope.tracking = True
    if state == "parked":
        server.telescope.park()
        assert not server.telescope.slewing
    server.telescope.connected = state != "disconnected"


def ask(server: Server, method: str, path: str, given: dict[str, Any]) -> tuple[int, str]:
    wire, text = http.client.HTTPConnection("127.0.0.1", server.port, timeout=20), urlencode(given)
    wire.request(method, f"{path}?{text}" if method == "GET" else path, None if method == "GET" else text)
    answer = wire.getresponse()
    found = answer.status, answer.read().decode()
    wire.close()
    return found


def test_there_are_as_many_rules_as_the_standard_needs() -> None:
    assert len(RULES) >= 150
    assert len({str(rule) + rule.state for rule in RULES}) == len(RULES)


@pytest.mark.parametrize("rule", RULES, ids=str)
def test_a_rule_of_the_standard_holds(server: Server, rule: Rule) -> None:
    bring(server, rule.state)
    status, text = ask(server, rule.method, rule.path, rule.given)
    if rule.wanted == BAD:
        assert status == BAD
        assert text.strip()
        return
    assert status == 200
    answer = json.loads(text)
    assert set(answer) - {"Value"} == {"ClientTransactionID", "ServerTransactionID", "ErrorNumber", "ErrorMessage"}
    assert answer["ServerTransactionID"] >= 1
    if isinstance(rule.wanted, int):
        assert answer["ErrorNumber"] == rule.wanted
        assert bool(answer["ErrorMessage"]) == bool(rule.wanted)
        assert not (rule.wanted and "Value" in answer)
    else:
        assert answer["ErrorNumber"] == 0
        assert rule.wanted(answer["Value"]), answer["Value"]


@pytest.mark.parametrize("page", ["/setup", "/setup/v1/telescope/0/setup"])
def test_a_browser_is_shown_a_page_of_setup(server: Server, page: str) -> None:
    status, text = ask(server, "GET", page, {})
    assert (status, "mount-cosim simulated mount" in text) == (200, True)


def test_a_slew_that_is_refused_sets_nothing(server: Server) -> None:
    bring(server, "tracking")
    telescope = server.telescope
    telescope.slew_to_coordinates_async(0.5, 80.0)
    place = telescope.pointing.angles
    low = (telescope.sidereal_time + 12) % 24
    for given in ({"RightAscension": 3, "Declination": 91}, {"RightAscension": low, "Declination": -60}):
        _, text = ask(server, "PUT", f"{BASE}slewtocoordinatesasync", given)
        assert json.loads(text)["ErrorNumber"] != 0
        assert (telescope.target_right_ascension, telescope.target_declination) == (0.5, 80.0)
        assert telescope.pointing.angles == place


@pytest.mark.parametrize(
    ("name", "given"),
    [("EQUATORIAL_EOD_COORD", {"RA": "0", "DEC": "-60"}), ("HORIZONTAL_COORD", {"AZ": "0", "ALT": "2"})],
)
@pytest.mark.parametrize("tracking", [True, False])
def test_over_indi_a_slew_that_is_refused_leaves_tracking_as_it_was(name: str, given: Any, tracking: bool) -> None:
    telescope = free()
    telescope.tracking = tracking
    with pytest.raises(DeviceError):
        INDI[name].change(telescope, given)
    assert telescope.tracking == tracking


@pytest.mark.parametrize(
    ("name", "given", "sentence"),
    [
        ("CONNECTION", {"CONNECT": "Off"}, "exactly one must be On, not 0"),
        ("CONNECTION", {"CONNECT": "On", "DISCONNECT": "On"}, "exactly one must be On, not 2"),
        ("TELESCOPE_PARK", {"PARK": "Off"}, "exactly one must be On"),
        ("TELESCOPE_PARK", {"PARK": "on"}, '"on" is neither On nor Off'),
        ("TELESCOPE_TRACK_STATE", {"TRACK_ON": ""}, '"" is neither On nor Off'),
        ("TELESCOPE_MOTION_NS", {"MOTION_NORTH": "On", "MOTION_SOUTH": "On"}, "at most one must be On, not 2"),
        ("HORIZONTAL_COORD", {"AZ": "1_0", "ALT": "45"}, 'AZ = "1_0" is no number'),
        ("HORIZONTAL_COORD", {"AZ": "10:-5", "ALT": "45"}, "is no number"),
        ("HORIZONTAL_COORD", {"AZ": "10:60:00", "ALT": "45"}, "is no number"),
        ("HORIZONTAL_COORD", {"AZ": "٣", "ALT": "45"}, "is no number"),
        ("HORIZONTAL_COORD", {"AZ": "9" * 5000, "ALT": "45"}, "is no number"),
        ("HORIZONTAL_COORD", {"AZ": "1:2:3:4", "ALT": "45"}, "is no number"),
        ("HORIZONTAL_COORD", {"AZ": "1e999", "ALT": ""}, "is no number"),
    ],
)
def test_indi_takes_switches_and_numbers_strictly(name: str, given: dict[str, str], sentence: str) -> None:
    telescope = free()
    with pytest.raises(DeviceError, match=sentence):
        INDI[name].change(telescope, given)
    assert telescope.connected
    assert [telescope.at_park, telescope.tracking, telescope.slewing] == [False] * 3


HIDDEN = f"PUT {BASE}tracking HTTP/1.1\r\nContent-Length: 13\r\n\r\nTracking=True".encode()
BODIES = [
    (b"PUT %stracking HTTP/1.1\r\nContent-Length: 100\r\n\r\nTracking=True", b"400"),
    (b"PUT %stracking HTTP/1.1\r\nContent-Length: 70000\r\n\r\n", b"400"),
    (b"PUT %stracking HTTP/1.1\r\nContent-Length: -1\r\n\r\n", b"400"),
    (b"PUT %stracking HTTP/1.1\r\nContent-Length: 99999999999999999999\r\n\r\n", b"400"),
    (b"PUT %stracking HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\nd\r\nTracking=True\r\n0\r\n\r\n", b"400"),
    (b"PUT %stracking HTTP/1.1\r\nContent-Length: 15\r\n\r\nTracking=True&\xff", b"400"),
    (b"PUT %stracking HTTP/1.1\r\nContent-Length: 27\r\n\r\nTracking=True&Tracking=True", b"400"),
    (b"PUT %stracking HTTP/1.1\r\nContent-Length: 601\r\n\r\n" + b"a=1&" * 150 + b"a", b"400"),
    (b"GET %sname?ClientID=1&clientid=2 HTTP/1.1\r\n\r\n", b"400"),
    (b"GET %sname HTTP/1.1\r\n" + b"X: y\r\n" * 200 + b"\r\n", b"431"),
    (b"GET %sname?" + b"x" * 70_000 + b" HTTP/1.1\r\n\r\n", b"414"),
    (b"DELETE %sname HTTP/1.1\r\n\r\n", b"501"),
    (b"GET %%sname HTTP/1.1\r\nContent-Length: %d\r\n\r\n%s" % (len(HIDDEN), HIDDEN), b"200"),
]


def said_to(server: Server, raw: bytes) -> bytes:
    """All that is answered to some bytes, after which nothing more is sent."""
    with socket.create_connection(("127.0.0.1", server.port), timeout=20) as wire:
        wire.sendall(raw)
        wire.shutdown(socket.SHUT_WR)
        return b"".join(iter(lambda: wire.recv(65536), b""))


@pytest.mark.parametrize(("raw", "status"), BODIES)
def test_a_request_that_is_none_or_hides_in_a_body_sets_nothing(server: Server, raw: bytes, status: bytes) -> None:
    bring(server, "free")
    answer = said_to(server, raw.replace(b"%s", BASE.encode(), 1))
    assert answer.partition(b"\r\n")[0].split()[1] == status
    assert answer.count(b"HTTP/1.1 ") == 1, "what comes behind is no request"
    assert not server.telescope.tracking


def test_connections_are_counted_and_those_on_which_nothing_is_done_are_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(alpaca, "REQUEST", 1.0)
    with Server(free(), port=0, discovery=0) as server:
        many = [socket.create_connection(("127.0.0.1", server.port), timeout=20) for _ in range(CONNECTIONS)]
        begun = monotonic()
        stop = threading.Event()

        def drip() -> None:
            while not stop.wait(0.1):
                try:
                    many[0].sendall(b"X")
                except OSError:
                    return

        thread = threading.Thread(target=drip)
        thread.start()
        with socket.create_connection(("127.0.0.1", server.port), timeout=20) as late:
            assert late.recv(100) == b"", "one too many"
        for wire in many:
            with suppress(ConnectionResetError):
                assert wire.recv(100) == b""
            wire.close()
        assert monotonic() - begun < 15, "also the one that drips"
        stop.set()
        thread.join()
        assert ask(server, "GET", f"{BASE}name", {})[0] == 200


def test_discovery_goes_on_after_a_question_that_cannot_be_answered() -> None:
    with Server(free(), port=0, discovery=0) as server:
        assert server.discovery
        place = ("127.0.0.1", server.discovery.getsockname()[1])
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
            client.settimeout(10)
            for wrong in (b"", b"alpaca", b"x" * 5000, b"ALPACADISCOVERY1"):
                client.sendto(wrong, place)
            client.sendto(b"alpacadiscovery1", place)
            assert json.loads(client.recv(100)) == {"AlpacaPort": server.port}
