"""The page's server: who may ask, what may be dropped, how files are corrected, one diagnosis after the other."""

import gzip
import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest
import serve_work
from serve_work import NOTE
from serving import (
    CARD,
    HERE,
    ORIGIN,
    TOKEN,
    act,
    alive,
    client_of,
    desk_at,
    id_of,
    new,
    put,
    ready,
    recording,
    until,
)
from serving import state as state_of
from starlette.testclient import TestClient

from cosim.serve.desk import Desk
from cosim.serve.job import Upload
from cosim.serve.looks import HEIGHT, WIDTH, line
from cosim.serve.server import listening
from cosim.serve.store import Store
from cosim.serve.uploads import Limits, safe_name
from cosim.serve.work import Order, command, diagnose_order
from cosim.support.errors import InputError, OutputError
from cosim.support.lock import claimed
from pyfmi_models.card import parse_card

SMALL = Limits(file=20_000, job=50_000, files=4, card=300, form=2_000)
DAMAGES = 100


@pytest.fixture(autouse=True)
def _path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(HERE))


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    with desk_at(tmp_path / "data", serve_work.quickly) as made:
        yield made


@pytest.fixture
def slow(tmp_path: Path) -> Iterator[Desk]:
    with desk_at(tmp_path / "data", serve_work.for_ever) as made:
        yield made


@pytest.fixture
def client(desk: Desk) -> TestClient:
    return client_of(desk)


def kept(desk: Desk) -> list[str]:
    """Every file that is not a job's own note."""
    files = (one for one in desk.store.home.rglob("*") if one.is_file())
    return sorted(one.name for one in files if one.name != "job.json" and one.parent.name != "views")


# Who may ask


def test_without_the_token_nothing_is_answered(desk: Desk) -> None:
    stranger = client_of(desk, token="wrong")
    for address in ("/", "/page.js", "/jobs/20260101-000000-abcdef", "/?token=", "/?token=rightt"):
        assert stranger.get(address).status_code == 403, address
    assert stranger.post("/jobs").status_code == 403
    assert not desk.store.all()


def test_the_token_becomes_a_cookie_that_scripts_cannot_read_and_leaves_the_address(desk: Desk) -> None:
    stranger = client_of(desk, token="wrong")
    answer = stranger.get(f"/?token={TOKEN}", follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert stranger.get("/").status_code == 200


@pytest.mark.parametrize("host", ["evil.example", "evil.example:8000", "127.0.0.1:8001", "127.0.0.1", "0.0.0.0:8000"])
def test_a_foreign_name_that_leads_here_is_refused(client: TestClient, host: str) -> None:
    assert client.get("/", headers={"host": host}).status_code == 421
    assert client.get(f"/?token={TOKEN}", headers={"host": host}).status_code == 421


@pytest.mark.parametrize("origin", ["http://evil.example", "http://127.0.0.1:9999", "null"])
def test_another_page_cannot_change_or_read_anything(client: TestClient, desk: Desk, origin: str) -> None:
    assert client.post("/jobs", headers={"origin": origin}).status_code == 403
    assert client.get("/", headers={"origin": origin}).status_code == 403
    assert client.get("/", headers={"sec-fetch-site": "cross-site"}).status_code == 403
    assert not desk.store.all()


def test_a_change_without_an_origin_is_refused(desk: Desk, client: TestClient) -> None:
    del client.headers["origin"]
    assert client.get("/").status_code == 200
    assert client.post("/jobs").status_code == 403


def test_every_answer_carries_the_policy_and_no_page_needs_an_exception_from_it(client: TestClient) -> None:
    job = ready(client)
    pages = [client.get(address) for address in ("/", job, "/page.css", "/page.js", "/icon.svg", "/nowhere")]
    for page in pages:
        assert "default-src 'none'" in page.headers["content-security-policy"]
        assert page.headers["x-content-type-options"] == "nosniff"
        assert page.headers["referrer-policy"] == "no-referrer"
        assert page.headers["cache-control"] == "no-store"
        assert "unsafe" not in page.headers["content-security-policy"]
    for page in pages[:2]:
        assert not re.search(r"\sstyle=|\son\w+=|<style|<script>|javascript:", page.text)
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", "".join(page.text for page in pages))


# What may be dropped


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ("run1.csv", "run1.csv"),
        ("../../etc/run.csv", "run.csv"),
        ("..\\..\\run.csv", "run.csv"),
        ("/etc/passwd.csv", "passwd.csv"),
        (".hidden.csv", "hidden.csv"),
        ("a\0b\n.csv", "ab.csv"),
        ("C:run?.csv", "C_run_.csv"),
        ("run\u202evsc.csv", "runvsc.csv"),
        ("x" * 300 + ".csv.gz", "x" * 53 + ".csv.gz"),
        ("Übung 測量.csv", "Übung 測量.csv"),
    ],
)
def test_a_name_becomes_a_name_that_stays_in_its_folder(given: str, name: str) -> None:
    assert safe_name(given, 60) == name


