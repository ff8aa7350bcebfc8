"""Process data over UDP: what goes wrong on the way is recognised and counted; without orders there is no torque."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np
import pytest
from benchmarks import hardware as benchmark
from test_hardware import INJECTED, SCENARIO, SIMULATED, assert_safe, invoke, recorded, scenario, simulated

from cosim.cli_cache import fmu_of_card
from cosim.cli_drive import _plant
from cosim.errors import HardwareError
from cosim.exchange import open_fmu
from cosim.hardware.loops import bare_clock
from cosim.hardware.machine import Machine, changed, read_machine
from cosim.hardware.move import try_move
from cosim.hardware.replay import replay
from cosim.hardware.session import Session, run_session
from cosim.hardware.simulated import Plant
from cosim.hardware.udp import FRAME, UdpDrive, opened, sealed
from cosim.hardware.virtual import VirtualDrive, parse_injection, plant_of
from cosim.hardware.wired import wire_up
from cosim.hardware.words import LINK, STATES, faults_of
from cosim.recording import Recording

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the loop needs absolute sleeps")

AT = 0.2


@contextmanager
def drive(
    given: Machine = SIMULATED, *, lockstep: bool = True, scale: float = 1.0, **options: Any
) -> Iterator[VirtualDrive]:
    with ExitStack() as stack:
        what = scenario()
        wired = wire_up(what, stack)
        plant = Plant(wired.plant, wired.torque, wired.position)
        yield stack.enter_context(
            VirtualDrive(
                plant, given, options.pop("step", what.step), wired.quantum * scale, lockstep=lockstep, **options
            )
        )


def over(url: str, given: Machine = SIMULATED, **changes: Any) -> Machine:
    return changed(given, "test", adapter=url, **changes)


def faulty(**inject: Any) -> Machine:
    return changed(SIMULATED, "test", inject=[{"at": AT} | inject])


def session(folder: Path, url: str, given: Machine = SIMULATED, **options: Any) -> Session:
    return Session(scenario(), over(url, given), folder / "box", **({"fast": True} | options))


def impatient(one: Session, milliseconds: int = 10) -> Session:
    """Wait for an answer that does not come for so long only."""
    assert isinstance(one.transport, UdpDrive)
    one.transport.udp.patience = milliseconds * 1_000_000
    return one


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


@pytest.mark.parametrize("fault", [name for name in INJECTED if name != "frame_lost"])
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


def frame(sequence: int, session: int, word: int = 0, torque: float = 1.0) -> bytes:
    body = FRAME.pack(0x3143534D, 4, session, sequence, sequence, word, 0, 0, 0, torque, 0)
    return body + zlib.crc32(body).to_bytes(4, "little")


def test_a_drive_obeys_each_order_once_and_in_order_and_its_own_loop_only() -> None:
    with drive() as there, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as loop:
        loop.settimeout(5)
        loop.connect((there.host, there.port))
        loop.send(sealed(1, 77, 1e-4))
        assert opened(loop.recv(256), 77) == (2, 0, 1e-4)
        whole = frame(3, 77)
        for one in (frame(1, 77), whole, whole, frame(2, 77), frame(4, 78), whole[:-1], whole[:20] + b"?" + whole[21:]):
            loop.send(one)
        answered = [FRAME.unpack(loop.recv(256)[:-4])[3] for _ in range(2)]
        loop.send(frame(5, 77))
        answered.append(FRAME.unpack(loop.recv(256)[:-4])[3])
        orders = there.statistics["orders"]
    assert answered == [1, 3, 5]
    assert (orders["duplicated"], orders["reordered"], orders["foreign"], orders["corrupted"]) == (1, 1, 1, 2)
    assert orders["lost"] == 2


@pytest.mark.parametrize(("torque", "held", "state"), [(1.0, 1.0, 4), (np.nan, 0.0, 7), (-np.inf, 0.0, 7)])
def test_a_drive_gives_no_torque_that_is_no_number(torque: float, held: float, state: int) -> None:
    with drive() as there, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as loop:
        loop.settimeout(5)
        loop.connect((there.host, there.port))
        loop.send(sealed(1, 77, 1e-4))
        assert opened(loop.recv(256), 77) == (2, 0, 1e-4)
        for sequence, word in enumerate((0, 6, 7, 15, 15), 1):
            loop.send(frame(sequence, 77, word, torque if sequence == 5 else 0.0))
            loop.recv(256)
        assert (there.drive.held, there.drive.state) == (held, state)


@contextmanager
def answering(make: Callable[[int, int], bytes]) -> Iterator[str]:
    """A drive made of Python that answers an order by what `make` returns for its session and number."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as there:
        there.bind(("127.0.0.1", 0))
        there.settimeout(0.02)
        over = Event()

        def serve() -> None:
            while not over.is_set():
                with suppress(TimeoutError):
                    raw, back = there.recvfrom(256)
                    kind, who, number = FRAME.unpack(raw[:-4])[1:4]
                    there.sendto(sealed(2, who, 1e-4) if kind == 1 else make(who, number), back)

        thread = Thread(target=serve)
        thread.start()
        yield f"udp://127.0.0.1:{there.getsockname()[1]}"
        over.set()
        thread.join()


