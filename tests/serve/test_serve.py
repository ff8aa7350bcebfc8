"""The page's server: who may ask, the way into it, its port and processes, and what the diagnosis is told."""

import os
import re
import signal
import socket
import stat
import subprocess
import sys
from pathlib import Path

import httpx2
import pytest
from commands import python
from mortal import mortal
from serving import CARD, HERE, TOKEN, act, alive, client_of, new, put, ready, recording, state_of
from starlette.testclient import TestClient
from waiting import until

from cosim.support.errors import InputError, OutputError
from cosim.support.lock import claimed
from cosim_serve import example, uploads
from cosim_serve.desk import Desk
from cosim_serve.door import NAME, door
from cosim_serve.job import Upload
from cosim_serve.server import listening
from cosim_serve.work import Order, diagnose_order

POSIX = pytest.mark.skipif(os.name != "posix", reason="modes and /proc")


def test_without_the_token_nothing_is_answered(desk: Desk) -> None:
    stranger = client_of(desk, token="wrong")
    for address in ("/", "/page.js", "/jobs/20260101-000000-abcdef", "/?token=", "/?token=rightt"):
        assert stranger.get(address).status_code == 403, address
    assert stranger.post("/jobs").status_code == 403
    assert not desk.store.all()


@pytest.mark.parametrize(("site", "status"), [("none", 303), ("cross-site", 200)], ids=["typed", "from a file"])
def test_the_token_leaves_the_address_for_a_cookie_that_no_script_reads(desk: Desk, site: str, status: int) -> None:
    """Who comes from a file is led on by a page, as the cookie is not given to a redirect."""
    stranger = client_of(desk, token="wrong")
    answer = stranger.get(f"/?token={TOKEN}", headers={"sec-fetch-site": site}, follow_redirects=False)
    assert (answer.status_code, answer.headers.get("location", "/")) == (status, "/")
    assert ('content="0; url=/"' in answer.text) == (site == "cross-site")
    assert TOKEN not in answer.text
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
    del client.headers["origin"]
    assert (client.get("/").status_code, client.post("/jobs").status_code) == (200, 403), "a change needs an origin"
    assert not desk.store.all()


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


def begun(home: Path, **environment: str) -> tuple["subprocess.Popen[str]", str]:
    """A server with its folder, its address; a browser is opened where one is named."""
    quiet = () if environment else ("--no-browser",)
    command = mortal(sys.executable, "-m", "cosim", "serve", *quiet, "--data", str(home))
    pipe, env = subprocess.PIPE, os.environ | environment
    process = subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, cwd=HERE.parent, env=env)
    return process, process.stdout.readline().strip()


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


@pytest.mark.skipif(not Path("/proc").exists(), reason="processes are looked up in /proc")
@pytest.mark.parametrize(
    ("sign", "code", "before", "who"),
    [
        ("SIGKILL", -9, 0o775, "everybody"),
        ("SIGTERM", 143, 0o750, "its group"),
        ("SIGINT", 130, 0o700, ""),
    ],
)
def test_a_server_takes_its_processes_with_it(tmp_path: Path, sign: str, code: int, before: int, who: str) -> None:
    """It prints its address before, and leaves its folder as it was."""
    home = tmp_path / "project"
    home.mkdir()
    home.chmod(before)
    process, address = begun(home)
    try:
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[\w-]{30,}", address)
        assert httpx2.get(address, follow_redirects=True).status_code == 200
        threads = Path(f"/proc/{process.pid}/task").glob("*/children")
        own = [int(one) for path in threads for one in path.read_text().split()]
        assert own
        process.send_signal(getattr(signal, sign))
        process.wait(10)
        until(lambda: not any(map(alive, own)), 8)
    finally:
        process.kill()
        said = process.communicate()[1]
    assert (process.returncode, mode(home)) == (code, before)
    assert (f"{home} can be entered by {who}" in said) == bool(who)


def test_this_machine_alone_is_listened_to_and_a_taken_port_is_a_sentence() -> None:
    with listening(0) as first:
        host, port = first.getsockname()
        assert host == "127.0.0.1"
        socket.create_connection((host, port), timeout=10).close()  # the address is told before the server answers
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


