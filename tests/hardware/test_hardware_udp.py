"""Process data over UDP: what goes wrong on the way is recognised and counted; without orders there is no torque."""

import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

import numpy as np
import pytest
from on_hardware import INJECTED, SIMULATED, assert_safe, recorded, scenario, simulated
from over_udp import AT, SESSION, drive, faulty, frame, impatient, over, session, talking

from cosim.hardware.machine import changed
from cosim.hardware.replay import replay
from cosim.hardware.session import Session, run_session
from cosim.hardware.udp import FRAME, HELLO, MAGIC, WELCOME, closed, key_of, sealed, session_key
from cosim.hardware.virtual import parse_injection
from cosim.hardware.words import LINK
from cosim.support.errors import HardwareError

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the loop needs absolute sleeps")


def test_over_udp_the_commands_are_those_of_the_co_simulation_bit_for_bit(tmp_path: Path) -> None:
    with drive() as there, session(tmp_path, there.url) as one:
        done = run_session(one)
    assert done["completed"]
    machine, twin = recorded(tmp_path), simulated(scenario())
    stepped = machine["machine.notes"].astype(int) & 2 > 0
    assert np.array_equal(machine["machine.command"][stepped][:-1], twin["command"][1:])
    assert np.array_equal(machine["q"][stepped], twin["q"])
    wrong = {name: count for name, count in done["link"].items() if name not in ("sent", "good", "worst_round_trip_us")}
    assert not any(wrong.values())
    assert done["link"]["sent"] == done["link"]["good"] == len(machine)
    assert replay(machine).identical


FRAMES = {
    "lost": ("unanswered", 1, "frame_lost"),
    "late": ("late", 2, "frame_lost"),
    "corrupted": ("corrupted", 1, "frame_lost"),
    "duplicated": ("duplicated", 2, None),
    "reordered": ("reordered", 4, None),
}
"""Injected into the frames; what the loop notices, in which cycle from the first on; the fault it ends in."""


@pytest.mark.parametrize("kind", FRAMES)
def test_each_fault_of_a_frame_is_noticed_and_counted(tmp_path: Path, kind: str) -> None:
    noticed, within, fault = FRAMES[kind]
    with drive(faulty(kind=kind, lasts=0.02)) as there, impatient(session(tmp_path, there.url)) as one:
        done = run_session(one)
    found = recorded(tmp_path)
    begun, bit = round(AT / 1e-4), 1 << LINK.index(noticed)
    seen = np.flatnonzero(found["machine.link"].astype(int) & bit)
    assert 0 <= seen[0] - begun < within, "not before, and soon"
    assert done["completed"] == (fault is None)
    if fault:
        assert_safe(found, fault, begun, 4)
        assert done["link"]["good"] <= begun
    else:
        assert done["link"][noticed] >= 95
        assert not found["machine.faults"][-100:].any()
    assert replay(found).identical


@pytest.mark.parametrize("fault", [name for name in ("encoder_stale", "torque_mismatch")])
def test_faults_of_the_drive_itself_are_found_over_udp_as_in_one_process(tmp_path: Path, fault: str) -> None:
    inject, within = INJECTED[fault]
    with drive(faulty(**inject)) as there, impatient(session(tmp_path, there.url)) as one:
        done = run_session(one)
    assert fault in done["faults"]
    assert_safe(recorded(tmp_path), fault, round(AT / 1e-4), within)


def test_what_is_late_out_of_order_or_doubled_is_never_acted_upon(tmp_path: Path) -> None:
    kinds = ("late", "duplicated", "reordered")
    inject = [{"kind": kind, "at": AT + 0.02 * place, "lasts": 2e-4} for place, kind in enumerate(kinds)]
    with drive(changed(SIMULATED, "test", inject=inject)) as there, impatient(session(tmp_path, there.url)) as one:
        assert run_session(one)["completed"]
    found = recorded(tmp_path)
    fresh = found["machine.read"] == 0
    assert np.all(np.diff(found["machine.encoder"][fresh]) >= 1), "samples of the encoder only ever get newer"
    assert replay(found).identical


