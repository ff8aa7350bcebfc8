"""Many requests at once: files whole, limits kept; connections that say nothing or never end harm nobody."""

import json
import logging
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
import serve_work
from serving import act, asked, client_of, desk_at, headers_to, id_of, listened, new, ready, recording, state_of
from waiting import until

from cosim.support.errors import InputError
from cosim_serve import connection
from cosim_serve.desk import Desk
from cosim_serve.uploads import Limits

FEW = Limits(files=3, job=60_000, file=40_000)


@contextmanager
def served(home: Path, work: Any, limits: Limits | None = None) -> Iterator[tuple[Desk, int, str]]:
    """A desk, its port, and the address of a draft."""
    with desk_at(home, work, limits) as desk, listened(desk) as port:
        yield desk, port, new(client_of(desk))
        while LINES:
            LINES.pop().close()


@pytest.fixture
def there(tmp_path: Path) -> Iterator[tuple[Desk, int, str]]:
    with served(tmp_path / "data", serve_work.quickly) as made:
        yield made


@pytest.fixture
def slow(tmp_path: Path) -> Iterator[tuple[Desk, int, str]]:
    with served(tmp_path / "data", serve_work.for_ever, FEW) as made:
        yield made


LINES: list[socket.socket] = []
"""Connections of a test, which end with it."""


def line(port: int, text: str = "") -> socket.socket:
    made = socket.create_connection(("127.0.0.1", port), timeout=60)
    LINES.append(made)
    made.sendall(text.replace("\n", "\r\n").encode())
    return made


def is_ended(one: socket.socket) -> bool:
    """Whether the other side has ended a connection."""
    one.setblocking(False)
    try:
        while text := one.recv(65536):
            assert text
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True


def head_of(port: int, method: str, path: str) -> str:
    said = {"Host": f"127.0.0.1:{port}"} | headers_to(port)
    return f"{method} {path} HTTP/1.1\n" + "".join(f"{key}: {value}\n" for key, value in said.items())


