"""A file of many recordings dropped on the page: an entry for each, read alike, kept until the last is removed."""

from pathlib import Path

import serve_work
from serving import CARD, _path, act, client, client_of, desk, desk_at, new, put, recording, state
from starlette.testclient import TestClient

from cosim_serve.desk import Desk
from cosim_serve.uploads import Limits
from cosim_serve.work import command, job_order

__all__ = ["_path", "client", "desk"]


def day(runs: int = 3) -> bytes:
    """Recordings below each other, told apart by a column."""
    parts = [recording(seed=run).decode().splitlines()[1:] for run in range(runs)]
    return "\n".join(["run,t,tau,q", *(f"{run},{row}" for run, rows in enumerate(parts) for row in rows)]).encode()


def test_each_recording_of_a_file_is_an_entry_that_waits_for_its_use(client: TestClient, desk: Desk) -> None:
    job = new(client)
    assert put(client, job, "day.csv", day()).status_code == 201
    uploads = state(desk, job).uploads
    assert [one.name for one in uploads] == [f"day.csv:run={run}" for run in range(3)]
    assert {one.role for one in uploads} == {"out"}
    assert sum(one.size for one in uploads) <= len(day()) + len(uploads)
    views = desk.views(state(desk, job))
    assert all(not view["problem"] and view["columns"] for view in views.values())
    page = client.get(job).text
    assert "day.csv:run=2" in page
    assert "Choose at least one recording to fit." in page


def test_what_is_corrected_in_one_holds_for_the_file(client: TestClient, desk: Desk) -> None:
    job = new(client)
    put(client, job, "day.csv", day())
    act(client, job, "correct", file="day.csv:run=1", role="train", **{"units.q": "deg"})
    first, second, third = state(desk, job).uploads
    assert [one.role for one in (first, second, third)] == ["out", "train", "out"]
    views = desk.views(state(desk, job))
    assert all(one.options["units"] == {"q": "deg"} for one in (first, second, third))
    assert all(view["columns"][1]["unit"] == "rad" for view in views.values())


def test_they_are_diagnosed_and_the_command_line_takes_the_same(client: TestClient, desk: Desk) -> None:
    job = new(client)
    put(client, job, "day.csv", day())
    put(client, job, "axis.toml", CARD.encode())
    act(client, job, "correct", file="day.csv:run=0", role="train", **{"columns.tau": "tau", "units.tau": "mN.m"})
    act(client, job, "role", file="day.csv:run=2", role="heldout")
    there = state(desk, job)
    assert desk.lacking(there) == []
    order = job_order(there, desk.store.recording(there, ""), desk.store.card(there), desk.store.result(there.id))
    assert command(order) == (
        "cosim diagnose day.csv:run=0 --heldout day.csv:run=2 --card axis.toml --columns day.csv:tau=tau "
        "--units day.csv:tau=mN.m --out result"
    )


def test_the_file_goes_with_the_last_of_its_recordings(client: TestClient, desk: Desk) -> None:
    job = new(client)
    put(client, job, "day.csv", day(2))
    path = desk.store.recording(state(desk, job), "day.csv")
    assert "There is a recording day.csv already" in put(client, job, "day.csv", day()).json()["problem"]
    act(client, job, "drop", file="day.csv:run=0")
    assert path.exists()
    act(client, job, "drop", file="day.csv:run=1")
    assert not path.exists()
    assert state(desk, job).uploads == ()


def test_more_than_there_is_room_for_is_a_sentence(tmp_path: Path) -> None:
    with desk_at(tmp_path / "data", serve_work.quickly, Limits(files=2)) as small:
        client = client_of(small)
        job = new(client)
        assert put(client, job, "day.csv", day()).status_code == 201
        assert [one.name for one in state(small, job).uploads] == ["day.csv"]
        assert (
            "day.csv holds 3 recordings; here is room for 2. cosim diagnose takes any of them." in client.get(job).text
        )
