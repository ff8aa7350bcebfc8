"""ASCOM's own Python client points the simulated mount; its server answers anything, counts, and survives."""

import json
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from math import degrees
from pathlib import Path
from time import sleep
from typing import Any
from urllib.request import Request, urlopen

import numpy as np
import pytest
from alpaca_rules import BASE
from mortal import mortal
from test_alpaca_rules import ask
from waiting import until

from cosim.data.recording import Recording
from cosim.models.cache import with_fmus
from cosim.support.errors import OutputError, ScenarioError
from cosim.system.scenario import read_scenario
from cosim.system.wire import Wire
from cosim_observatory.alpaca import Server
from cosim_observatory.guide import Guide, still
from cosim_observatory.mount import SimulatedMount
from cosim_observatory.pointing import HORIZON, DeviceError, Pointing
from cosim_observatory.sky import equatorial, horizontal, sidereal_time
from cosim_observatory.telescope import HOURS, TURN, Telescope, _hours

ARCSEC = 1 / 3600
PATIENCE = 300.0


@pytest.fixture(scope="module")
def server(mount: Telescope) -> Iterator[Server]:
    with Server(mount, port=0, discovery=0) as one:
        yield one


@pytest.fixture
def telescope(server: Server) -> Iterator[Any]:
    """The client's telescope, connected, unparked, at rest, not tracking."""
    alpaca = pytest.importorskip("alpaca.telescope", reason="alpyca is not installed (pip install '.[alpaca]')")
    one = alpaca.Telescope(f"127.0.0.1:{server.port}", 0)
    one.Connected = True
    until(lambda: not one.Slewing)
    one.Unpark()
    one.Tracking = False
    yield one
    until(lambda: not one.Slewing)


def axis(number: int) -> Any:
    from alpaca.telescope import TelescopeAxes

    return TelescopeAxes(number)


def go(telescope: Any, azimuth: float, altitude: float) -> None:
    telescope.SlewToAltAzAsync(azimuth, altitude)
    assert telescope.Slewing
    until(lambda: not telescope.Slewing)
    sleep(0.1)


def test_a_slew_to_a_star_ends_on_it_and_follows_it_at_the_sidereal_rate(telescope: Any) -> None:
    go(telescope, 150.0, 50.0)
    telescope.Tracking = True
    star = (telescope.SiderealTime + 1.0) % 24, 30.0
    telescope.SlewToCoordinatesAsync(*star)
    assert telescope.Slewing
    assert telescope.Tracking
    until(lambda: not telescope.Slewing)
    sleep(0.1)
    first, begun = telescope.Azimuth, telescope.SiderealTime
    for later in (0, 2, 4):
        until(lambda later=later: telescope.SiderealTime >= begun + later / 3600)
        assert telescope.RightAscension == pytest.approx(star[0], abs=20 * ARCSEC / 15)
        assert telescope.Declination == pytest.approx(star[1], abs=10 * ARCSEC)
    assert (telescope.TargetRightAscension, telescope.TargetDeclination) == star
    turned, passed = telescope.Azimuth - first, 15 * (telescope.SiderealTime - begun)
    assert turned > 0.5 * passed


def test_tracking_from_rest_keeps_the_star_in_view_and_without_it_the_sky_moves_on(telescope: Any) -> None:
    go(telescope, 180.0, 45.0)
    before, begun = telescope.RightAscension, telescope.SiderealTime
    until(lambda: telescope.SiderealTime > begun + 4 / 3600)
    drift = telescope.RightAscension - before
    assert drift == pytest.approx(telescope.SiderealTime - begun, rel=0.2)
    telescope.Tracking = True
    until(lambda: not telescope.Slewing)
    sleep(0.1)
    before, begun = telescope.RightAscension, telescope.SiderealTime
    until(lambda: telescope.SiderealTime > begun + 4 / 3600)
    assert abs(telescope.RightAscension - before) < 5 * ARCSEC / 15


def test_an_abort_stops_a_slew_on_its_way_and_goes_on_tracking(telescope: Any) -> None:
    go(telescope, 180.0, 45.0)
    telescope.SlewToAltAzAsync(90.0, 45.0)
    until(lambda: telescope.Azimuth < 175)
    telescope.AbortSlew()
    until(lambda: not telescope.Slewing)
    stopped = telescope.Azimuth
    assert 95 < stopped < 176
    sleep(0.1)
    assert telescope.Azimuth == pytest.approx(stopped, abs=10 * ARCSEC)
    telescope.Tracking = True
    telescope.SlewToCoordinatesAsync(telescope.RightAscension, telescope.Declination - 10)
    telescope.AbortSlew()
    until(lambda: not telescope.Slewing)
    assert telescope.Tracking