def test_without_its_extra_one_sentence_says_how_to_get_it() -> None:
    done = python("-c", "import sys; sys.modules['starlette'] = None; from cosim.cli import main; main(['serve'])")
    assert done.returncode == 2
    assert 'pip install "starlette' in done.stderr
    assert "Traceback" not in done.stderr


@POSIX
def test_the_browser_is_opened_with_a_file_of_its_owner_alone_that_leads_to_the_address(tmp_path: Path) -> None:
    told, home = tmp_path / "told", tmp_path / "data"
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\necho "$@" > {told}.new && mv {told}.new {told}\n', "utf-8")
    browser.chmod(0o755)
    process, address = begun(home, BROWSER=f"{browser} %s")
    try:
        until(told.exists)
        given = told.read_text("utf-8").strip()
        assert given == (home / NAME).as_uri()
        token = address.partition("token=")[2]
        assert len(token) > 30
        assert token not in given
        assert mode(home / NAME) == 0o600
        assert f"url={address}" in (home / NAME).read_text("utf-8")
    finally:
        process.terminate()
        process.communicate(timeout=60)
    assert not (home / NAME).exists()


@POSIX
def test_the_file_leads_to_the_address_by_hand_too_and_what_lies_at_its_place_is_not_followed(tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.write_text("kept", "utf-8")
    (tmp_path / NAME).symlink_to(other)
    with door(tmp_path, "http://127.0.0.1:1/?token=a&b") as path:
        assert not path.is_symlink()
        assert re.search(r'href="http://127\.0\.0\.1:1/\?token=a&amp;b"', path.read_text("utf-8"))
    assert other.read_text("utf-8") == "kept"
    with door(tmp_path / "nowhere", "http://127.0.0.1:1/?token=x") as path:
        assert path is None


@POSIX
def test_what_the_page_makes_is_closed_to_others(tmp_path: Path, desk: Desk) -> None:
    job = desk.store.new()
    folder = desk.store.folder(job.id)
    assert [mode(one) for one in (desk.store.home, folder, folder / "recordings", folder / "views")] == [0o700] * 4
    with desk.arriving(job.id, "a.csv", 10) as arrival:
        assert mode(arrival.path.parent) == 0o700
    made = Desk(tmp_path / "one" / "two", reader=desk.reader)
    assert mode(made.store.home) == 0o700
    made.queue.close()


def test_a_diagnosis_names_files_as_the_user_knows_them(tmp_path: Path) -> None:
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "short.csv").write_text("t,tau,q\n0,1,2\n1,2,3\n", "utf-8")
    (tmp_path / "card.toml").write_text(CARD, "utf-8")
    uploads, places = (Upload(name="short.csv", size=1),), (tmp_path / "recordings", tmp_path / "card.toml")
    order = Order(uploads, *places, "axis.toml", tmp_path / "out")
    with pytest.raises(InputError) as refused:
        diagnose_order(order)
    assert str(refused.value).startswith("short.csv")
    (tmp_path / "card.toml").write_text("[mount]\n", "utf-8")
    with pytest.raises(InputError, match=r"^axis\.toml: \[mount\] inertia is missing"):
        diagnose_order(order)


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
    put(client, job, "rest.csv", b"t,tau,q\n" + b"".join(b"%.2f,0,0\n" % (k / 100) for k in range(400)))
    assert "No card can be estimated: " in act(client, job, "estimate").text
    act(client, job, "drop", file="rest.csv")
    moving = example.recordings()[example.NAMES[0]].encode()
    put(client, job, "one.csv", moving)
    assert "The end of the only recording is for validation" in client.get(job).text
    act(client, job, "estimate")
    inertia = float(re.findall(r"^inertia = ([\d.]+)", desk.card_text(state_of(desk, job)), re.MULTILINE)[0])
    assert inertia == pytest.approx(example.INERTIA, rel=0.05)
    assert desk.lacking(state_of(desk, job)) == []
    put(client, job, "two.csv", moving)
    assert "two.csv, the last one, is for validation" in client.get(job).text


def test_no_room_on_the_disk_is_a_sentence(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OutputError("3 MB are needed and the disk has 1 MB: remove older diagnoses.")

    monkeypatch.setattr(uploads, "check_room", full)
    answer = put(client, new(client), "run.csv", recording())
    assert "remove older diagnoses" in answer.json()["problem"]
