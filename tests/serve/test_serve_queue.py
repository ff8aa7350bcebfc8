"""One diagnosis after the other: waiting, cancelled, failed, interrupted, kept over a restart; two side by side."""

import errno
import re
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import serve_work
from report_example import diagnosis
from serve_work import NOTE
from serving import CARD, act, alive, client_of, desk_at, done, id_of, kept, new, put, ready, recording, state_of
from starlette.testclient import TestClient
from waiting import until

from cosim_serve import comparison
from cosim_serve.chart import HEIGHT, LEFT, WIDTH, chart, ticks
from cosim_serve.desk import Desk
from cosim_serve.store import Store


@pytest.fixture
def slow(tmp_path: Path) -> Iterator[Desk]:
    with desk_at(tmp_path / "data", serve_work.for_ever) as made:
        yield made


def test_a_diagnosis_leads_to_its_report_and_files(client: TestClient, desk: Desk) -> None:
    job = ready(client)
    done(client, desk, job)
    page = client.get(job).text
    assert "One effect is missing from the model" in page
    report = client.get(f"{job}/result/report.html")
    assert report.headers["content-type"].startswith("text/html")
    assert "frame-ancestors 'self'" in report.headers["content-security-policy"]
    card = client.get(f"{job}/result/card.toml")
    assert "attachment" in card.headers["content-disposition"]
    assert card.text == serve_work.CARD
    assert "One effect is missing" in client.get("/").text
    copy = str(act(client, job, "again").url.path)
    assert copy != job
    assert [one.name for one in state_of(desk, copy).uploads] == ["run1.csv", "heldout.csv"]
    act(client, job, "remove")
    assert client.get(job).status_code == 404
    assert put(client, copy, "run2.csv", recording()).status_code == 201
    done(client, desk, copy)


def test_one_diagnosis_at_a_time_and_the_next_when_it_is_gone(slow: Desk) -> None:
    client = client_of(slow)
    first, second, third = ready(client), ready(client), ready(client)
    for job in (first, second, third):
        act(client, job, "start")
    until(lambda: slow.queue.progress.answer)
    assert [state_of(slow, job).state for job in (first, second, third)] == ["running", "queued", "queued"]
    page = client.get(first).text
    assert "Friction asymmetry (2 of 5)" in page
    assert "First answer" in page
    assert "1 diagnosis comes before this one" in client.get(second).text
    assert "2 diagnoses come before this one" in client.get(third).text
    assert put(client, first, "late.csv", recording()).status_code == 400
    act(client, second, "cancel")
    act(client, first, "cancel")
    until(lambda: state_of(slow, third).state == "running")
    assert [state_of(slow, job).state for job in (first, second)] == ["cancelled", "cancelled"]


def test_a_cancelled_diagnosis_leaves_no_process_and_no_result(slow: Desk) -> None:
    client = client_of(slow)
    job = ready(client)
    act(client, job, "start")
    note = slow.store.home / id_of(job) / NOTE
    until(lambda: note.exists() and note.read_text())
    pids = [int(word) for word in note.read_text().split()]
    assert all(map(alive, pids))
    assert slow.store.result(id_of(job)).is_dir()
    act(client, job, "cancel")
    until(lambda: not any(map(alive, pids)), 5)
    assert not slow.store.result(id_of(job)).exists()
    note.unlink()
    assert kept(slow) == ["card.toml", "heldout.csv", "run1.csv"]
    assert slow.queue.pid() == 0
    act(client, job, "again")
    assert state_of(slow, job).state == "draft"


@pytest.mark.parametrize(
    ("work", "said"),
    [(serve_work.refusing, "run1.csv does not move."), (serve_work.crashing, "The diagnosis ended before")],
)
def test_a_diagnosis_that_fails_says_why_and_the_next_one_runs(tmp_path: Path, work: object, said: str) -> None:
    with desk_at(tmp_path / "data", work) as desk:  # type: ignore[arg-type]
        client = client_of(desk)
        jobs = [ready(client), ready(client)]
        for job in jobs:
            act(client, job, "start")
        for job in jobs:
            until(lambda job=job: state_of(desk, job).state == "failed")  # type: ignore[misc]
            assert said in client.get(job).text