def test_a_slew_to_a_direction_ends_there_and_a_parked_mount_goes_home(telescope: Any) -> None:
    go(telescope, 200.0, 60.0)
    assert (telescope.Azimuth, telescope.Altitude) == pytest.approx((200.0, 60.0), abs=10 * ARCSEC)
    telescope.Park()
    until(lambda: telescope.AtPark)
    assert telescope.Altitude == pytest.approx(86.0, abs=0.1)
    telescope.Unpark()
    assert (telescope.AtPark, telescope.Tracking) == (False, False)


def test_an_axis_moves_by_hand_until_its_rate_is_zero_or_above_the_horizon(telescope: Any) -> None:
    go(telescope, 180.0, 45.0)
    telescope.MoveAxis(axis(0), 1.5)
    until(lambda: telescope.Azimuth > 183.0)
    assert telescope.Slewing
    telescope.MoveAxis(axis(0), 0.0)
    until(lambda: not telescope.Slewing)
    assert 183.0 < telescope.Azimuth < 200.0
    assert telescope.Altitude == pytest.approx(45.0, abs=10 * ARCSEC)
    go(telescope, 180.0, 12.0)
    telescope.MoveAxis(axis(1), -2.0)
    until(lambda: not telescope.Slewing)
    assert -5 < telescope.Altitude - degrees(HORIZON) < 0.1
    go(telescope, 180.0, 45.0)


def test_directions_and_places_are_each_others_inverse_and_sidereal_time_is_that_of_the_almanac() -> None:
    random = np.random.default_rng(4)
    for _ in range(100):
        azimuth, altitude, latitude = random.uniform(0, 6.28), random.uniform(-1.5, 1.5), random.uniform(-1.5, 1.5)
        back = horizontal(*equatorial(azimuth, altitude, latitude), latitude)
        assert np.allclose(back, (azimuth, altitude), atol=1e-9)
    # The pole stands at the latitude; due east on the horizon lies the equator, six hours before it culminates.
    assert horizontal(1.0, np.pi / 2, 0.8)[1] == pytest.approx(0.8)
    assert np.allclose(equatorial(np.pi / 2, 0.0, 0.8), (-np.pi / 2, 0.0), atol=1e-9)
    # Meeus, example 12.b: 10 April 1987, 19h21m00s UT at Greenwich: 8h34m57.0896s.
    found = sidereal_time(datetime(1987, 4, 10, 19, 21, tzinfo=UTC), 0.0)
    assert [_hours(-1e-17 % TURN), _hours(0.0), _hours(TURN / 2)] == [0.0, 0.0, TURN / 2 * HOURS]  # never 24 hours
    assert degrees(found) / 15 == pytest.approx(8 + 34 / 60 + 57.0896 / 3600, abs=0.001 / 3600 * 15)


def test_clients_find_the_server_and_its_device(server: Server, telescope: Any, monkeypatch: Any) -> None:
    from alpaca import discovery, management

    monkeypatch.setattr(discovery, "port", server.discovery.getsockname()[1])
    address = f"127.0.0.1:{server.port}"
    assert address in discovery.search_ipv4(numquery=2, timeout=0.2)
    assert management.apiversions(address) == [1]
    assert management.description(address)["ServerName"] == "mount-cosim"
    (device,) = management.configureddevices(address)
    assert (device["DeviceType"], device["DeviceNumber"]) == ("Telescope", 0)


def test_a_port_that_is_taken_and_a_scenario_without_a_star_are_refused(server: Server) -> None:
    with pytest.raises(OutputError, match=f"Port {server.port} of 127.0.0.1 cannot be served: address already in use"):
        Server(server.telescope, port=server.port)
    with pytest.raises(ScenarioError, match='needs one signal of kind "star" to guide, and this has 0'):
        SimulatedMount(read_scenario("sidereal"))


