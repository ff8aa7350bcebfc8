"""Process data over UDP: what goes wrong on the way is recognised and counted; commands and the test move over it."""

import json
import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from mmap import mmap
from pathlib import Path
from threading import Event, Thread

import numpy as np
import pytest
from on_hardware import SCENARIO, SIMULATED, altered, assert_safe, invoke, recorded, scenario, simulated
from over_udp import AT, SESSION, drive, faulty, frame, impatient, over, session, talking

from cosim.cli.drive import _plant
from cosim.hardware.loops import bare_clock
from cosim.hardware.machine import changed
from cosim.hardware.move import try_move
from cosim.hardware.replay import replay
from cosim.hardware.session import Session, run_session
from cosim.hardware.udp import FRAME, HELLO, MAGIC, WELCOME, closed, key_of, sealed, session_key
from cosim.hardware.virtual import parse_injection
from cosim.hardware.words import LINK
from cosim.support.errors import HardwareError


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
    fresh = found["machine.encoder"][found["machine.read"] == 0]
    assert np.all(np.diff(fresh) >= 1), "what is late, out of order or doubled is never acted upon"
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
def replying(reply: Callable[[bytes], bytes | None]) -> Iterator[str]:
    """A socket made of Python that replies to each frame, or says nothing."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as there:
        there.bind(("127.0.0.1", 0))
        there.settimeout(0.02)
        over = Event()

        def serve() -> None:
            while not over.is_set():
                with suppress(TimeoutError):
                    raw, back = there.recvfrom(256)
                    if (said := reply(raw)) is not None:
                        there.sendto(said, back)

        thread = Thread(target=serve)
        thread.start()
        yield f"udp://127.0.0.1:{there.getsockname()[1]}"
        over.set()
        thread.join()


def answering(make: Callable[[int, int, bytes], bytes]) -> Callable[[bytes], bytes]:
    """A drive made of Python that answers an order by what `make` returns for its session, number and key."""
    nonce, key = b"n" * 16, [b""]

    def reply(raw: bytes) -> bytes:
        values = FRAME.unpack(raw[:-4])
        if values[1] != HELLO:
            return make(values[2], values[3], key[0])
        key[0] = session_key(key_of(""), values[10], nonce)
        return sealed(WELCOME, values[2], 1e-4, nonce, key[0])

    return reply


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
def test_an_answer_is_a_sample_only_if_it_is_whole_fresh_and_to_this_very_order(tmp_path, make, noticed) -> None:
    with replying(answering(make)) as url, impatient(session(tmp_path, url), 90) as one:
        one.advance(5)
        link = one.statistics["link"]
    lost = {"lost": 5} if noticed not in ("good", "late") else {}
    assert {name: count for name, count in link.items() if count == 5} == {"sent": 5, noticed: 5} | lost
    found = recorded(tmp_path)
    assert np.all(found["machine.read"] == (0 if noticed == "good" else 1))
    assert np.all(found["machine.counts"] == (7 if noticed == "good" else 0))


def test_a_loop_that_is_alive_and_a_port_that_is_taken_are_not_pushed_aside(tmp_path: Path) -> None:
    slow = altered(watchdog_ms=5000.0)
    with drive(slow, lockstep=False) as there, Session(scenario(), over(there.url, slow), tmp_path / "a") as one:
        one.advance(10)
        with pytest.raises(HardwareError, match="taken by another loop"):
            Session(scenario(), over(there.url), tmp_path / "b")
        with pytest.raises(HardwareError, match=r"cannot listen at .* it is taken"), drive(port=there.port):
            pass


@pytest.mark.parametrize(
    ("reply", "sentence"),
    [
        (lambda _: None, "no answer within 1.6 s"),
        (lambda _: b"hello", "is no drive: it does not speak this protocol"),
        (lambda raw: raw, "is no drive: it does not speak this protocol"),
    ],
    ids=["silence", "another protocol", "an echo"],
)
def test_what_is_no_drive_is_refused_in_a_sentence(tmp_path, reply, sentence) -> None:
    with replying(reply) as url, pytest.raises(HardwareError, match=sentence):
        session(tmp_path, url)
    assert not (tmp_path / "box").exists()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("silence", {"kind": "silence", "at": 0.0}),
        ("silence:1.5", {"kind": "silence", "at": 1.5}),
        ("late:1.5:0.2:3", {"kind": "late", "at": 1.5, "lasts": 0.2, "size": 3.0}),
    ],
)
def test_an_injection_begins_at_once_unless_it_says_when_and_one_of_frames_needs_frames(tmp_path, text, said) -> None:
    assert parse_injection(text) == said
    for wrong in ("late:x", "late:1:2:3:4", "gone"):
        with pytest.raises(HardwareError, match=r"no fault to inject|breaks a rule"):
            changed(SIMULATED, "--inject", inject=[parse_injection(wrong)])
    with pytest.raises(HardwareError, match="a fault of frames, and the drive in this process has none"):
        Session(scenario(), faulty(kind="late"), tmp_path / "box", fast=True)


def test_a_loop_without_a_clock_sleeps_as_it_waits_and_one_in_real_time_waits_as_its_machine_says(tmp_path) -> None:
    with drive() as there, session(tmp_path / "fast", there.url) as one:
        assert one.transport.udp.spin == 0  # type: ignore[attr-defined]
        assert one.transport.udp.patience >= 1e9, "a drive without a clock may be a slow computer"  # type: ignore[attr-defined]
    machine = altered(clock={"answer_us": 300.0, "answer_spin_us": 20.0})
    with drive(machine, lockstep=False) as there:
        with Session(scenario(), over(there.url, machine), tmp_path / "real") as one:
            udp = one.transport.udp  # type: ignore[attr-defined]
        assert (udp.patience, udp.spin) == (300_000, 20_000)


@pytest.mark.parametrize(
    ("options", "fast", "sentence"),
    [
        ({"step": 2e-4}, True, "has a cycle of 0.0002 s and the loop one of 0.0001 s"),
        ({"step": 1e-4 * (1 + 1.1e-9)}, True, "has a cycle of 0.0001 s and the loop one of 0.0001 s"),
        ({"step": 1e-4 * (1 - 1.1e-9)}, True, "has a cycle of 0.0001 s and the loop one of 0.0001 s"),
        ({"step": 1e-4 * (1 + 0.9e-9)}, True, ""),
        ({"step": 1e-4 * (1 - 0.9e-9)}, True, ""),
        ({"lockstep": False}, True, "runs in real time and a loop without a clock"),
        ({"lockstep": True}, False, "runs in lockstep, without a watchdog"),
    ],
)
def test_a_drive_and_a_loop_agree_on_a_cycle_to_its_last_digits_and_on_who_has_the_clock(
    tmp_path: Path, options: dict[str, float], fast: bool, sentence: str
) -> None:
    refused = pytest.raises(HardwareError, match=sentence) if sentence else nullcontext()
    with drive(**options) as there, refused, session(tmp_path, there.url, fast=fast):
        pass


def test_the_commands_check_and_run_over_udp(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(SCENARIO, "utf-8")
    with drive() as there:
        arguments = [str(tmp_path / "s.toml"), "--drive", there.url, "--out", str(tmp_path / "out")]
        done = invoke("run", *arguments, "--fast", "--json")
        assert done.exit_code == 0, done.output
        assert json.loads((tmp_path / "out" / "run.json").read_text("utf-8"))["link"]["lost"] == 0
    with drive(lockstep=False) as there:
        done = invoke("check", str(tmp_path / "s.toml"), "--drive", there.url, "--seconds", "0.05")
        assert done.exit_code == 0, done.output
        assert there.url in done.output
        assert "duplicated" in done.output
    done = invoke("check", str(tmp_path / "s.toml"), "--drive", there.url)
    assert done.exit_code == 2
    assert f"No drive at {there.url}: connection refused" in " ".join(done.output.split())


def test_a_drive_of_a_card_has_the_cards_encoder() -> None:
    with ExitStack() as stack:
        plant, step, quantum = _plant("paper_mount", 1e-4, stack)
        assert (plant.torque, plant.position, step) == ("tau", "q", 1e-4)
        assert quantum == pytest.approx(2 * np.pi / 2**32)
        with pytest.raises(HardwareError, match=r"no such scenario or card; .*sidereal, .*paper_mount"):
            _plant("nonsense", 1e-4, stack)


@pytest.mark.parametrize(
    ("scale", "sentence"),
    [
        (0.5, "about 2.1 times the counts per turn"),
        (3.0, "about 0.45 times the counts per turn"),
        (1 / 60, r"ended in: .*scaling of the encoder"),
    ],
)
def test_the_test_move_finds_an_encoder_that_counts_wrongly(scale: float, sentence: str) -> None:
    with drive(scale=scale) as there, pytest.raises(HardwareError, match=sentence):
        try_move(scenario(), over(there.url), fast=True)
    assert there.drive.held == 0


def test_the_test_move_of_an_encoder_that_counts_right_is_small_and_shows_the_inertia() -> None:
    with drive() as there:
        move = try_move(scenario(), over(there.url), fast=True)
    assert move.scale == pytest.approx(1, rel=1e-3), "the drive has rested elsewhere than its twin"
    assert move.seen == pytest.approx(24.5, rel=0.03), "30 kg m2 of the card, less 5.5 of its elastic friction at 10 Hz"
    assert move.way <= 0.2 * SIMULATED.limits.following_error
    assert move.torque <= 0.5 * SIMULATED.limits.torque


def test_a_supervisor_drains_each_record_once_while_the_loop_goes_on(tmp_path: Path) -> None:
    with drive() as there, session(tmp_path, there.url) as one:
        drained = []
        for cycles in (1, 700, 0, 299):
            one.advance(cycles)
            drained.append(one.drain())
    assert [len(records) for records in drained] == [1, 700, 0, 299]
    sequence = np.concatenate([records["sequence"] for records in drained])
    assert np.array_equal(sequence, np.arange(1, 1001))
    assert np.array_equal(np.concatenate(drained)["sample"]["tick"], recorded(tmp_path)["machine.tick"])


def test_a_loop_in_this_process_locks_what_is_in_use_and_lets_go_of_it() -> None:
    """Python reserves far more than it uses: made resident, it would stay so until the process ends."""

    def held(what: str) -> int:
        """Memory of this process [kB]."""
        told = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text("utf-8").splitlines())
        return int(told[what].split()[0])

    with mmap(-1, 2**30):
        before = held("VmRSS")
        bare_clock(1e-3, 20.0, 0.05)
        assert held("VmRSS") - before < 200_000
    assert held("VmLck") == 0