@pytest.mark.parametrize("given", ["", "..", "/", "run", "...", "a/", "\0", "../.."])
def test_what_is_no_name_is_refused(given: str) -> None:
    with pytest.raises(InputError, match="is no name"):
        safe_name(given, 60)


def test_a_path_in_a_name_leads_nowhere_else(client: TestClient, desk: Desk, tmp_path: Path) -> None:
    job = new(client)
    for name in ("../../../run.csv", "..%2f..%2frun2.csv", "..\\run3.csv"):
        put(client, job, name, recording())
    inside = desk.store.home.rglob("run*.csv")
    assert all(one.parent == desk.store.home / id_of(job) / "recordings" for one in inside)
    assert [one.name for one in tmp_path.iterdir()] == ["data"]


@pytest.mark.parametrize("path", ["../job.json", "..%2fjob.json", "%2e%2e/job.json", "card.toml", "/etc/passwd"])
def test_only_what_the_diagnosis_wrote_can_be_fetched(client: TestClient, path: str) -> None:
    job = ready(client)
    assert client.get(f"{job}/result/{path}").status_code in (404, 405)


@pytest.mark.parametrize("name", ["nothing", "20260101-000000-abcdef", "..%2f..", "20260101-000000-abcdef%0a"])
def test_a_job_that_is_not_there_is_a_sentence(client: TestClient, name: str) -> None:
    assert client.get(f"/jobs/{name}").status_code in (404, 405)
    assert client.post(f"/jobs/{name}/remove").status_code in (404, 405)


def test_too_much_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    with desk_at(tmp_path / "data", serve_work.quickly, SMALL) as desk:
        client = client_of(desk)
        job = new(client)
        stated = put(client, job, "large.csv", b"x" * 20_001)
        silent = client.put(f"{job}/files?name=large.csv", content=iter([b"x" * 15_000] * 3))
        for answer in (stated, silent):
            assert answer.status_code == 400
            assert "too large: at most 20 kB" in answer.json()["problem"]
        assert kept(desk) == []
        assert put(client, job, "axis.toml", CARD.encode() + b"#" * 300).status_code == 400
        assert act(client, job, "card", text="x" * 301).status_code == 400
        assert act(client, job, "card", text="x" * 3000).status_code == 400
        assert kept(desk) == []


def test_a_job_takes_so_many_files_and_bytes_and_no_name_twice(tmp_path: Path) -> None:
    with desk_at(tmp_path / "data", serve_work.quickly, SMALL) as desk:
        client = client_of(desk)
        job = new(client)
        content = recording(300)
        for number in range(4):
            assert put(client, job, f"run{number}.csv", content).status_code == 201
        assert "at most 4 recordings" in put(client, job, "run4.csv", content).json()["problem"]
        act(client, job, "drop", file="run3.csv")
        assert "already" in put(client, job, "run1.csv", content).json()["problem"]
        assert put(client, job, "big.csv", b"x" * (50_000 - 3 * len(content) + 1)).status_code == 400