def test_set_points_never_jump_and_keep_the_limits_whatever_is_asked_when() -> None:
    velocity, acceleration = np.array([0.07, 0.05]), np.array([0.04, 0.03])
    guide, step, random = Guide(np.zeros(2), velocity, acceleration), 2e-3, np.random.default_rng(3)
    found, now = [], 0.0
    for _ in range(100):
        if random.random() < 0.3:
            guide.stop(now)
        else:
            guide.follow(still(random.uniform(-1, 1, 2)), now)
        t = now + step * np.arange(1, 2 + int(random.integers(25, 4000)))
        found.append(guide(t))
        now = float(t[-1])
    q, v, a = np.moveaxis(np.concatenate(found, axis=2), 1, 0)
    assert (np.abs(v) <= 1.07 * velocity[:, np.newaxis]).all()
    assert (np.abs(a) <= 1.001 * acceleration[:, np.newaxis]).all()
    assert np.abs(np.diff(q) / step - (v[:, 1:] + v[:, :-1]) / 2).max() < 1e-5  # of the trapezoidal rule
    assert np.abs(np.diff(v) / step - (a[:, 1:] + a[:, :-1]) / 2).max() < 1e-3


def asked(address: str, member: str) -> float:
    with urlopen(f"{address}/{member}", timeout=PATIENCE) as answer:
        return float(json.load(answer)["Value"])


def test_the_command_serves_until_it_is_interrupted_and_completes_its_recording(tmp_path: Path) -> None:
    words = ("hardware", "alpaca", "--port", "0", "--speed", "4", "--out", str(tmp_path))
    with subprocess.Popen(mortal(sys.executable, "-m", "cosim", *words), stdout=subprocess.PIPE, text=True) as process:
        address = process.stdout.readline().strip()
        with urlopen(Request(f"{address}/connected", b"Connected=True", method="PUT"), timeout=PATIENCE) as answer:
            assert json.load(answer)["ErrorNumber"] == 0
        begun = asked(address, "siderealtime")
        # Simulated time, however slowly a busy computer gets there: rows of the recording are those before it.
        until(lambda: (asked(address, "siderealtime") - begun) % 24 > 1 / 3600, PATIENCE)
        process.send_signal(signal.SIGINT)
        assert process.wait() == 130
    kept = Recording.read(tmp_path / "recording.parquet", required=())
    assert kept.t[-1] > 0.5
    assert np.ptp(np.degrees(kept["altitude_position"])) < 10 * ARCSEC, "it is parked"


def test_a_simulation_that_fails_is_told_to_whoever_asks() -> None:
    scenario = with_fmus(read_scenario("two_axis"))
    wires = [one for one in scenario.wires if one.target != "azimuth.tau"]
    with SimulatedMount(replace(scenario, wires=[*wires, Wire("nobody.x", "azimuth.tau")])) as mount:
        until(lambda: bool(mount.failure))
        with pytest.raises(DeviceError, match=r'The simulation has ended: .*"nobody') as refused:
            _ = Telescope(Pointing(mount)).slewing
    assert refused.value.number == 0x500


WAITING = (
    b"PUT /api/v1/telescope/0/connected HTTP/1.1\r\nHost: x\r\nExpect: 100-continue\r\n"
    b"Content-Type: application/x-www-form-urlencoded\r\nContent-Length: 14\r\n\r\n"
)


def test_a_client_that_waits_before_it_sends_a_body_is_told_to_go_on(server: Server) -> None:
    with socket.create_connection(("127.0.0.1", server.port)) as client:
        client.settimeout(20)
        client.sendall(WAITING)
        assert client.recv(100).startswith(b"HTTP/1.1 100 Continue\r\n")
        client.sendall(b"Connected=true")
        assert client.recv(100).startswith(b"HTTP/1.1 200 OK\r\n")


def test_whatever_bytes_come_the_server_goes_on_and_counts_its_answers(server: Server) -> None:
    random = np.random.default_rng(6)
    heads = (b"%s", b"GET %s HTTP/1.1\r\n\r\n", b"PUT %s HTTP/1.1\r\nContent-Length: 9999999\r\n\r\n")
    for head in (*heads, b"PUT /api/v1/telescope/0/tracking HTTP/1.1\r\nContent-Length: %s\r\n\r\n") * 10:
        noise = random.integers(1, 256, int(random.integers(0, 60)), dtype=np.uint8).tobytes()
        with socket.create_connection(("127.0.0.1", server.port), timeout=5) as wire:
            wire.sendall(head % noise)
            wire.shutdown(socket.SHUT_WR)
            assert b" 500 " not in wire.recv(1000).partition(b"\r\n")[0]
    first, second = (json.loads(ask(server, "GET", f"{BASE}name", {"CLIENTTRANSACTIONID": 7})[1]) for _ in range(2))
    assert first["ClientTransactionID"] == 7
    assert second["ServerTransactionID"] == first["ServerTransactionID"] + 1
