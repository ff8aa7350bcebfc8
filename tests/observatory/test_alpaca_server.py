"""The server of a mount: it is found, answers requests of any kind, counts them, and survives what is no request."""

import http.client
import json
import signal
import socket
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import urlencode
from urllib.request import Request, urlopen

import numpy as np
import pytest
from alpaca_mount import ARCSEC, server, telescope, until
from mortal import mortal

from cosim.data.recording import Recording
from cosim.models.cache import with_fmus
from cosim.support.errors import OutputError, ScenarioError
from cosim.system.scenario import read_scenario
from cosim.system.wire import Wire
from cosim_observatory.alpaca import Server
from cosim_observatory.guide import Guide, still
from cosim_observatory.mount import SimulatedMount
from cosim_observatory.pointing import DeviceError, Pointing
from cosim_observatory.telescope import HOURS, TURN, Telescope, _hours

__all__ = ["server", "telescope"]

PATIENCE = 300.0
"""Seconds after which what does not happen is an error; what is waited for is always a condition."""


def test_clients_find_the_server_and_its_device(
    server: Server, telescope: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from alpaca import discovery, management

    assert server.discovery is not None
    monkeypatch.setattr(discovery, "port", server.discovery.getsockname()[1])
    address = f"127.0.0.1:{server.port}"
    assert address in discovery.search_ipv4(numquery=2, timeout=0.2)
    assert management.apiversions(address) == [1]
    assert management.description(address)["ServerName"] == "mount-cosim"
    (device,) = management.configureddevices(address)
    assert (device["DeviceType"], device["DeviceNumber"]) == ("Telescope", 0)


def request(server: Server, method: str, path: str, **given: Any) -> tuple[int, str]:
    text = urlencode(given)
    wire = http.client.HTTPConnection("127.0.0.1", server.port, timeout=5)
    wire.request(method, f"{path}?{text}" if method == "GET" else path, None if method == "GET" else text)
    answer = wire.getresponse()
    found = answer.status, answer.read().decode()
    wire.close()
    return found


BASE = "/api/v1/telescope/0/"


def test_transactions_are_counted(server: Server) -> None:
    first, second = (json.loads(request(server, "GET", f"{BASE}connected", CLIENTTRANSACTIONID=7)[1]) for _ in range(2))
    assert first["ClientTransactionID"] == 7
    assert second["ServerTransactionID"] == first["ServerTransactionID"] + 1


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
        assert process.stdout is not None
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
    broken = replace(
        scenario,
        wires=[one for one in scenario.wires if one.target != "azimuth.tau"] + [Wire("nobody.x", "azimuth.tau")],
    )
    with SimulatedMount(broken) as mount:
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


def test_an_angle_that_rounds_to_24_hours_is_0_hours() -> None:
    assert _hours(-1e-17 % TURN) == 0.0
    assert _hours(0.0) == 0.0
    assert _hours(TURN / 2) == TURN / 2 * HOURS


def test_whatever_bytes_come_the_server_goes_on(server: Server) -> None:
    random = np.random.default_rng(6)
    heads = (
        b"GET /api/v1/telescope/0/%s HTTP/1.1\r\n\r\n",
        b"PUT /api/v1/telescope/0/%s HTTP/1.1\r\nContent-Length: %s\r\n\r\n",
    )
    for trial in range(40):
        noise = random.integers(1, 256, int(random.integers(0, 60)), dtype=np.uint8).tobytes()
        text = (noise, heads[0] % noise, heads[1] % (b"tracking", noise), heads[1] % (b"tracking", b"9999999"))[
            trial % 4
        ]
        with socket.create_connection(("127.0.0.1", server.port), timeout=5) as wire:
            wire.sendall(text)
            wire.shutdown(socket.SHUT_WR)
            answer = wire.recv(1000)
        assert b" 500 " not in answer.partition(b"\r\n")[0]
    assert request(server, "GET", f"{BASE}name")[0] == 200