def test_hundred_damaged_files_are_each_a_sentence_or_a_picture(client: TestClient, desk: Desk) -> None:
    """Real exports with bytes changed, cut, doubled or from elsewhere; the reader's process survives nearly all."""
    rng = np.random.default_rng(17)
    samples = [
        one for one in sorted((HERE / "samples").iterdir()) if one.suffix not in (".py", ".pyc") and one.is_file()
    ]
    job, reader = new(client), set()
    for number in range(DAMAGES):
        source = samples[number % len(samples)]
        name = f"{number}{source.suffix if number % 5 else ('.csv.gz', '.parquet', '.mat', '.toml')[number // 5 % 4]}"
        content = damaged(source.read_bytes(), rng)
        answer = put(client, job, name, gzip.compress(content)[: rng.integers(20, 4000)] if ".gz" in name else content)
        assert answer.status_code in (201, 400), (name, answer.text)
        page = client.get(job)
        assert page.status_code == 200, name
        view = desk.views(state_of(desk, job)).get(name, {"problem": answer.text})
        assert view["problem"] or view["columns"] or view["refused"], name
        assert str(desk.store.home) not in page.text
        reader.add(desk.reader.pid())
        act(client, job, "drop", file=name)
    assert len(reader) <= 1


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """Change, cut or double some bytes."""
    data = bytearray(content)
    for _ in range(int(rng.integers(1, 12))):
        place = int(rng.integers(0, max(1, len(data))))
        match int(rng.integers(0, 5)):
            case 0:
                data[place : place + 1] = rng.bytes(1)
            case 1:
                del data[place : place + int(rng.integers(1, 200))]
            case 2:
                data[place:place] = rng.bytes(int(rng.integers(1, 40)))
            case 3:
                data[place:place] = data[: int(rng.integers(1, 400))]
            case _:
                data[place:place] = (b"\0", b"nan,", b"1e999;", b'"', b"\xff\xfe", b"\n\n", b",,,,")[rng.integers(0, 7)]
    return bytes(data)


def test_names_in_files_stay_text(client: TestClient) -> None:
    job, evil = new(client), "<script>alert(1)</script>"
    content = recording().replace(b"t,tau,q", f"t,tau,{evil}".encode())
    put(client, job, "<b>run.csv", content)
    put(client, job, "axis.toml", CARD.replace("azimuth", evil).encode())
    for page in (client.get(job).text, client.get("/").text):
        assert "<script>alert" not in page
        assert "<b>run" not in page
    assert "&lt;script&gt;alert(1)" in client.get(job).text


# Seeing and correcting


def test_a_recording_is_shown_with_what_its_columns_serve_as(client: TestClient) -> None:
    job = new(client)
    put(client, job, "scope.csv", (HERE / "samples" / "twincat_scope.csv").read_bytes())
    page = client.get(job).text
    assert "TwinCAT Scope" in page
    assert re.search(r"<b>TorqueCmd</b> torque", page)
    assert re.search(r"<b>ActPos</b> position", page)
    assert page.count("<polyline") == 3


def test_what_a_file_leaves_open_is_asked_and_the_example_can_be_taken(client: TestClient, desk: Desk) -> None:
    job = ready(client)
    put(client, job, "odrive.csv", (HERE / "samples" / "odrive.csv").read_bytes())
    assert "One question." in client.get(job).text
    missing = act(client, job, "start")
    assert missing.status_code == 400
    assert "odrive.csv can be read in more than one way" in missing.text
    act(client, job, "accept", file="odrive.csv")
    seen = desk.views(state_of(desk, job))["odrive.csv"]
    assert not seen["undecided"]
    assert state_of(desk, job).upload("odrive.csv").options["columns"]["tau"]


