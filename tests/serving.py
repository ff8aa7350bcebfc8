"""Help for the tests of the page: a desk, a client that has the token, recordings and a card."""

import atexit
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
import pytest
import serve_work

pytest.importorskip("starlette", reason="the extra [serve] is not installed")
from starlette.testclient import TestClient

from cosim.serve.app import make_app
from cosim.serve.desk import Desk
from cosim.serve.job import Job
from cosim.serve.reader import Reader
from cosim.serve.uploads import Limits

TOKEN, PORT = "right", 8000
HERE = Path(__file__).parent
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


def ready(client: TestClient) -> str:
    """The address of a draft that can be diagnosed."""
    job = new(client)
    for number, name in enumerate(("run1.csv", "heldout.csv")):
        assert put(client, job, name, recording(seed=number)).status_code == 201
    assert put(client, job, "axis.toml", CARD.encode()).status_code == 201
    return job


def id_of(job: str) -> str:
    return job.rpartition("/")[2]


def until(true: Callable[[], Any], seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it did not come in time"
        time.sleep(0.02)


def state(desk: Desk, job: str) -> Job:
    return desk.store.get(id_of(job))


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


@pytest.fixture(autouse=True)
def _path(monkeypatch: pytest.MonkeyPatch) -> None:
    """The process of a diagnosis imports the work that replaces it."""
    monkeypatch.setenv("PYTHONPATH", f"{HERE}{os.pathsep}{HERE.parent}")


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    """A desk whose diagnoses end at once."""
    with desk_at(tmp_path / "data", serve_work.quickly) as made:
        yield made


@pytest.fixture
def client(desk: Desk) -> TestClient:
    """A client of it that has the token."""
    return client_of(desk)
