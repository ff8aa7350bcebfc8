"""Connections that say nothing, or never end: they keep the page from nobody, and say nothing in the terminal."""

import logging
import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
import serve_work
from serving import _path, asked, client_of, desk_at, headers_to, listened, new, until

from cosim_serve import connection
from cosim_serve.desk import Desk

__all__ = ["_path"]


@pytest.fixture
def there(tmp_path: Path) -> Iterator[tuple[Desk, int]]:
    with desk_at(tmp_path / "data", serve_work.quickly) as desk, listened(desk) as port:
        yield desk, port
        while LINES:
            LINES.pop().close()


LINES: list[socket.socket] = []
"""Connections of a test, which end with it."""


def line(port: int, text: str = "") -> socket.socket:
    made = socket.create_connection(("127.0.0.1", port), timeout=60)
    LINES.append(made)
    made.sendall(text.replace("\n", "\r\n").encode())
    return made


def is_ended(one: socket.socket) -> bool:
    """Whether the other side has ended a connection."""
    one.setblocking(False)
    try:
        while text := one.recv(65536):
            assert text
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True


def head_of(port: int, method: str, path: str) -> str:
    said = {"Host": f"127.0.0.1:{port}"} | headers_to(port)
    return f"{method} {path} HTTP/1.1\n" + "".join(f"{key}: {value}\n" for key, value in said.items())


def test_many_connections_that_say_nothing_do_not_silence_the_page(
    there: tuple[Desk, int],
    capfd: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _, port = there
    monkeypatch.setattr(connection, "MOST", 16)
    texts = ("", "GET / HTTP/1.1\nHost: ", "GET / HT")
    lines = [line(port, text) for _ in range(connection.MOST) for text in texts]
    for _ in range(3):
        assert asked(port, "GET", "/", seconds=30)[0] == 200
    monkeypatch.setattr(connection, "HEAD", 0.5)
    until(lambda: all(map(is_ended, lines)))
    assert capfd.readouterr() == ("", "")
    assert [one for one in caplog.records if one.levelno > logging.INFO] == []


def test_a_head_that_does_not_end_is_ended(there: tuple[Desk, int], monkeypatch: pytest.MonkeyPatch) -> None:
    _, port = there
    monkeypatch.setattr(connection, "HEAD", 0.5)
    monkeypatch.setattr(connection, "LOOK", 0.1)
    slow = line(port, "GET / HTTP/1.1\n")

    def dripped() -> bool:
        try:
            slow.sendall(b"X: y\r\n")
        except OSError:
            return True
        return is_ended(slow)

    until(dripped)


@pytest.mark.parametrize("how", ["chunked", "stated"])
def test_a_body_that_does_not_get_on_is_ended_and_leaves_nothing(
    there: tuple[Desk, int], how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    desk, port = there
    job = new(client_of(desk))
    monkeypatch.setattr(connection, "STALLED", 0.5)
    monkeypatch.setattr(connection, "LOOK", 0.1)
    size = "Transfer-Encoding: chunked\n\n" if how == "chunked" else "Content-Length: 1000000\n\n"
    slow = line(port, head_of(port, "PUT", f"{job}/files?name=a.csv") + size)
    part = b"1\r\nx\r\n" if how == "chunked" else b"x"

    def dripped() -> bool:
        try:
            slow.sendall(part)
        except OSError:
            return True
        return is_ended(slow)

    until(dripped)
    until(lambda: not [one for one, _, _ in os.walk(desk.store.home) if Path(one).parent.name == "arriving"])
    assert not desk.store.all()[0].uploads


def test_an_answer_that_nobody_takes_is_ended(there: tuple[Desk, int], monkeypatch: pytest.MonkeyPatch) -> None:
    desk, port = there
    monkeypatch.setattr(connection, "STALLED", 0.5)
    monkeypatch.setattr(connection, "LOOK", 0.1)
    job = desk.store.new()
    desk.store.result(job.id).mkdir()
    (desk.store.result(job.id) / "a.fmu").write_bytes(bytes(30_000_000))
    ended, end = threading.Event(), connection.Connection.connection_lost
    monkeypatch.setattr(connection.Connection, "connection_lost", lambda *given: (end(*given), ended.set())[0])
    deaf = line(port, head_of(port, "GET", f"/jobs/{job.id}/result/a.fmu") + "\n")
    assert ended.wait(60)  # nothing is taken meanwhile, and buffers do not hold it all
    taken = 0
    with suppress(ConnectionError):
        while text := deaf.recv(1 << 20):
            taken += len(text)
    assert taken < 30_000_000


def test_a_body_that_gets_on_slowly_arrives(there: tuple[Desk, int], monkeypatch: pytest.MonkeyPatch) -> None:
    desk, port = there
    job = new(client_of(desk))
    monkeypatch.setattr(connection, "STALLED", 3.0)
    monkeypatch.setattr(connection, "LEAST", 10)
    monkeypatch.setattr(connection, "LOOK", 0.1)
    slow = line(port, head_of(port, "PUT", f"{job}/files?name=a.csv") + "Content-Length: 3000\n\n")
    for _ in range(20):
        slow.sendall(b"1,2,3,4,5," * 15)
        time.sleep(0.2)
    assert slow.recv(100).startswith(b"HTTP/1.1 201")


@pytest.mark.parametrize(
    "text",
    [
        "\x00\x01garbage\n\n",
        "GET / HTTP/9.9\n\n",
        "GET / HTTP/1.1\nHost: a\nUpgrade: websocket\nConnection: upgrade\n\n",
        "POST /jobs HTTP/1.1\nContent-Length: -1\n\n",
        "X" * 100_000,
    ],
)
def test_what_is_no_request_is_refused_and_says_nothing_in_the_terminal(
    there: tuple[Desk, int], text: str, capfd: pytest.CaptureFixture[str]
) -> None:
    _, port = there
    for _ in range(5):
        with suppress(ConnectionError):  # the rest of it was not read
            assert line(port, text).recv(100).startswith(b"HTTP/1.1 4")
    assert asked(port, "GET", "/")[0] == 200
    assert capfd.readouterr() == ("", "")