def answer(who: int, number: int, age: int = 0) -> bytes:
    body = FRAME.pack(0x3143534D, 5, who, number, 0, 0x40, 7, number, age, 0.0, 0)
    return body + zlib.crc32(body).to_bytes(4, "little")


@pytest.mark.parametrize(
    ("make", "noticed"),
    [
        (answer, "good"),
        (lambda who, number: answer(who, number, age=100_000), "late"),
        (lambda who, number: answer(who, number + 1), "foreign"),
        (lambda who, number: answer(who ^ 2, number), "foreign"),
        (lambda who, number: answer(who, number)[:-1] + b"?", "corrupted"),
        (lambda who, number: answer(who, number) + b"?", "corrupted"),
        (lambda who, number: b"", "corrupted"),
    ],
)
def test_an_answer_is_a_sample_only_if_it_is_whole_fresh_and_to_this_very_order(
    tmp_path: Path, make: Callable[[int, int], bytes], noticed: str
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
        sentence = "no answer within 1 s" if answer == b"" else "is no drive: it does not speak this protocol"
        try:
            with pytest.raises(HardwareError, match=sentence):
                session(tmp_path, f"udp://127.0.0.1:{other.getsockname()[1]}")
        finally:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
                end.sendto(b"end", other.getsockname())
            thread.join()


@pytest.mark.parametrize(
    ("options", "fast", "sentence"),
    [
        ({"step": 2e-4}, True, "has a cycle of 0.0002 s and the loop one of 0.0001 s"),
        ({"lockstep": False}, True, "runs in real time and a loop without a clock"),
        ({"lockstep": True}, False, "runs in lockstep, without a watchdog"),
    ],
)
def test_a_drive_with_another_time_is_refused(
    tmp_path: Path, options: dict[str, Any], fast: bool, sentence: str
) -> None:
    with drive(**options) as there, pytest.raises(HardwareError, match=sentence):
        session(tmp_path, there.url, fast=fast)


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


@pytest.mark.parametrize("text", ["late:x", "late:1:2:3:4", "gone"])
def test_an_injection_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(HardwareError, match=r"no fault to inject|breaks a rule"):
        changed(SIMULATED, "--inject", inject=[parse_injection(text)])


def test_a_fault_of_frames_is_refused_where_there_are_none(tmp_path: Path) -> None:
    with pytest.raises(HardwareError, match="a fault of frames, and the drive in this process has none"):
        Session(scenario(), faulty(kind="late"), tmp_path / "box", fast=True)


PATIENT = changed(
    read_machine("virtual"), "test", reactions=read_machine("virtual").reactions.model_dump() | {"heartbeat_ms": 500.0}
)
"""A machine whose reactions wait for a computer that has more to do."""


def operating(one: Session) -> Session:
    """Bring a session in real time into operation, with torque; on a computer that is too late for that, skip."""
    for _ in range(20):
        with suppress(HardwareError):
            one.enable()
            if one.track(2000).torque:
                return one
    pytest.skip("this computer was never in time for a second of operation")


def box_of(folder: Path) -> Recording:
    found = recorded(folder)
    assert found["machine.order"].any()
    assert replay(found).identical
    return found


def wait_for(condition: Callable[[], bool], seconds: float = 5.0) -> None:
    last = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < last, "it did not happen in time"
        time.sleep(0.001)


def test_when_the_loop_is_killed_the_drive_lets_go_by_its_watchdog(tmp_path: Path) -> None:
    with drive(PATIENT, lockstep=False) as there, session(tmp_path, there.url, PATIENT, fast=False) as one:
        operating(one)
        trips = there.virtual.trips
        os.kill(one.loop.process, signal.SIGKILL)
        with pytest.raises(HardwareError, match="ended by signal SIGKILL; the drive's watchdog takes the torque away"):
            one.advance(10_000)
        wait_for(lambda: there.drive.held == 0)
        assert there.drive.state == STATES.index("fault") or "deadline" in one.status.faults, "this computer was late"
        if there.virtual.trips > trips:
            assert there.virtual.taken != 0
            assert 20e6 <= there.virtual.silence < 1e9, "20 ms, and what this computer adds"
    box_of(tmp_path)


SUPERVISOR = """
import sys
from pathlib import Path
sys.path.insert(0, {tests!r})
from test_hardware import scenario
from test_hardware_udp import PATIENT, operating, over
from cosim.hardware.session import Session
with Session(scenario(("stop = 0.4", "stop = 30.0")), over({url!r}, PATIENT), Path({box!r})) as one:
    operating(one)
    print(one.loop.process, flush=True)
    one.track()
"""


@contextmanager
def spawned(*arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """A process of Python that is gone afterwards."""
    process = subprocess.Popen([sys.executable, *arguments], stdout=subprocess.PIPE)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def line_of(process: subprocess.Popen[bytes]) -> bytes:
    assert process.stdout is not None
    return process.stdout.readline()


def test_when_python_is_killed_the_loop_notices_takes_the_torque_to_zero_and_leaves(tmp_path: Path) -> None:
    with drive(PATIENT, lockstep=False) as there:
        code = SUPERVISOR.format(tests=str(Path(__file__).parent), url=there.url, box=str(tmp_path / "box"))
        with spawned("-c", code) as process:
            loop = int(line_of(process) or pytest.skip("this computer was never in time"))
        try:
            wait_for(lambda: not Path(f"/proc/{loop}").exists())
        except AssertionError:
            os.kill(loop, signal.SIGKILL)
            raise
        assert there.drive.held == 0
    found = box_of(tmp_path)
    assert {"heartbeat_lost", "deadline"} & set(faults_of(int(found["machine.faults"][-1]))), "or it was late before"
    assert found["machine.order"][-1] == 0


@contextmanager
def drive_process(tmp_path: Path, port: int, *options: str) -> Iterator[subprocess.Popen[bytes]]:
    """`cosim hardware virtual-drive`, up to its first word."""
    (tmp_path / "s.toml").write_text(SCENARIO, "utf-8")
    verb = ("-m", "cosim", "hardware", "virtual-drive", str(tmp_path / "s.toml"), "--port", str(port), "--json")
    with spawned(*verb, *options) as process:
        assert json.loads(line_of(process)) == {"what": "state", "state": "not ready", "torque": 0.0}
        yield process


def test_when_the_drive_is_killed_the_loop_orders_zero_and_a_new_drive_has_no_torque(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with (
        drive_process(tmp_path, port, "--machine", "virtual") as process,
        session(tmp_path, f"udp://127.0.0.1:{port}", PATIENT, fast=False) as one,
    ):
        operating(one)
        process.kill()
        process.wait()
        ended = one.track()
        assert not ended.running
        assert (ended.state, ended.torque) == ("fault", 0)
        assert {"frame_lost", "deadline"} & set(ended.faults), "or it was late before"
    box_of(tmp_path)
    with drive_process(tmp_path, port, "--inject", "late:0.1:0.2:3", "--counts-per-turn", "65536") as again:
        again.send_signal(signal.SIGINT)
        assert again.wait(10) == 0


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
    assert "No drive at" in done.output


def test_a_drive_of_a_card_has_the_cards_encoder() -> None:
    with ExitStack() as stack:
        plant, step, quantum = _plant("paper_mount", 1e-4, stack)
        assert (plant.torque, plant.position, step) == ("tau", "q", 1e-4)
        assert quantum == pytest.approx(2 * np.pi / 2**32)
    with (
        ExitStack() as stack,
        pytest.raises(HardwareError, match=r"no such scenario or card; .*sidereal, .*paper_mount"),
    ):
        _plant("nonsense", 1e-4, stack)
    with ExitStack() as stack, pytest.raises(HardwareError, match='no plant of a drive: it has no input "tau"'):
        plant_of(stack.enter_context(open_fmu(fmu_of_card("paper_mount", "controller", print), "controller")))


@pytest.mark.parametrize(("scale", "times"), [(0.5, "2.1"), (3.0, "0.45")])
def test_the_test_move_finds_an_encoder_that_counts_wrongly(scale: float, times: str) -> None:
    with drive(scale=scale) as there, pytest.raises(HardwareError, match=f"about {times} times the counts per turn"):
        try_move(scenario(), over(there.url), fast=True)
    assert there.drive.held == 0


def test_the_test_move_ends_in_a_sentence_where_the_loop_cannot_even_follow() -> None:
    with drive(scale=1 / 60) as there, pytest.raises(HardwareError, match=r"ended in: .*scaling of the encoder"):
        try_move(scenario(), over(there.url), fast=True)
    assert there.drive.held == 0


def test_the_test_move_of_an_encoder_that_counts_right_is_small_and_shows_the_inertia() -> None:
    with drive() as there:
        move = try_move(scenario(), over(there.url), fast=True)
    assert move.scale == pytest.approx(1, rel=1e-3), "the drive has rested elsewhere than its twin"
    assert move.seen == pytest.approx(30, rel=0.25), (
        "the inertia of the paper's mount, less some of its elastic friction"
    )
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


def test_records_that_the_ring_has_overwritten_are_missing_not_wrong(tmp_path: Path) -> None:
    short = changed(SIMULATED, "test", black_box_seconds=0.05)
    with Session(scenario(), short, tmp_path / "box", fast=True) as one:
        one.advance(1234)
        records = one.drain()
    assert records["sequence"][-1] == 1234
    assert np.all(np.diff(records["sequence"].astype(int)) == 1)
    assert 400 < len(records) <= 500


def test_a_fault_that_the_benchmark_injects_becomes_a_row_of_its_page() -> None:
    trials = [benchmark.injected("lost", {}, "frame_lost", 0.1), benchmark.injected("lost", {}, "estop", 0.1)]
    seen, missed = (benchmark.row("lost", "frame_lost", [one]) for one in trials)
    assert (seen["detected"], seen["cycles"], seen["states"], seen["torque_after"]) == (1.0, [3, 3], ["fault"], 0.0)
    assert missed["detected"] == 0.0
    page = "\n".join(benchmark.fault_lines({"rows": [seen], "detected": 1.0}))
    assert "| lost | `frame_lost` | 100% of 1 | 3 | fault | 0 |" in page


def test_a_bare_clock_counts_its_edges() -> None:
    edges, late, worst = bare_clock(1e-3, 20.0, 0.05)
    assert edges >= 50
    assert 0 <= late <= edges
    assert worst > 0