def test_a_drive_obeys_each_order_once_and_in_order_and_its_own_loop_only() -> None:
    with drive() as there, talking(there) as loop:
        whole, other = loop.order(3), frame(4, SESSION + 1, loop.key)
        for one in (loop.order(1), whole, whole, loop.order(2), other, whole[:-1], flipped(whole)):
            loop.send(one)
        answered = [loop.number() for _ in range(2)]
        loop.send(loop.order(5))
        answered.append(loop.number())
        orders = there.statistics["orders"]
    assert answered == [1, 3, 5]
    assert (orders["duplicated"], orders["reordered"], orders["foreign"], orders["corrupted"]) == (1, 1, 1, 2)
    assert orders["lost"] == 2


@pytest.mark.parametrize(("torque", "held", "state"), [(1.0, 1.0, 4), (np.nan, 0.0, 7), (-np.inf, 0.0, 7)])
def test_a_drive_gives_no_torque_that_is_no_number(torque: float, held: float, state: int) -> None:
    with drive() as there, talking(there) as loop:
        loop.enable()
        loop.obeyed(5, 15, torque)
        assert (there.drive.held, there.drive.state) == (held, state)


@contextmanager
def answering(make: Callable[[int, int, bytes], bytes]) -> Iterator[str]:
    """A drive made of Python that answers an order by what `make` returns for its session, number and key."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as there:
        there.bind(("127.0.0.1", 0))
        there.settimeout(0.02)
        over, nonce, key = Event(), b"n" * 16, [b""]

        def serve() -> None:
            while not over.is_set():
                with suppress(TimeoutError):
                    raw, back = there.recvfrom(256)
                    values = FRAME.unpack(raw[:-4])
                    if values[1] == HELLO:
                        key[0] = session_key(key_of(""), values[10], nonce)
                        there.sendto(sealed(WELCOME, values[2], 1e-4, nonce, key[0]), back)
                    else:
                        there.sendto(make(values[2], values[3], key[0]), back)

        thread = Thread(target=serve)
        thread.start()
        yield f"udp://127.0.0.1:{there.getsockname()[1]}"
        over.set()
        thread.join()


def flipped(raw: bytes) -> bytes:
    return raw[:-1] + bytes([raw[-1] ^ 1])


def answer(who: int, number: int, key: bytes, age: int = 0) -> bytes:
    return closed((MAGIC, 5, who, number, 0, 0x40, 7, number, age, 0.0, b""), key)


@pytest.mark.parametrize(
    ("make", "noticed"),
    [
        (answer, "good"),
        (lambda who, number, key: answer(who, number, key, age=100_000), "late"),
        (lambda who, number, key: answer(who, number + 1, key), "foreign"),
        (lambda who, number, key: answer(who ^ 2, number, key), "foreign"),
        (lambda who, number, key: answer(who, number, key_of("")), "foreign"),
        (lambda who, number, key: flipped(answer(who, number, key)), "corrupted"),
        (lambda who, number, key: answer(who, number, key) + b"?", "corrupted"),
        (lambda who, number, key: b"", "corrupted"),
    ],
)
def test_an_answer_is_a_sample_only_if_it_is_whole_fresh_and_to_this_very_order(
    tmp_path: Path, make: Callable[[int, int, bytes], bytes], noticed: str
) -> None:
    with answering(make) as url, impatient(session(tmp_path, url), 90) as one:
        one.advance(5)
        link = one.statistics["link"]
    assert {name: count for name, count in link.items() if count == 5} | {"sent": 5} == {
        "sent": 5,
        noticed: 5,
        **({"lost": 5} if noticed not in ("good", "late") else {}),
    }
    found = recorded(tmp_path)
    assert np.all(found["machine.read"] == (0 if noticed == "good" else 1))
    assert np.all(found["machine.counts"] == (7 if noticed == "good" else 0))


def test_a_loop_that_is_alive_is_not_pushed_aside(tmp_path: Path) -> None:
    slow = changed(SIMULATED, "test", watchdog_ms=5000.0)
    with drive(slow, lockstep=False) as there, Session(scenario(), over(there.url, slow), tmp_path / "a") as one:
        one.advance(10)
        with pytest.raises(HardwareError, match="taken by another loop"):
            Session(scenario(), over(there.url), tmp_path / "b")


def test_a_drive_that_is_not_there_is_refused_in_a_sentence(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(HardwareError, match=rf"No drive at udp://127.0.0.1:{port}: connection refused"):
        session(tmp_path, f"udp://127.0.0.1:{port}")
    assert not (tmp_path / "box").exists()


@pytest.mark.parametrize("answer", [b"", b"hello", None])
def test_what_is_no_drive_is_refused_in_a_sentence(tmp_path: Path, answer: bytes | None) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))

        def echo() -> None:
            while (got := other.recvfrom(256))[0] != b"end":
                if answer != b"":
                    other.sendto(answer or got[0], got[1])

        thread = Thread(target=echo)
        thread.start()
        sentence = "no answer within 1.6 s" if answer == b"" else "is no drive: it does not speak this protocol"
        try:
            with pytest.raises(HardwareError, match=sentence):
                session(tmp_path, f"udp://127.0.0.1:{other.getsockname()[1]}")
        finally:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
                end.sendto(b"end", other.getsockname())
            thread.join()


def test_a_port_that_is_taken_is_refused() -> None:
    with (
        drive() as there,
        pytest.raises(HardwareError, match=r"cannot listen at .* it is taken"),
        drive(port=there.port),
    ):
        pass


@pytest.mark.parametrize("url", ["udp://127.0.0.1", "udp://:4020", "udp://127.0.0.1:x", "tcp://127.0.0.1:4020"])
def test_an_adapter_that_is_none_is_refused(url: str) -> None:
    with pytest.raises(HardwareError, match='an adapter is "simulated" or "udp://HOST:PORT" or'):
        over(url)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("silence", {"kind": "silence", "at": 0.0}),
        ("silence:1.5", {"kind": "silence", "at": 1.5}),
        ("late:1.5:0.2:3", {"kind": "late", "at": 1.5, "lasts": 0.2, "size": 3.0}),
    ],
)
def test_an_injection_begins_at_once_unless_it_says_when(text: str, said: dict[str, object]) -> None:
    assert parse_injection(text) == said
    for wrong in ("late:x", "late:1:2:3:4", "gone"):
        with pytest.raises(HardwareError, match=r"no fault to inject|breaks a rule"):
            changed(SIMULATED, "--inject", inject=[parse_injection(wrong)])


def test_a_fault_of_frames_is_refused_where_there_are_none(tmp_path: Path) -> None:
    with pytest.raises(HardwareError, match="a fault of frames, and the drive in this process has none"):
        Session(scenario(), faulty(kind="late"), tmp_path / "box", fast=True)


def test_a_loop_without_a_clock_sleeps_as_it_waits_and_one_in_real_time_waits_as_its_machine_says(
    tmp_path: Path,
) -> None:
    with drive() as there, session(tmp_path / "fast", there.url) as one:
        assert one.transport.udp.spin == 0  # type: ignore[attr-defined]
        assert one.transport.udp.patience >= 1e9, "a drive without a clock may be a slow computer"  # type: ignore[attr-defined]
    machine = changed(
        SIMULATED, "test", clock=SIMULATED.clock.model_dump() | {"answer_us": 300.0, "answer_spin_us": 20.0}
    )
    with drive(machine, lockstep=False) as there:
        one = Session(scenario(), over(there.url, machine), tmp_path / "real")
        assert (one.transport.udp.patience, one.transport.udp.spin) == (300_000, 20_000)  # type: ignore[attr-defined]
        with one:
            pass


@pytest.mark.parametrize(
    ("options", "fast", "sentence"),
    [
        ({"step": 2e-4}, True, "has a cycle of 0.0002 s and the loop one of 0.0001 s"),
        ({"lockstep": False}, True, "runs in real time and a loop without a clock"),
        ({"lockstep": True}, False, "runs in lockstep, without a watchdog"),
    ],
)
def test_a_drive_with_another_time_is_refused(
    tmp_path: Path, options: dict[str, float], fast: bool, sentence: str
) -> None:
    with drive(**options) as there, pytest.raises(HardwareError, match=sentence):
        session(tmp_path, there.url, fast=fast)
