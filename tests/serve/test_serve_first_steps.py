"""First steps on the page: an example to try, a card from the recordings, a form that asks what counts."""

import re

import pytest
from serving import _path, act, client, desk, id_of, new, put
from starlette.testclient import TestClient

from cosim_serve import example
from cosim_serve.desk import Desk
from cosim_serve.form import FIELDS

__all__ = ["_path", "client", "desk"]


def test_the_example_is_a_draft_that_lacks_nothing(client: TestClient, desk: Desk) -> None:
    answer = client.post("/example", headers={"origin": str(client.base_url)})
    job = desk.store.get(str(answer.url).rpartition("/")[2])
    assert [one.name for one in job.uploads] == list(example.NAMES)
    assert [one.role for one in job.uploads] == ["train", "train", "heldout"]
    assert desk.lacking(job) == []
    assert "example axis" in answer.text
    act(client, f"/jobs/{job.id}", "start")
    assert desk.store.get(job.id).state != "draft"


def test_a_card_is_estimated_from_the_recordings(client: TestClient, desk: Desk) -> None:
    job = new(client)
    assert "there is none yet" in act(client, job, "estimate").text
    put(client, job, "one.csv", example.recordings()[example.NAMES[0]].encode())
    assert "The end of the only recording is for validation" in client.get(job).text
    act(client, job, "estimate")
    text = desk.card_text(desk.store.get(id_of(job)))
    inertia = float(re.findall(r"^inertia = ([\d.]+)", text, re.MULTILINE)[0])
    assert inertia == pytest.approx(example.INERTIA, rel=0.05)
    assert desk.lacking(desk.store.get(id_of(job))) == []


def test_what_is_dropped_and_tells_nothing_is_a_sentence(client: TestClient) -> None:
    job = new(client)
    put(client, job, "rest.csv", b"t,tau,q\n" + b"".join(b"%.2f,0,0\n" % (k / 100) for k in range(400)))
    assert "No card can be estimated: " in act(client, job, "estimate").text


def test_the_last_of_several_recordings_proves_where_none_was_chosen(client: TestClient) -> None:
    job = new(client)
    for name in ("a.csv", "b.csv"):
        put(client, job, name, example.recordings()[example.NAMES[0]].encode())
    assert "b.csv, the last one, is for validation" in client.get(job).text


def test_the_form_asks_for_two_numbers_of_an_axis_with_coulomb_friction() -> None:
    shown = [one.key for one in FIELDS if not one.laws or "coulomb" in one.laws]
    assert shown == ["inertia", "Fc", "sigma2", "torque_limit"]
    assert FIELDS[0].needed