def test_columns_and_units_are_corrected(client: TestClient, desk: Desk) -> None:
    job = new(client)
    put(client, job, "run.csv", recording().replace(b"t,tau,q", b"t,force,enc"))
    form = {"columns.tau": "force", "columns.q": "enc", "units.q": "deg", "units.tau": "mN.m", "role": "heldout"}
    act(client, job, "correct", file="run.csv", **form)
    one = state_of(desk, job).upload("run.csv")
    assert one.role == "heldout"
    assert one.options == {"columns": {"tau": "force", "q": "enc"}, "units": {"q": "deg", "tau": "mN.m"}, "layout": {}}
    (q,) = [c for c in desk.views(state_of(desk, job))["run.csv"]["columns"] if c["serves"] == "position"]
    assert float(q["greatest"]) == pytest.approx(np.deg2rad(0.1), rel=1e-3)
    act(client, job, "correct", file="run.csv", **{"units.q": "furlong"})
    assert "furlong" in desk.views(state_of(desk, job))["run.csv"]["problem"]
    assert client.get(job).status_code == 200


def test_the_names_that_a_card_gives_to_columns_hold(client: TestClient, desk: Desk) -> None:
    job = new(client)
    put(client, job, "run.csv", recording().replace(b"t,tau,q", b"t,alpha,beta"))
    assert desk.views(state_of(desk, job))["run.csv"]["refused"]
    put(client, job, "axis.toml", (CARD + '[columns]\ntau = "alpha"\nq = "beta"\n').encode())
    assert not desk.views(state_of(desk, job))["run.csv"]["refused"]


def test_a_card_that_is_wrong_is_kept_with_its_sentence_and_can_be_mended(client: TestClient, desk: Desk) -> None:
    job = new(client)
    put(client, job, "axis.toml", CARD.replace("inertia", "inertai").encode())
    page = client.get(job).text
    assert "inertai is not a key of a card" in page
    assert "inertai = 30.0" in page
    act(client, job, "card", text=CARD)
    assert desk.card_view(state_of(desk, job))["facts"]["machine"] == "azimuth"
    act(client, job, "card", shipped="paper_mount")
    assert desk.card_view(state_of(desk, job))["facts"]["friction"].startswith("lugre")
    assert act(client, job, "card", shipped="../../etc").status_code == 400


def test_a_form_writes_a_card_in_si(client: TestClient, desk: Desk) -> None:
    job = new(client)
    form = {"name": 'Achse "1"', "motion": "rotary", "friction": "static", "inertia": "2,5", "inertia.unit": "kg cm2"}
    form |= {"Fc": "120", "Fc.unit": "mN.m", "Fs": "0.2", "Vs": "3", "Vs.unit": "deg/s", "sigma2": "0.01"}
    assert act(client, job, "write", **form).status_code == 200
    card = parse_card(desk.card_text(state_of(desk, job)), "card.toml")
    assert (card.mount.name, card.mount.inertia) == ('Achse "1"', pytest.approx(2.5e-4))
    assert (card.friction.Fc, card.friction.Fs) == pytest.approx((0.12, 0.2))  # type: ignore[attr-defined]
    assert card.friction.Vs == pytest.approx(np.deg2rad(3))  # type: ignore[attr-defined]
    assert not desk.card_view(state_of(desk, job))["problem"]


@pytest.mark.parametrize(
    ("form", "said"),
    [
        ({}, "Inertia, or moved mass: it is needed, in kg.m2"),
        ({"inertia": "much"}, "Inertia, or moved mass: &#34;much&#34; is no number."),
        ({"inertia": "nan"}, "is no number"),
        ({"inertia": "1", "inertia.unit": "kg"}, "&#34;kg&#34; does not fit; it is in kg.m2"),
        ({"inertia": "1", "inertia.unit": "stone"}, "stone"),
        ({"inertia": "1", "motion": "linear", "inertia.unit": "kg.m2"}, "it is in kg or a unit"),
        ({"inertia": "-1", "Fc": "1"}, "[mount] inertia = -1.0 breaks the rule"),
        ({"inertia": "1"}, "Fc is missing"),
        ({"inertia": "1", "Fc": "1", "Fs": "2"}, "Fs"),
        ({"inertia": "1", "Fc": "1", "motion": "round"}, "motion"),
    ],
)
def test_a_form_that_is_wrong_says_why_and_keeps_what_was_typed(
    client: TestClient, form: dict[str, str], said: str
) -> None:
    answer = act(client, new(client), "write", **form)
    assert answer.status_code == 400
    assert said in answer.text
    for value in form.values():
        assert f'"{value}"' in answer.text or value == "round"


