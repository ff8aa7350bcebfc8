"""The server: a socket on 127.0.0.1, a fresh token, and its end, which takes the diagnosis with it."""

import secrets
import socket
from collections.abc import Callable
from pathlib import Path

import uvicorn

from cosim.support.errors import InputError
from cosim.support.lock import claimed
from cosim_serve.app import make_app
from cosim_serve.connection import MOST, Connection
from cosim_serve.desk import Desk
from cosim_serve.door import door
from cosim_serve.folder import CLOSED

HOST = "127.0.0.1"
TOKEN = 24
"""Bytes of a token."""


def serve(home: Path, port: int, ready: Callable[[str, Path | None], None]) -> None:
    """Answer until this process is asked to end.

    Args:
        home: folder of the jobs; one server at a time works there. One that is there keeps its mode; one that is made
            is closed to others.
        port: where to listen; 0 for one that is free.
        ready: told the address, with its token, once it is listened to, and a file that leads there, if there is one.

    Raises:
        InputError: the port is taken, or may not be used.
        OutputError: another server works in this folder.
    """
    is_new = not home.exists()
    with claimed(home, "cosim serve"), listening(port) as listener:
        if is_new:
            home.chmod(CLOSED)
        number = listener.getsockname()[1]
        token = secrets.token_urlsafe(TOKEN)
        address = f"http://{HOST}:{number}/?token={token}"
        desk = Desk(home)
        try:
            desk.reader.warm()
            with door(home, address) as file:
                ready(address, file)
                uvicorn.Server(configured(desk, token, number)).run([listener])
        finally:
            desk.close()


def configured(desk: Desk, token: str, port: int) -> uvicorn.Config:
    """Return how uvicorn is run: a connection must get on, and what a client does wrong is not said in the terminal."""
    return uvicorn.Config(
        make_app(desk, token, port),
        http=Connection,
        backlog=MOST // 2,  # so many are taken in at once
        log_level="error",
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=2,
        ws="none",
    )


def listening(port: int) -> socket.socket:
    """Return a socket that listens on this machine's own address alone (InputError)."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port))
        listener.listen()  # whoever is told the address may come before the server answers
    except (OSError, OverflowError) as error:
        listener.close()
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        text = f"Port {port} cannot be listened to: {reason}. Leave out --port for one that is free."
        raise InputError(text, culprit="--port", value=port) from error
    return listener
