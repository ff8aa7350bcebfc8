"""Attacks on what answers over a network: the page of `cosim serve`, and telescopes by Alpaca and INDI.

Each attack is a session of some requests, of which most are spoilt; after each the service must still answer a good
one, and a good one only with what it means.
"""

import http.client
import json
import re
import socket
import types
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from random import Random
from typing import Any
from urllib.parse import urlencode

import httpx2
import numpy as np
import serve_work
from attack_mutations import NUMBERS, WORDS, of_bytes, of_text
from attack_worker import Ended
from serving import PORT, asked, client_of, headers_to, listened, new

from cosim_observatory.alpaca import Server
from cosim_observatory.indi import IndiServer
from cosim_observatory.pointing import Pointing
from cosim_observatory.telescope import Telescope
from cosim_serve import looks
from cosim_serve.actions import ACTIONS
from cosim_serve.desk import Desk
from cosim_serve.uploads import Limits

REQUESTS = 6
"""Spoilt requests of a session."""
NO_ROOM = 507
MEMBERS = (
    "rightascension", "declination", "tracking", "slewing", "connected", "targetrightascension", "targetdeclination",
    "slewtocoordinatesasync", "slewtoaltazasync", "moveaxis", "axisrates", "abortslew", "park", "unpark", "utcdate",
    "devicestate", "trackingrate", "canmoveaxis", "sitelatitude", "action", "name", "no such member",
)  # fmt: skip
KEYS = ("RightAscension", "Declination", "Azimuth", "Altitude", "Axis", "Rate", "Tracking", "Connected", "ClientID")
FORM = ("role", "column", "unit", "name", "layout", "text", "tau", "q", "t", "speed", "file", "card")
VECTOR = b'<newNumberVector name="EQUATORIAL_EOD_COORD"><oneNumber name="RA">%s</oneNumber></newNumberVector>'
SWITCH = b'<newSwitchVector name="TELESCOPE_PARK"><oneSwitch name="PARK">On</oneSwitch></newSwitchVector>'
ASKED = b'<getProperties version="1.7"/>' + SWITCH
PUT = b"PUT /api/v1/telescope/0/tracking HTTP/1.1\r\nHost: x\r\nContent-Length: 27\r\n\r\nTracking=True&ClientID=12345"


class Here:
    """Looks at files in this process, in place of one that each attack would have to start."""

    look = staticmethod(looks.look)
    card = staticmethod(looks.look_at_card)
    estimate = staticmethod(looks.estimated_card)

    def warm(self) -> None: ...

    def close(self) -> None: ...

    def pid(self) -> int:
        return 0


class Still:
    """A mount that stands, and keeps what it is asked to follow to itself."""

    failure, moving, time, angles = "", False, 10.0, (1.0, 0.8)
    star = types.SimpleNamespace(latitude_deg=48.0)
    set_point = (10.0, 1.0, 0.8)

    def stop(self) -> None: ...

    def follow(self, path: Callable[..., Any]) -> None:
        path(np.linspace(10.0, 11.0, 3))


def telescope() -> Telescope:
    return Telescope(Pointing(Still(), 0.2, datetime(2026, 11, 21, 20, tzinfo=UTC)))  # type: ignore[arg-type]


def _desk(folder: Path) -> Desk:
    return Desk(folder / "data", Limits(), serve_work.quickly, Here())  # type: ignore[arg-type]


def page(folder: Path, file: Path, dice: Random) -> Callable[[], None]:
    """Drop a spoilt recording, and ask for what the page has, in any order and with any words."""

    def visit() -> None:
        desk = _desk(folder)
        client = client_of(desk)
        try:
            job = new(client)
            found = [client.put(f"{job}/files", params={"name": file.name}, content=file.read_bytes()).status_code]
            for _ in range(REQUESTS):
                with suppress(ValueError, TypeError, httpx2.InvalidURL):  # what the client itself does not send
                    found.append(_request(client, job, dice))
            found.append(0 if client.get("/").status_code == 200 and client.get(job).status_code < 500 else 599)
        finally:
            desk.queue.close()
        print(json.dumps({"statuses": found}))

    return visit


def _request(client: Any, job: str, dice: Random) -> int:
    word = dice.choice([*WORDS, *NUMBERS])
    action, name = dice.choice([*ACTIONS, word]), dice.choice(["report.html", "card.toml", "../job.json", word])
    paths = [
        "/",
        "/jobs",
        job,
        f"{job}/files",
        f"{job}/{action}",
        f"{job}/{action}",
        f"{job}/result/{name}",
        f"/{word}",
    ]
    form = {dice.choice([*FORM, word]): dice.choice([*WORDS, *NUMBERS, "run.csv"]) for _ in range(dice.randrange(4))}
    headers = dice.choice([{}, {}, {}, {"origin": "http://other"}, {"host": word}, {"content-length": word}])
    given: dict[str, Any] = {"params": form} if dice.random() < 0.3 else {"data": form}
    method = dice.choice(["GET", "POST", "POST", "POST", "PUT", "DELETE", "HEAD", "OPTIONS", "PATCH"])
    return int(client.request(method, dice.choice(paths), headers=headers, **given).status_code)