def test_the_line_of_a_signal_keeps_its_peaks_and_fits_its_picture() -> None:
    t, values = np.arange(100_000.0), np.zeros(100_000)
    values[54_321] = 7.0
    corners = [tuple(map(float, one.split(","))) for one in line(t, values).split()]
    assert len(corners) <= WIDTH
    assert min(y for _, y in corners) == 0
    assert max(y for _, y in corners) == HEIGHT


def test_what_is_missing_is_said_in_one_sentence_each(client: TestClient) -> None:
    job = new(client)
    answer = act(client, job, "start")
    for text in ("at least one recording to fit", "to keep for the proof", "Give a model card"):
        assert text in answer.text
    put(client, job, "empty.csv", b"")
    assert "empty.csv cannot be used as it is read now" in act(client, job, "start").text
    act(client, job, "role", file="empty.csv", role="out")
    assert "empty.csv cannot be used" not in act(client, job, "start").text
    assert act(client, job, "role", file="empty.csv", role="king").status_code == 400
    assert act(client, job, "role", file="gone.csv", role="out").status_code == 400


# One after the other


def test_a_diagnosis_leads_to_its_report_and_files(client: TestClient, desk: Desk) -> None:
    job = ready(client)
    act(client, job, "start")
    until(lambda: not state_of(desk, job).live)
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
    act(client, copy, "start")
    until(lambda: state_of(desk, copy).state == "done")


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
    with desk_at(home, serve_work.quickly) as desk:
        until(lambda: state_of(desk, waited).state == "done")
        assert [state_of(desk, job).state for job in (ran, draft)] == ["interrupted", "draft"]
        page = client_of(desk).get("/").text
        assert all(id_of(job) in page for job in (ran, waited, draft))
        assert "<polyline" in client_of(desk).get(draft).text


def test_a_server_that_was_killed_left_jobs_that_can_be_read(tmp_path: Path) -> None:
    store = Store(tmp_path)
    job = store.new()
    store.put(job.id, state="running")
    (tmp_path / "20260101-000000-abcdef").mkdir()
    (tmp_path / "20260101-000000-abcdee").mkdir()
    (tmp_path / "20260101-000000-abcdee" / "job.json").write_text('{"id": ', "utf-8")
    with desk_at(tmp_path, serve_work.quickly) as desk:
        assert [(one.id, one.state) for one in desk.store.all()] == [(job.id, "interrupted")]


# The process


def begun(home: Path) -> tuple["subprocess.Popen[str]", str]:
    command = [sys.executable, "-m", "cosim", "serve", "--no-browser", "--data", str(home)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=HERE.parent)
    assert process.stdout is not None
    return process, process.stdout.readline().strip()


def children(pid: int) -> list[int]:
    """The processes that a process has, over all threads."""
    found = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(one) for path in found for one in path.read_text().split()]


@pytest.mark.skipif(not Path("/proc").exists(), reason="processes are looked up in /proc")
@pytest.mark.parametrize("sign", ["SIGKILL", "SIGTERM", "SIGINT"])
def test_the_server_prints_its_address_and_takes_its_processes_with_it(tmp_path: Path, sign: str) -> None:
    import signal

    import httpx2

    process, address = begun(tmp_path / "data")
    try:
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[\w-]{30,}", address)
        assert httpx2.get(address, follow_redirects=True).status_code == 200
        own = children(process.pid)
        assert own
        process.send_signal(getattr(signal, sign))
        process.wait(10)
        until(lambda: not any(map(alive, own)), 8)
    finally:
        process.kill()
        process.communicate()
    assert process.returncode == {"SIGKILL": -9, "SIGTERM": 143, "SIGINT": 130}[sign]


