"""Job folders that are damaged, of another version or made by somebody: each costs itself alone, and leads nowhere."""

import json
import os
from pathlib import Path
from typing import Any

import pytest
import serve_work
from serving import CARD, act, desk_at, done, id_of, new, put, ready, recording
from starlette.testclient import TestClient

from cosim_serve.desk import Desk

FINDING = {"what": "cogging", "size": "", "range": "", "answer": "", "kind": "", "statement": "", "action": ""}


def note(desk: Desk, job: str) -> Path:
    return desk.store.home / id_of(job) / "job.json"


ABSURD: dict[str, Any] = {
    "state of a later version": {"state": "archived"},
    "key of a later version": {"priority": 1},
    "null for an answer": {"answer": None},
    "list for an answer": {"state": "done", "answer": []},
    "answer without texts": {"state": "done", "answer": {"heading": 1, "findings": [3]}},
    "finding with a new key": {"state": "done", "answer": {"findings": [FINDING | {"new": "x"}]}},
    "number for a text": {"made": 5},
    "number that is none": {"state": "running", "begun": float("nan")},
    "number beyond all": {"seconds": 1e300},
    "text for a list": {"uploads": "run.csv"},
    "list for a recording": {"uploads": [["run.csv"]]},
    "recording elsewhere": {"uploads": [{"name": "../../../etc/passwd", "size": 1}]},
    "recording hidden": {"uploads": [{"name": ".x.csv", "size": 1}]},
    "recording twice": {"uploads": [{"name": "a.csv", "size": 1}] * 2},
    "size below 0": {"uploads": [{"name": "a.csv", "size": -1}]},
    "size beyond all": {"uploads": [{"name": "a.csv", "size": 10**400}]},
    "options that are none": {"uploads": [{"name": "a.csv", "size": 1, "options": {"columns": {"tau": 3}}}]},
    "another job's": {"id": "20260101-000000-abcdef"},
    "place elsewhere": {"id": "../../etc"},
}
TEXTS = {
    "empty": b"",
    "cut": b'{"id": "2',
    "null": b"null",
    "list": b"[]",
    "number": b"5",
    "nested": b"[" * 100_000,
    "nested inside": b'{"answer": ' * 50_000,
    "no UTF-8": b"\xff\xfe\x00",
    "half a character": b'{"id": "\\ud800"}',
    "huge": b" " * 10_000_000,
}


@pytest.mark.parametrize("text", [*ABSURD, *TEXTS])
def test_a_job_that_cannot_be_read_costs_itself_alone_and_is_removed(client: TestClient, desk: Desk, text: str) -> None:
    other, job = new(client), new(client)
    path = note(desk, job)
    altered = json.loads(path.read_text("utf-8")) | ABSURD.get(text, {})
    path.write_bytes(TEXTS.get(text, json.dumps(altered).encode()))
    home = client.get("/")
    assert home.status_code == 200
    assert "Unreadable diagnosis" in home.text
    assert "It is damaged, or another version of cosim wrote it." in home.text
    assert f'href="{other}"' in home.text
    page = client.get(job)
    assert page.status_code == 200
    assert "use that version" in page.text or "Open it with that version, or remove it" in page.text
    assert act(client, job, "card", text=CARD).status_code == 400
    assert put(client, job, "a.csv", recording()).status_code == 400
    with desk_at(desk.store.home, serve_work.quickly) as again:  # a server starts beside it
        assert [one.id for one in again.store.all()] == [id_of(other)]
    assert act(client, job, "remove").status_code == 200
    assert "Unreadable" not in client.get("/").text
    assert not path.parent.exists()


@pytest.mark.parametrize(
    "text", [b"", b"[]", b"null", b"3", b"[" * 100_000, b'{"columns": [{"name": 4}]}', b'{"new": 1}']
)
def test_a_damaged_view_is_told_and_is_made_anew(client: TestClient, desk: Desk, text: bytes) -> None:
    job = ready(client)
    for path in (note(desk, job).parent / "views").iterdir():
        path.write_bytes(text)
    page = client.get(job)
    assert page.status_code == 200
    assert act(client, job, "start").status_code == 400
    for name in ("run1.csv", "heldout.csv"):
        role = "heldout" if name.startswith("held") else "train"
        assert act(client, job, "correct", file=name, role=role).status_code == 200
    act(client, job, "card", text=CARD)
    done(client, desk, job)


def test_what_is_no_plain_file_is_neither_listed_nor_served(client: TestClient, desk: Desk, tmp_path: Path) -> None:
    job = ready(client)
    folder, secret = desk.store.result(done(client, desk, job)), tmp_path / "secret"
    secret.write_text('{"problem": "SECRET"}', "utf-8")
    for path in (note(desk, job).parent / "views").iterdir():
        path.unlink()
        path.symlink_to(secret)
    for name in ("diagnosis.json", "a.fmu"):
        (folder / name).symlink_to(secret)
    os.mkfifo(folder / "b.fmu")
    (folder / "c.fmu").symlink_to("/dev/zero")
    (folder / "report.html").unlink()
    (folder / "report.html").symlink_to(secret)
    page = client.get(job).text
    for name in ("diagnosis.json", "a.fmu", "b.fmu", "c.fmu", "report.html"):
        assert name not in page
        assert client.get(f"{job}/result/{name}").status_code == 404
    assert client.get(f"{job}/result/card.toml").status_code == 200
    assert "SECRET" not in page, "a view that is a link"


@pytest.mark.parametrize("what", ["recordings/run1.csv", "card.toml", "job.json", "recordings", "views", "result", ""])
@pytest.mark.parametrize("kind", ["link", "pipe"])
def test_what_leads_out_of_a_job_is_not_followed(client: Any, desk: Desk, tmp_path: Path, what: str, kind: str) -> None:
    job = ready(client)
    path, kept = desk.store.home / id_of(job) / what, tmp_path / "kept"
    if path.exists():
        path.rename(kept)
    else:
        kept.mkdir()
    path.symlink_to(kept) if kind == "link" else os.mkfifo(path)
    assert client.get("/").status_code == 200
    page = client.get(job)
    assert page.status_code == 200
    assert "is a link" in page.text or "is no " in page.text
    assert act(client, job, "start").status_code == 400
    before = sorted(one.name for one in kept.rglob("*"))
    assert act(client, job, "remove").status_code == 200
    assert not os.path.lexists(desk.store.home / id_of(job))
    assert sorted(one.name for one in kept.rglob("*")) == before, "what a link leads to stays"