def page_bytes(folder: Path, file: Path, dice: Random) -> Callable[[], None]:
    """Send spoilt bytes to the server of the page, which then answers a good request."""

    def visit() -> None:
        desk, found = _desk(folder), []
        try:
            with listened(desk) as port:
                for _ in range(REQUESTS):
                    sent = file.read_bytes().replace(b"PORT", b"%d" % port)
                    _spoken(port, dice.choice((of_bytes, of_text))(dice, sent)[1])
                    found.append(asked(port, "GET", "/", seconds=20)[0])
        finally:
            desk.queue.close()
        print(json.dumps({"statuses": found}))

    return visit


def request_of_page() -> bytes:
    """A good request of the page, as bytes."""
    head = {**headers_to(PORT), "Host": "127.0.0.1:PORT", "Content-Length": "9"}
    text = "".join(f"{name}: {value}\r\n" for name, value in head.items()).replace(str(PORT), "PORT")
    return f"POST /jobs HTTP/1.1\r\n{text}\r\ntext=none".encode()


def _spoken(port: int, data: bytes, seconds: float = 0.3) -> bytes:
    """What a service says to bytes within a short time."""
    said = b""
    with suppress(OSError), socket.create_connection(("127.0.0.1", port), 5) as line:
        line.settimeout(seconds)
        line.sendall(data)
        with suppress(OSError):
            line.shutdown(socket.SHUT_WR)
        while piece := line.recv(65536):
            said += piece
    return said


def alpaca(folder: Path, file: Path, dice: Random) -> Callable[[], None]:
    """Ask a telescope by Alpaca for anything, with any values, and then for its name."""

    def visit() -> None:
        found = []
        with Server(telescope(), port=0, discovery=0) as server:
            for _ in range(REQUESTS):
                found.append(_asked(server.port, dice))
                _spoken(server.port, of_bytes(dice, file.read_bytes())[1])
                found.append(_answer(server.port, "GET", "/api/v1/telescope/0/name?ClientID=1", "")[0])
        print(json.dumps({"statuses": found}))

    return visit


def _asked(port: int, dice: Random) -> int:
    words = [one.replace("\udcff", "") for one in (*NUMBERS, *WORDS)]
    text = urlencode({dice.choice(KEYS): dice.choice(words) for _ in range(dice.randrange(4))})
    path, method = f"/api/v1/telescope/0/{dice.choice(MEMBERS).replace(' ', '%20')}", dice.choice(("GET", "PUT"))
    if method == "GET":
        path, text = f"{path}?{text}", ""
    status, said = _answer(port, method, path, text)
    if status == 200:  # numbers that are none are no JSON
        told = json.loads(said, parse_constant=lambda text: 1 / 0)
        status = 200 if {"ErrorNumber", "ErrorMessage", "ServerTransactionID"} <= set(told) else 599
    return status


def _answer(port: int, method: str, path: str, body: str) -> tuple[int, bytes]:
    client = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    client.request(method, path, body or None, {"Content-Type": "application/x-www-form-urlencoded"})
    answer = client.getresponse()
    said = answer.read()
    client.close()
    return answer.status, said


def indi(folder: Path, file: Path, dice: Random) -> Callable[[], None]:
    """Send spoilt elements to a telescope by INDI, and then ask it for its properties."""

    def visit() -> None:
        found = []
        with IndiServer(telescope(), port=0) as server:
            for _ in range(REQUESTS):
                good = VECTOR % (dice.choice(NUMBERS).encode("utf-8", "replace"),)
                sent = dice.choice((of_bytes, of_text))(dice, file.read_bytes() + good)[1]
                said = _spoken(server.port, sent)
                told = _spoken(server.port, b'<getProperties version="1.7"/>')
                found.append(200 if b"<def" in told and not re.search(rb">\s*(nan|-?inf)\s*<", said + told) else 599)
        print(json.dumps({"statuses": found}))

    return visit


def served_well(folder: Path, ended: Ended, file: Path, good: bytes) -> bool:
    """No request ended in an error of the server, and every good one was answered."""
    with suppress(ValueError):
        return all(one < 500 or one == NO_ROOM for one in json.loads(ended.out)["statuses"])
    return False