def test_history_survives_a_restart_what_ran_is_interrupted_and_what_waited_goes_on(tmp_path: Path) -> None:
    home = tmp_path / "data"
    with desk_at(home, serve_work.for_ever) as desk:
        client = client_of(desk)
        ran, waited, draft = ready(client), ready(client), ready(client)
        act(client, ran, "start")
        act(client, waited, "start")
        until(lambda: desk.queue.progress.answer)
    assert state_of(desk, ran).state == "interrupted"
    killed = (store := Store(home)).new().id  # of a server that was killed, as is a folder without a note
    store.put(killed, state="running")
    (home / "20260101-000000-abcdef").mkdir()
    with desk_at(home, serve_work.quickly) as desk:
        until(lambda: state_of(desk, waited).state == "done")
        there = {one.id: one.state for one in desk.store.all()}
        assert [there[id_of(job)] for job in (ran, draft, killed)] == ["interrupted", "draft", "interrupted"]
        assert len(there) == 4
        page = client_of(desk).get("/").text
        assert all(id_of(job) in page for job in (ran, waited, draft))
        assert "<polyline" in client_of(desk).get(draft).text


# The page on a disk without room: each form and upload is one sentence, nothing is half changed, the queue goes on.

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


@pytest.mark.parametrize("action", FORMS)
def test_a_form_on_a_full_disk_is_a_sentence(client: TestClient, desk: Desk, action: str, monkeypatch: Any) -> None:
    """It changes nothing."""

    def content() -> dict[Path, bytes]:
        return {one: one.read_bytes() for one in desk.store.home.rglob("*") if one.is_file()}

    job = ready(client)
    before = content()
    with full(desk.store.home, monkeypatch):
        answer = act(client, job, action, **FORMS[action])
    assert (answer.status_code, SAID in answer.text) == (507, True)
    assert str(desk.store.home) not in answer.text
    assert content() == before
    assert act(client, job, action, **FORMS[action]).status_code == 200, "and works when there is room"


@pytest.mark.parametrize("name", ["a.csv", "axis.toml"])
def test_an_upload_or_draft_on_a_full_disk_leaves_nothing(client: Any, desk: Desk, name: str, monkeypatch: Any) -> None:
    """Each is a sentence, and removing makes room."""
    job = new(client)
    with full(desk.store.home, monkeypatch):
        uploaded, drafted = put(client, job, name, recording()), client.post("/jobs")
    assert [(one.status_code, SAID in one.text) for one in (uploaded, drafted)] == [(507, True)] * 2
    assert kept(desk) == []
    assert put(client, job, name, recording()).status_code == 201
    with full(desk.store.home, monkeypatch):
        assert act(client, job, "remove").status_code == 200
    assert [*desk.store.home.iterdir()] == []


def test_after_a_diagnosis_that_ends_on_a_full_disk_the_next_one_has_its_turn(tmp_path: Path, monkeypatch: Any) -> None:
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


@pytest.fixture
def comparable(tmp_path: Path) -> Iterator[Desk]:
    with desk_at(tmp_path / "data", serve_work.comparing) as made:
        yield made


