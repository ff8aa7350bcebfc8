"""INDI's own command-line tools point the simulated mount, at once and through an indiserver between."""

import shutil
import socket
import subprocess
from collections.abc import Iterator
from contextlib import closing, suppress
from time import sleep
from typing import Any

import pytest
from mortal import mortal
from waiting import until

from cosim.support.errors import OutputError
from cosim_observatory import indi
from cosim_observatory.indi import CLIENTS, IndiServer
from cosim_observatory.properties import number
from cosim_observatory.telescope import Telescope

ARCSEC = 1 / 3600
DEVICE = "mount-cosim simulated mount"


@pytest.fixture(scope="module")
def server(mount: Telescope) -> Iterator[IndiServer]:
    with IndiServer(mount, port=0) as one:
        yield one


def tool(name: str) -> str:
    found = shutil.which(f"indi_{name}prop") or shutil.which(name)
    if found is None:
        pytest.skip("INDI's tools are not installed (apt-get install indi-bin)")
    return found


def get(port: int, what: str = "*.*", seconds: str = "5") -> dict[str, str]:
    command = [tool("get"), "-p", str(port), "-t", seconds, f"{DEVICE}.{what}"]
    lines = subprocess.run(command, capture_output=True, text=True, check=False).stdout.splitlines()
    return dict(line.removeprefix(f"{DEVICE}.").split("=", 1) for line in lines)


def put(port: int, kind: str, what: str) -> None:
    subprocess.run([tool("set"), "-p", str(port), kind, f"{DEVICE}.{what}"], check=True)


@pytest.fixture
def port(server: IndiServer) -> int:
    """The port, with the telescope connected, free, at rest and not tracking."""
    put(server.port, "-s", "CONNECTION.CONNECT=On")
    telescope = server.telescope
    until(lambda: telescope.connected and not telescope.slewing)
    telescope.unpark()
    telescope.tracking = False
    return server.port


def test_the_tools_see_the_telescope_and_only_the_connection_before_it_is_connected(server: IndiServer) -> None:
    put(server.port, "-s", "CONNECTION.DISCONNECT=On")
    until(lambda: not server.telescope.connected)
    assert get(server.port, seconds="1") == {"CONNECTION.CONNECT": "Off", "CONNECTION.DISCONNECT": "On"}
    put(server.port, "-s", "CONNECTION.CONNECT=On")
    until(lambda: server.telescope.connected)
    found = get(server.port, seconds="1")
    assert found["DRIVER_INFO.DRIVER_INTERFACE"] == "1"
    assert float(found["GEOGRAPHIC_COORD.LAT"]) == 49.0
    assert float(found["HORIZONTAL_COORD.ALT"]) == pytest.approx(server.telescope.altitude, abs=0.1)
    assert found["TELESCOPE_PARK.PARK"] == "On"


def test_a_slew_to_a_star_given_in_sixtieths_ends_on_it_and_tracks(port: int) -> None:
    star = (get(port, "TIME_LST.LST")["TIME_LST.LST"], "40:30:00")
    put(port, "-n", f"EQUATORIAL_EOD_COORD.RA;DEC={star[0]};{star[1]}")
    until(lambda: get(port, "EQUATORIAL_EOD_COORD._STATE") == {"EQUATORIAL_EOD_COORD._STATE": "Ok"})
    sleep(0.1)
    found = get(port, "EQUATORIAL_EOD_COORD.RA") | get(port, "EQUATORIAL_EOD_COORD.DEC")
    assert float(found["EQUATORIAL_EOD_COORD.RA"]) == pytest.approx(float(star[0]), abs=20 * ARCSEC / 15)
    assert float(found["EQUATORIAL_EOD_COORD.DEC"]) == pytest.approx(40.5, abs=10 * ARCSEC)
    assert get(port, "TELESCOPE_TRACK_STATE.TRACK_ON") == {"TELESCOPE_TRACK_STATE.TRACK_ON": "On"}


def test_slew_abort_hand_park_and_unpark(server: IndiServer, port: int) -> None:
    telescope = server.telescope
    put(port, "-n", "HORIZONTAL_COORD.AZ;ALT=180;60")
    until(lambda: not telescope.slewing and abs(telescope.altitude - 60) < 0.01)
    put(port, "-n", "HORIZONTAL_COORD.AZ;ALT=100;60")
    until(lambda: telescope.azimuth < 178)
    put(port, "-s", "TELESCOPE_ABORT_MOTION.ABORT=On")
    until(lambda: not telescope.slewing)
    assert 101 < telescope.azimuth < 178
    put(port, "-s", "TELESCOPE_MOTION_NS.MOTION_NORTH=On")
    until(lambda: telescope.altitude > 60.5)
    assert get(port, "TELESCOPE_MOTION_NS.MOTION_NORTH") == {"TELESCOPE_MOTION_NS.MOTION_NORTH": "On"}
    put(port, "-s", "TELESCOPE_MOTION_NS.MOTION_NORTH=Off")
    until(lambda: not telescope.slewing)
    put(port, "-s", "TELESCOPE_PARK.PARK=On")
    until(lambda: get(port, "TELESCOPE_PARK._STATE") == {"TELESCOPE_PARK._STATE": "Ok"})
    assert telescope.at_park
    put(port, "-s", "TELESCOPE_PARK.UNPARK=On")
    until(lambda: not telescope.at_park)


