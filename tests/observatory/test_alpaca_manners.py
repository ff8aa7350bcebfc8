"""Manners of the protocol: who waits for a go-ahead gets it at once, and 24 h is 0 h."""

import socket

from alpaca_mount import server

from cosim_observatory.alpaca import Server
from cosim_observatory.telescope import HOURS, TURN, _hours

__all__ = ["server"]
REQUEST = (
    b"PUT /api/v1/telescope/0/connected HTTP/1.1\r\nHost: x\r\nExpect: 100-continue\r\n"
    b"Content-Type: application/x-www-form-urlencoded\r\nContent-Length: 14\r\n\r\n"
)


def test_a_client_that_waits_before_it_sends_a_body_is_told_to_go_on(server: Server) -> None:
    with socket.create_connection(("127.0.0.1", server.port)) as client:
        client.settimeout(20)
        client.sendall(REQUEST)
        assert client.recv(100).startswith(b"HTTP/1.1 100 Continue\r\n")
        client.sendall(b"Connected=true")
        assert client.recv(100).startswith(b"HTTP/1.1 200 OK\r\n")


def test_an_angle_that_rounds_to_24_hours_is_0_hours() -> None:
    assert _hours(-1e-17 % TURN) == 0.0
    assert _hours(0.0) == 0.0
    assert _hours(TURN / 2) == TURN / 2 * HOURS