def test_this_machine_alone_is_listened_to_and_a_taken_port_is_a_sentence() -> None:
    with listening(0) as first:
        host, port = first.getsockname()
        assert host == "127.0.0.1"
        first.listen()
        with pytest.raises(InputError, match=rf"Port {port} cannot be listened to"):
            listening(port)
    with pytest.raises(InputError, match="Port 99999"):
        listening(99_999)
    assert first.family == socket.AF_INET


def test_two_servers_do_not_share_a_folder(tmp_path: Path) -> None:
    with claimed(tmp_path, "cosim serve"):
        process, address = begun(tmp_path)
        _, said = process.communicate(timeout=60)
    assert (process.returncode, address) == (2, "")
    assert "Another cosim serve is writing to" in said


def test_without_its_extra_one_sentence_says_how_to_get_it(tmp_path: Path) -> None:
    code = "import sys; sys.modules['starlette'] = None; from cosim.cli import main; main(['serve'])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=HERE.parent, check=False)
    assert done.returncode == 2
    assert "pip install 'mount-cosim[serve]'" in done.stderr
    assert "Traceback" not in done.stderr


def test_the_verb_imports_the_server_only_when_it_is_called() -> None:
    code = (
        "import sys, cosim, cosim.cli.serve; print([n for n in ('starlette', 'uvicorn', 'jinja2') if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=HERE.parent, check=True)
    assert done.stdout.strip() == "[]"


# The diagnosis itself


def test_the_command_line_that_does_the_same_is_written_down(tmp_path: Path) -> None:
    said = {"columns": {"tau": "the force"}, "units": {"q": "deg"}, "layout": {}}
    uploads = (Upload(name="run 1.csv", size=1, options=said), Upload(name="b.csv", size=1, role="heldout"))
    order = Order(uploads, tmp_path, tmp_path / "card.toml", "axis.toml", tmp_path / "out")
    assert command(order) == (
        "cosim diagnose 'run 1.csv' --heldout b.csv --card axis.toml --columns 'run 1.csv:tau=the force' "
        "--units 'run 1.csv:q=deg' --out result"
    )


def test_a_diagnosis_names_files_as_the_user_knows_them(tmp_path: Path) -> None:
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "short.csv").write_text("t,tau,q\n0,1,2\n1,2,3\n", "utf-8")
    (tmp_path / "card.toml").write_text(CARD, "utf-8")
    order = Order(
        (Upload(name="short.csv", size=1),),
        tmp_path / "recordings",
        tmp_path / "card.toml",
        "axis.toml",
        tmp_path / "out",
    )
    with pytest.raises(InputError) as refused:
        diagnose_order(order)
    assert str(refused.value).startswith("short.csv")
    (tmp_path / "card.toml").write_text("[mount]\n", "utf-8")
    with pytest.raises(InputError, match=r"^axis\.toml: \[mount\] inertia is missing"):
        diagnose_order(order)


def test_no_room_on_the_disk_is_a_sentence(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    from cosim.serve import uploads

    def full(*_: object) -> None:
        raise OutputError("3 MB are needed and the disk has 1 MB: remove older diagnoses.")

    monkeypatch.setattr(uploads, "check_room", full)
    answer = put(client, new(client), "run.csv", recording())
    assert "remove older diagnoses" in answer.json()["problem"]


def test_a_file_with_signs_in_its_name_arrives(client: TestClient, desk: Desk) -> None:
    job = new(client)
    name = "Lauf #1 & 50% + Übung.csv"
    assert client.put(f"{job}/files?name={quote(name)}", content=recording()).status_code == 201
    assert state_of(desk, job).uploads[0].name == name
    assert ORIGIN