def test_many_connections_that_say_nothing_do_not_silence_the_page(
    there: tuple[Desk, int, str], capfd: Any, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    port = there[1]
    monkeypatch.setattr(connection, "MOST", 16)
    texts = ("", "GET / HTTP/1.1\nHost: ", "GET / HT")
    lines = [line(port, text) for _ in range(connection.MOST) for text in texts]
    for _ in range(3):
        assert asked(port, "GET", "/", seconds=30) == 200
    monkeypatch.setattr(connection, "HEAD", 0.5)
    until(lambda: all(map(is_ended, lines)))
    assert capfd.readouterr() == ("", "")
    assert [one for one in caplog.records if one.levelno > logging.INFO] == []


@pytest.mark.parametrize(
    ("said", "part"),
    [("", b"X: y\r\n"), ("Transfer-Encoding: chunked\n\n", b"1\r\nx\r\n"), ("Content-Length: 1000000\n\n", b"x")],
    ids=["a head", "chunks", "a body of stated size"],
)
def test_what_does_not_get_on_is_ended_and_leaves_nothing(there: Any, said: str, part: bytes, monkeypatch: Any) -> None:
    desk, port, job = there
    for name, seconds in {"HEAD": 0.5, "STALLED": 0.5, "LOOK": 0.1}.items():
        monkeypatch.setattr(connection, name, seconds)
    slow = line(port, head_of(port, "PUT", f"{job}/files?name=a.csv") + said)

    def dripped() -> bool:
        try:
            slow.sendall(part)
        except OSError:
            return True
        return is_ended(slow)

    until(dripped)
    until(lambda: not [one for one, _, _ in os.walk(desk.store.home) if Path(one).parent.name == "arriving"])
    assert not desk.store.all()[0].uploads


def test_an_answer_that_nobody_takes_is_ended(there: tuple[Desk, int, str], monkeypatch: pytest.MonkeyPatch) -> None:
    desk, port, _ = there
    monkeypatch.setattr(connection, "STALLED", 0.5)
    monkeypatch.setattr(connection, "LOOK", 0.1)
    job = desk.store.new()
    desk.store.result(job.id).mkdir()
    (desk.store.result(job.id) / "a.fmu").write_bytes(bytes(30_000_000))
    ended, end = threading.Event(), connection.Connection.connection_lost
    monkeypatch.setattr(connection.Connection, "connection_lost", lambda *given: (end(*given), ended.set())[0])
    deaf = line(port, head_of(port, "GET", f"/jobs/{job.id}/result/a.fmu") + "\n")
    assert ended.wait(60)  # nothing is taken meanwhile, and buffers do not hold it all
    taken = 0
    with suppress(ConnectionError):
        while text := deaf.recv(1 << 20):
            taken += len(text)
    assert taken < 30_000_000


def test_a_body_that_gets_on_slowly_arrives(there: tuple[Desk, int, str], monkeypatch: pytest.MonkeyPatch) -> None:
    _, port, job = there
    monkeypatch.setattr(connection, "STALLED", 3.0)
    monkeypatch.setattr(connection, "LEAST", 10)
    monkeypatch.setattr(connection, "LOOK", 0.1)
    slow = line(port, head_of(port, "PUT", f"{job}/files?name=a.csv") + "Content-Length: 3000\n\n")
    for _ in range(20):
        slow.sendall(b"1,2,3,4,5," * 15)
        time.sleep(0.2)
    assert slow.recv(100).startswith(b"HTTP/1.1 201")


@pytest.mark.parametrize(
    "text",
    [
        "\x00\x01garbage\n\n",
        "GET / HTTP/9.9\n\n",
        "GET / HTTP/1.1\nHost: a\nUpgrade: websocket\nConnection: upgrade\n\n",
        "POST /jobs HTTP/1.1\nContent-Length: -1\n\n",
        "X" * 100_000,
    ],
)
def test_what_is_no_request_is_refused_and_says_nothing_in_the_terminal(there: Any, text: str, capfd: Any) -> None:
    port = there[1]
    for _ in range(5):
        with suppress(ConnectionError):  # the rest of it was not read
            assert line(port, text).recv(100).startswith(b"HTTP/1.1 4")
    assert asked(port, "GET", "/") == 200
    assert capfd.readouterr() == ("", "")


class Upload:
    """An upload that comes in pieces, when they are sent."""

    def __init__(self, port: int, job: str, name: str, content: bytes, stated: bool = True) -> None:
        self.content, self.stated = content, stated
        size = f"Content-Length: {len(content)}" if stated else "Transfer-Encoding: chunked"
        self.line = line(port, head_of(port, "PUT", f"{job}/files?name={name}") + f"{size}\n\n")
        self._send(content[:1000])

    def _send(self, part: bytes) -> None:
        self.line.sendall(part if self.stated else b"%x\r\n%s\r\n" % (len(part), part))

    def finish(self) -> tuple[int, str]:
        """Send the rest; status and problem."""
        try:
            self._send(self.content[1000:])
            if not self.stated:
                self.line.sendall(b"0\r\n\r\n")
        except OSError:  # refused before
            pass
        text = b""
        while not text.rstrip().endswith(b"}"):
            text += self.line.recv(65536)
        self.line.close()
        head, _, body = text.partition(b"\r\n\r\n")
        return int(head.split()[1]), json.loads(body).get("problem", "")


def together(work: Callable[[int], None], count: int) -> None:
    """Call `work` with each number below `count`, in as many threads."""
    threads = [threading.Thread(target=work, args=(number,)) for number in range(count)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()


def on_their_way(desk: Desk, job: str) -> int:
    folders = os.walk(desk.store.home / id_of(job) / "arriving")  # one may go while it is looked into
    return sum(len(files) for _, _, files in folders)


def whole(desk: Desk, job: str) -> dict[str, bytes]:
    return {one.name: one.read_bytes() for one in (desk.store.home / id_of(job) / "recordings").iterdir()}


@pytest.mark.parametrize("stated", [True, False])
def test_of_two_uploads_of_one_name_the_first_arrives_whole(slow: tuple[Desk, int, str], stated: bool) -> None:
    desk, port, job = slow
    first, second = recording(300, 1), recording(500, 2)
    one = Upload(port, job, "a.csv", first, stated)
    until(lambda: on_their_way(desk, job) == 1)
    status, problem = Upload(port, job, "A.csv", second, stated).finish()
    assert (status, "is being uploaded already" in problem) == (400, True)
    assert one.finish() == (201, "")
    assert whole(desk, job) == {"a.csv": first}
    assert on_their_way(desk, job) == 0


def test_as_many_files_are_taken_as_there_may_be_however_many_come_at_once(slow: tuple[Desk, int, str]) -> None:
    desk, port, job = slow
    answers: list[int] = []

    def put(number: int) -> None:
        answers.append(asked(port, "PUT", f"{job}/files?name=n{number}.csv", recording(30)))

    together(put, 10)
    assert sorted(answers) == [201] * 3 + [400] * 7
    assert len(state_of(desk, job).uploads) == len(whole(desk, job)) == 3


@pytest.mark.parametrize("stated", [True, False])
def test_bytes_on_their_way_count_before_they_have_come(slow: tuple[Desk, int, str], stated: bool) -> None:
    desk, port, job = slow
    content = b"t,tau,q\n" + b"1,2,3\n" * 5800
    assert len(content) < FEW.file < FEW.job < 2 * len(content)
    first, second = (Upload(port, job, f"{name}.csv", content, stated) for name in "ab")
    done = sorted([first.finish(), second.finish()])
    assert [status for status, _ in done] == [201, 400]
    assert "too large: at most" in done[1][1]
    assert sum(map(len, whole(desk, job).values())) <= FEW.job
    assert Upload(port, job, "c.csv", recording(30)).finish()[0] == 201, "what was refused leaves its place"


def test_an_upload_that_ends_after_the_start_or_the_end_of_a_job_is_refused(slow: tuple[Desk, int, str]) -> None:
    desk, port, removed = slow
    client = client_of(desk)
    job = ready(client)
    late, gone = (Upload(port, one, "late.csv", recording(900)) for one in (job, removed))
    until(lambda: on_their_way(desk, job) == on_their_way(desk, removed) == 1)
    act(client, job, "start")
    act(client, removed, "remove")
    until(lambda: desk.queue.progress.answer)
    status, problem = late.finish()
    assert (status, "started before this file had come" in problem) == (400, True)
    assert gone.finish()[0] == 400
    assert [one.name for one in state_of(desk, job).uploads] == ["run1.csv", "heldout.csv"]
    assert set(whole(desk, job)) == {"run1.csv", "heldout.csv"}
    assert on_their_way(desk, job) == 0
    assert [one.name for one in desk.store.home.iterdir()] == [id_of(job)]


@pytest.mark.parametrize("work", ["look", "card"])
def test_what_is_looked_at_while_the_diagnosis_starts_is_not_kept(slow: Any, work: str, monkeypatch: Any) -> None:
    """Looking takes seconds; whoever presses the button meanwhile has started what was there."""
    desk = slow[0]
    client = client_of(desk)
    job = ready(client)
    reads = getattr(desk.reader, work)

    def started_meanwhile(*given: Any) -> Any:
        if not state_of(desk, job).live:
            desk.start(id_of(job))
        return reads(*given)

    before = desk.views(state_of(desk, job)), desk.card_text(state_of(desk, job))
    monkeypatch.setattr(desk.reader, work, started_meanwhile)
    form = {"look": {"file": "run1.csv", "units.q": "deg"}, "card": {"text": "[mount]\ninertia = 2.0\n"}}[work]
    answer = act(client, job, "correct" if work == "look" else "card", **form)
    assert (answer.status_code, "cannot be changed now" in answer.text) == (400, True)
    assert not any(one.options.get("units") for one in state_of(desk, job).uploads)
    assert (desk.views(state_of(desk, job)), desk.card_text(state_of(desk, job))) == before


def test_a_file_of_which_the_rest_never_comes_leaves_its_place(slow: tuple[Desk, int, str]) -> None:
    desk, port, job = slow
    torn = Upload(port, job, "a.csv", recording(900))
    until(lambda: on_their_way(desk, job) == 1)
    torn.line.close()
    until(lambda: on_their_way(desk, job) == 0)
    assert Upload(port, job, "a.csv", recording()).finish() == (201, "")


def test_of_two_starts_at_once_one_counts(slow: tuple[Desk, int, str]) -> None:
    desk = slow[0]
    job = ready(client_of(desk))
    told: list[str] = []

    def start(_: int) -> None:
        try:
            desk.start(id_of(job))
        except InputError as error:
            told.append(str(error))

    together(start, 6)
    assert len(told) == 5
    assert all("it cannot be changed now" in one for one in told)
    assert desk.queue.before(id_of(job)) <= 1
