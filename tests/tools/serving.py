"""Help for the tests of the page: a desk, a client that has the token, recordings and a card."""

import atexit
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
import pytest
import serve_work
from waiting import until

pytest.importorskip("starlette", reason="the extra [serve] is not installed")
pytest.importorskip("uvicorn", reason="the extra [serve] is not installed")
import uvicorn
from starlette.testclient import TestClient

from cosim_serve.app import make_app
from cosim_serve.desk import Desk
from cosim_serve.job import Job
from cosim_serve.reader import Reader
from cosim_serve.server import configured, listening
from cosim_serve.uploads import Limits

TOKEN, PORT = "right", 8000
HERE = Path(__file__).parents[1]
ORIGIN = f"http://127.0.0.1:{PORT}"
CARD = '[mount]\nname = "azimuth"\ninertia = 30.0\n[friction]\nmodel = "coulomb"\nFc = 2.5\n'


def recording(rows: int = 400, seed: int = 0) -> bytes:
    """A small recording as CSV."""
    t = np.arange(rows) * 0.01
    noise = np.random.default_rng(seed).normal(0, 0.01, rows)
    table = np.column_stack([t, np.sin(t) + noise, 0.1 * np.cos(t)])
    return ("t,tau,q\n" + "\n".join(",".join(f"{x:.6g}" for x in row) for row in table)).encode()


def client_of(desk: Desk, token: str = TOKEN) -> TestClient:
    """A client that came with the token, as the page does."""
    client = TestClient(make_app(desk, TOKEN, PORT), base_url=ORIGIN, headers={"origin": ORIGIN})
    client.get(f"/?token={token}")
    return client


def put(client: TestClient, job: str, name: str, content: bytes) -> httpx2.Response:
    return client.put(f"{job}/files", params={"name": name}, content=content)


def act(client: TestClient, job: str, action: str, **form: str) -> httpx2.Response:
    return client.post(f"{job}/{action}", data=form)


def new(client: TestClient) -> str:
    """The address of a new draft."""
    return str(client.post("/jobs").url.path)


def ready(client: TestClient, *names: str) -> str:
    """The address of a draft that can be diagnosed."""
    job = new(client)
    for number, name in enumerate(names or ("run1.csv", "heldout.csv")):
        assert put(client, job, name, recording(seed=number)).status_code == 201
    assert put(client, job, "axis.toml", CARD.encode()).status_code == 201
    return job


def id_of(job: str) -> str:
    return job.rpartition("/")[2]


def state_of(desk: Desk, job: str) -> Job:
    return desk.store.get(id_of(job))


def done(client: TestClient, desk: Desk, job: str) -> str:
    """The id of a job after its diagnosis."""
    act(client, job, "start")
    until(lambda: not state_of(desk, job).live)
    assert state_of(desk, job).state == "done"
    return id_of(job)


def alive(pid: int) -> bool:
    """Whether a process runs; one that is dead and not yet waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


READER = Reader()
"""One process that looks at files for all tests: to start it is most of their time."""
atexit.register(READER.close)


def kept(desk: Desk) -> list[str]:
    """Every file that is not a job's own note."""
    files = (one for one in desk.store.home.rglob("*") if one.is_file())
    return sorted(one.name for one in files if one.name != "job.json" and one.parent.name != "views")


@contextmanager
def desk_at(home: Path, work: Callable[..., Any], limits: Limits | None = None) -> Iterator[Desk]:
    """A desk whose diagnosis is replaced, and its end."""
    desk = Desk(home, limits, work, READER)
    try:
        yield desk
    finally:
        desk.queue.close()


@contextmanager
def listened(desk: Desk) -> Iterator[int]:
    """The port of a real server of a desk, in a thread of this process."""
    listener = listening(0)
    port = int(listener.getsockname()[1])
    server = uvicorn.Server(configured(desk, TOKEN, port))
    thread = threading.Thread(target=server.run, args=([listener],))
    thread.start()
    try:
        yield port
    finally:
        server.should_exit = True
        thread.join()
        listener.close()


def asked(port: int, method: str, path: str, body: bytes = b"", seconds: float = 60.0) -> int:
    """The status of the answer to who has the token."""
    address = f"http://127.0.0.1:{port}{path}"
    return httpx2.request(method, address, content=body, headers=headers_to(port), timeout=seconds).status_code


def headers_to(port: int) -> dict[str, str]:
    """What the page's own requests say of themselves."""
    return {"Cookie": f"cosim-{port}={TOKEN}", "Origin": f"http://127.0.0.1:{port}"}


@pytest.fixture(autouse=True)
def _path(monkeypatch: pytest.MonkeyPatch) -> None:
    """The process of a diagnosis imports the work that replaces it."""
    monkeypatch.setenv("PYTHONPATH", f"{HERE / 'tools'}{os.pathsep}{HERE.parent}")


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    """A desk whose diagnoses end at once."""
    with desk_at(tmp_path / "data", serve_work.quickly) as made:
        yield made


@pytest.fixture
def client(desk: Desk) -> TestClient:
    """A client of it that has the token."""
    return client_of(desk)