def test_two_diagnoses_stand_in_one_table_with_both_overlays(comparable: Desk) -> None:
    client = client_of(comparable)
    ids = [done(client, comparable, job) for job in (ready(client), ready(client, "alone.csv"))]
    home = client.get("/").text
    assert home.count('form="compare"') == 2
    assert "run1.csv, heldout.csv" in home
    assert re.search(r"Validation RMS error [\d.]+ → [\d.]+\sN·m\.", home)
    text = client.get("/compare", params={"job": ids}).text
    for said in ("Two effects are missing", "Nothing missing that these recordings can show", "alone.csv"):
        assert said in text
    rows = dict(re.findall(r'<tr><th scope="row">([^<]+)</th>(.*?)</tr>', text, re.DOTALL))
    assert "0.42\N{NO-BREAK SPACE}N·m" in rows["Cogging"].replace("0.42 N", "0.42\N{NO-BREAK SPACE}N")
    assert len(re.findall("<td>", rows["with the improved card"])) == 2
    assert text.count('class="error_after"') == 2
    assert text.count(" s</text>") == 4  # the last tick of each time axis has the unit


def test_others_than_two_that_are_done_are_a_sentence(comparable: Desk) -> None:
    client = client_of(comparable)
    job = done(client, comparable, ready(client))
    for chosen in ([], [job], [job, job], [job, id_of(new(client))]):
        answer = client.get("/compare", params={"job": chosen})
        assert answer.status_code == 400
        assert "Choose two diagnoses that are done" in answer.text
    assert client.get("/compare", params={"job": [job, "../.."]}).status_code == 404


def test_what_an_older_version_made_is_compared_as_far_as_it_goes(comparable: Desk) -> None:
    client = client_of(comparable)
    ids = [done(client, comparable, job) for job in (ready(client), ready(client, "alone.csv"))]
    path = comparable.store.result(ids[0]) / comparison.FILE
    for text in ("", "{}", "[1]", '{"heading": 3}'):
        path.write_text(text, "utf-8")
        shown = client.get("/compare", params={"job": ids})
        assert shown.status_code == 200
        assert "diagnose it again to compare it" in shown.text
        assert "polyline" not in shown.text
    path.unlink()
    assert client.get("/compare", params={"job": ids}).status_code == 200


def test_a_line_keeps_every_peak_and_its_error() -> None:
    found = diagnosis("two")
    made = comparison.compared(found)
    (trace,) = (one for one in found.traces if one.heldout)
    assert max(made.lines["measured"].values) == pytest.approx(trace.tau.max(), rel=1e-3)
    assert max(made.lines["error_before"].values) == pytest.approx((trace.tau - trace.before).max(), rel=1e-3)
    assert len(made.lines["measured"].t) <= comparison.CORNERS
    assert [one.size for one in made.effects if one.id == "cogging"] == ["0.42 N·m"]


@pytest.mark.parametrize(("low", "high"), [(0.0, 30.0), (-0.82, 0.83), (1e-7, 3e-7), (-4e5, 9e6), (99.0, 101.0)])
def test_ticks_are_round_inside_and_evenly_spaced(low: float, high: float) -> None:
    for most in (4, 7):
        found = ticks(low, high, most)
        assert 2 <= len(found) <= most + 1
        assert all(low - 1e-9 * abs(low) <= value <= high + 1e-9 * abs(high) for value, _ in found)
        steps = [b - a for (a, _), (b, _) in pairwise(found)]
        assert steps == pytest.approx([steps[0]] * len(steps))
        assert len({text for _, text in found}) == len(found)
        for value, text in found:
            assert float(text.replace("\N{MINUS SIGN}", "-")) == pytest.approx(value, rel=1e-2, abs=1e-12)


def test_a_constant_or_empty_signal_has_axes_too() -> None:
    made = chart({"x": ([0.0, 1.0], [2.0, 2.0])}, (0.0, 1.0), (2.0, 2.0))
    assert [one.text for one in made.y] == ["2"]
    points = np.array([[float(x) for x in pair.split(",")] for pair in made.lines["x"].split()])
    assert points[:, 0].min() >= LEFT
    assert points[:, 0].max() <= WIDTH
    assert points[:, 1].max() <= HEIGHT
    assert chart({}, (0.0, 0.0), (0.0, 0.0)).x[0].text == "0"
