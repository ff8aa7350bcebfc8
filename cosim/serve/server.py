"""The server: a socket on 127.0.0.1, a fresh token, and its end, which takes the diagnosis with it."""

import secrets
import socket
import webbrowser
from collections.abc import Callable
from pathlib import Path

import uvicorn

from cosim.serve.app import make_app
from cosim.serve.desk import Desk
from cosim.support.errors import InputError
from cosim.support.lock import claimed

HOST = "127.0.0.1"
TOKEN = 24
"""Bytes of a token."""


def serve(home: Path, port: int, ready: Callable[[str], None]) -> None:
    """Answer until this process is asked to end.

    Args:
        home: folder of the jobs; one server at a time works there.
        port: where to listen; 0 for one that is free.
        ready: told the address, with its token, once it is listened to.

    Raises:
        InputError: the port is taken, or may not be used.
        OutputError: another server works in this folder.
    """
    with claimed(home, "cosim serve"), listening(port) as listener:
        number = listener.getsockname()[1]
        token = secrets.token_urlsafe(TOKEN)
        desk = Desk(home)
        try:
            desk.reader.warm()
            ready(f"http://{HOST}:{number}/?token={token}")
            config = uvicorn.Config(
                make_app(desk, token, number),
                log_level="warning",
                access_log=False,
                server_header=False,
                timeout_graceful_shutdown=2,
                ws="none",
            )
            uvicorn.Server(config).run([listener])
        finally:
            desk.close()


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


def show(address: str) -> None:
    """Open an address in the user's browser, if there is one."""
    webbrowser.open(address)
