"""The page on a disk without room: each form and upload is one sentence, nothing is half changed, the queue goes on."""

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import serve_work
from serving import CARD, _path, act, client, client_of, desk, desk_at, id_of, kept, new, put, ready, recording, until
from serving import state as state_of
from starlette.testclient import TestClient

from cosim_serve.desk import Desk

__all__ = ["_path", "client", "desk"]
FORMS: dict[str, dict[str, str]] = {
    "role": {"file": "run1.csv", "role": "out"},
    "correct": {"file": "run1.csv", "units.q": "deg"},
    "drop": {"file": "run1.csv"},
    "card": {"text": CARD + "sigma2 = 3.0\n"},
    "write": {"inertia": "3", "Fc": "1"},
    "start": {},
}
SAID = "no space left on device. Nothing was changed; remove older diagnoses, or use a disk with more room."


@contextmanager
def full(home: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Files in a folder are opened and made, and take no byte, as on a disk without room."""
    write, opened, mkdir = Path.write_text, Path.open, Path.mkdir

    def refused(path: Path) -> None:
        if home in path.parents:
            raise OSError(errno.ENOSPC, "No space left on device", str(path))

    def write_text(path: Path, *given: Any, **named: Any) -> int:
        refused(path)
        return write(path, *given, **named)

    def open_(path: Path, mode: str = "r", *given: Any, **named: Any) -> Any:
        full = home in path.parents and set(mode) & set("wxa")
        return opened(Path("/dev/full"), "wb") if full else opened(path, mode, *given, **named)

    def made(path: Path, *given: Any, **named: Any) -> None:
        if not path.is_dir():
            refused(path)
        mkdir(path, *given, **named)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_text", write_text)
        patch.setattr(Path, "open", open_)
        patch.setattr(Path, "mkdir", made)
        yield


def content(desk: Desk) -> dict[str, bytes]:
    return {
        str(one.relative_to(desk.store.home)): one.read_bytes() for one in desk.store.home.rglob("*") if one.is_file()
    }


@pytest.mark.parametrize("action", FORMS)
def test_a_form_on_a_full_disk_is_a_sentence_and_changes_nothing(
    client: TestClient, desk: Desk, action: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = ready(client)
    before = content(desk)
    with full(desk.store.home, monkeypatch):
        answer = act(client, job, action, **FORMS[action])
    assert answer.status_code == 507
    assert SAID in answer.text
    assert str(desk.store.home) not in answer.text
    assert content(desk) == before
    assert act(client, job, action, **FORMS[action]).status_code == 200, "and works when there is room"


def test_a_new_draft_on_a_full_disk_is_a_sentence_and_leaves_nothing(
    client: TestClient, desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    with full(desk.store.home, monkeypatch):
        answer = client.post("/jobs")
    assert (answer.status_code, SAID in answer.text) == (507, True)
    assert [*desk.store.home.iterdir()] == []


@pytest.mark.parametrize("name", ["a.csv", "axis.toml"])
def test_an_upload_to_a_full_disk_is_a_sentence_and_leaves_nothing(
    client: TestClient, desk: Desk, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = new(client)
    with full(desk.store.home, monkeypatch):
        answer = put(client, job, name, recording())
    assert (answer.status_code, SAID in answer.json()["problem"]) == (507, True)
    assert kept(desk) == []
    assert put(client, job, name, recording()).status_code == 201


def test_removing_makes_room_on_a_full_disk(client: TestClient, desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    job = ready(client)
    with full(desk.store.home, monkeypatch):
        assert act(client, job, "remove").status_code == 200
    assert [*desk.store.home.iterdir()] == []


def test_a_diagnosis_that_ends_on_a_full_disk_is_shown_as_it_is_and_the_next_one_has_its_turn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with desk_at(tmp_path / "data", serve_work.for_ever) as desk:
        client = client_of(desk)
        first, second = ready(client), ready(client)
        for job in (first, second):
            act(client, job, "start")
        until(lambda: desk.queue.progress.answer)
        with full(desk.store.home, monkeypatch):
            act(client, first, "cancel")
            assert state_of(desk, first).state == "cancelled"
            until(lambda: state_of(desk, second).state == "running")
            assert "Cancel" in client.get(second).text
            until(lambda: desk.queue.progress.id == id_of(second) and desk.queue.progress.answer)
        act(client, second, "cancel")
        assert state_of(desk, second).state == "cancelled"