def test_through_an_indiserver_it_is_the_same_telescope(server: IndiServer, port: int) -> None:
    with closing(socket.socket()) as free:
        free.bind(("127.0.0.1", 0))
        between = free.getsockname()[1]
    command = mortal(tool("indiserver"), "-p", str(between), f"{DEVICE}@127.0.0.1:{port}")
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            until(lambda: "GEOGRAPHIC_COORD.LAT" in get(between, "GEOGRAPHIC_COORD.LAT", "1"))
            put(between, "-n", "HORIZONTAL_COORD.AZ;ALT=200;70")
            until(lambda: abs(server.telescope.azimuth - 200) < 0.01 and not server.telescope.slewing)
            assert float(get(between, "HORIZONTAL_COORD.ALT")["HORIZONTAL_COORD.ALT"]) == pytest.approx(70, abs=0.01)
        finally:
            process.terminate()


def talk(port: int, text: str, enough: str) -> str:
    """Send a text and read until an answer has come."""
    with socket.create_connection(("127.0.0.1", port), timeout=10) as wire:
        wire.sendall(f'<getProperties version="1.7"/>{text}'.encode())
        said = ""
        while enough not in said:
            more = wire.recv(65536)
            assert more, said
            said += more.decode()
    return said


def vector(kind: str, name: str, **items: str) -> str:
    inner = "".join(f'<one{kind} name="{key}">{value}</one{kind}>' for key, value in items.items())
    return f'<new{kind}Vector device="{DEVICE}" name="{name}">{inner}</new{kind}Vector>'


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (vector("Number", "HORIZONTAL_COORD", AZ="10", ALT="-5"), "Altitude -5.000 deg is outside 5 to 89.5 deg."),
        (vector("Number", "HORIZONTAL_COORD", AZ="10"), 'ALT = "" is no number.'),
        (vector("Number", "EQUATORIAL_EOD_COORD", RA="x", DEC="5"), 'RA = "x" is no number.'),
        (vector("Switch", "ON_COORD_SET", SYNC="On"), 'ON_COORD_SET has no element "SYNC"; it has: TRACK.'),
        (vector("Number", "GEOGRAPHIC_COORD", LAT="5"), "GEOGRAPHIC_COORD can only be read."),
        (vector("Switch", "DANCE", ON="On"), 'There is no property "DANCE" now.'),
    ],
)
def test_what_is_refused_is_told_in_a_sentence(server: IndiServer, text: str, sentence: str) -> None:
    server.telescope.connected = True
    until(lambda: not server.telescope.slewing)
    server.telescope.unpark()
    server.telescope.tracking = False
    said = talk(server.port, text, "<message")
    said += "" if "DANCE" in text else talk(server.port, text, 'state="Alert"')
    assert sentence in said.replace("&quot;", '"')
    assert not server.telescope.slewing


NO_INDI = [b"GET / HTTP/1.1\r\n\r\n</x>", b'<!DOCTYPE x [<!ENTITY a "b">]>', b"</indi>", b"<a>" * 100]
TOO_LONG = [b"<a " + b"x" * 200_000, b"<getProperties>" + b"<!-- -->" * 20_000]


@pytest.mark.parametrize("text", [*NO_INDI, *TOO_LONG], ids=lambda text: text[:15].decode())
def test_a_client_that_speaks_no_indi_is_hung_up_on(server: IndiServer, text: bytes) -> None:
    with socket.create_connection(("127.0.0.1", server.port), timeout=20) as wire, suppress(ConnectionError):
        wire.sendall(text)
        assert wire.recv(100) == b""


def test_a_client_that_asks_for_nothing_or_is_one_too_many_is_hung_up_on(server: IndiServer, monkeypatch: Any) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(indi, "GREETING", 0.5)
        with socket.create_connection(("127.0.0.1", server.port), timeout=20) as wire:
            assert wire.recv(100) == b""
    many = [socket.create_connection(("127.0.0.1", server.port), timeout=10) for _ in range(CLIENTS)]
    try:
        sleep(0.1)
        with socket.create_connection(("127.0.0.1", server.port), timeout=10) as late:
            assert late.recv(100) == b""
    finally:
        for wire in many:
            wire.close()
    with pytest.raises(OutputError, match=f"Port {server.port} of 127.0.0.1 cannot be served"):
        IndiServer(server.telescope, port=server.port)


def test_numbers_may_be_in_sixtieths() -> None:
    assert number({"DEC": "-0:30:36"}, "DEC") == -0.51
    assert number({"DEC": "12 30"}, "DEC") == 12.5
    assert number({"DEC": " 7.25 "}, "DEC") == 7.25
