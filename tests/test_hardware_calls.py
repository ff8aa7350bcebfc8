"""What adapters, moves and loops ask of those that they call, one call at a time, against stand-ins that note it."""

import ctypes
import re
import socket
from pathlib import Path
from time import sleep
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from on_hardware import SIMULATED, scenario
from over_udp import drive

from cosim.data.recording import Recording
from cosim.hardware import ethercat, loops, move, udp, virtual
from cosim.hardware.ethercat import EthercatDrive
from cosim.hardware.loops import Called, Threaded, bare_clock
from cosim.hardware.machine import Machine
from cosim.hardware.mapping import Ethercat, Layout
from cosim.hardware.python_adapter import Order, PythonAdapter, PythonTransport, Reading
from cosim.hardware.story import Story
from cosim.hardware.structures import CFeedback, COrder, CSession
from cosim.hardware.udp import UdpDrive, reach
from cosim.support.errors import HardwareError


def bus(rated: float = 100.0) -> Any:
    """An EtherCAT drive without its way up, on a bus that notes what is sent."""
    one = object.__new__(EthercatDrive)
    one._name, one._given = "test", Ethercat(rated_torque=rated)
    one._out, one._in = Layout(one._given.outputs), Layout(one._given.inputs)
    one._samples = one._cycles = 0
    one._soem = SimpleNamespace(OP_STATE=8, INIT_STATE=1, al_status_code_to_string=lambda code: f"code {code}")
    one._slave = SimpleNamespace(output=b"", input=b"", state=8, al_status=26)
    sent: list[str] = []
    one._master = SimpleNamespace(  # type: ignore[assignment]
        expected_wkc=3,
        sent=sent,
        send_processdata=lambda: sent.append("out"),
        receive_processdata=lambda wait: sent.append(f"in {wait}") or 3,
        read_state=lambda: sent.append("state"),
    )
    return one


@pytest.mark.parametrize(("torque", "per_mille"), [(0.0, 0), (70.0, 700), (-49.94, -499), (-49.96, -500), (0.04, 0)])
def test_torque_is_sent_in_per_mille_of_the_rated_one(torque: float, per_mille: int) -> None:
    one = bus()
    one.write(Order(5, 0x0F, torque))
    assert one._slave.output == (0x0F).to_bytes(2, "little") + per_mille.to_bytes(2, "little", signed=True) + b"\x0a"
    assert one._master.sent == ["out"], "mode 10, cyclic synchronous torque"


def image(status: int, mode: int = 10, torque: int = 700, position: int = -7) -> bytes:
    head = status.to_bytes(2, "little") + position.to_bytes(4, "little", signed=True)
    return head + torque.to_bytes(2, "little", signed=True) + mode.to_bytes(1, "little", signed=True)


def test_a_reading_is_in_newton_metres_and_each_is_a_new_sample() -> None:
    one = bus(rated=50.0)
    one._slave.input = image(0x1237)
    assert one.read() == Reading(-7, 1, 0x1237, 35.0)
    assert one.read() == Reading(-7, 2, 0x1237, 35.0)
    assert one._master.sent == ["in 2000"] * 2
    one._master.expected_wkc = 4
    assert one.read() is None
    assert one._samples == 2


@pytest.mark.parametrize(
    ("status", "mode", "good"),
    [(0x27, 10, True), (0x27, 8, False), (0x237, 8, False), (0x21, 8, True), (0x07, 8, True), (0x6F, 8, True)],
)
def test_only_a_drive_that_is_enabled_must_show_its_mode(status: int, mode: int, good: bool) -> None:
    """CiA 402: enabled is 0x27 of the bits 0x6F."""
    one = bus()
    one._slave.input = image(status, mode)
    if good:
        assert one.read() is not None
        return
    with pytest.raises(HardwareError, match="test is enabled in mode 8, not 10"):
        one.read()


def test_the_state_of_a_slave_is_looked_at_in_every_twentieth_cycle() -> None:
    one = bus()
    looked = []
    for cycle in range(1, 61):
        assert one.status() == 0
        if one._master.sent:
            looked.append(cycle)
            one._master.sent.clear()
    assert looked == [20, 40, 60]
    one._slave.state = 4
    assert [one.status() for _ in range(19)] == [0] * 19
    with pytest.raises(HardwareError, match="test has left operation of the bus: code 26"):
        one.status()


def test_waits_on_a_bus_are_those_of_the_documentation() -> None:
    """docs/hardware.md: a frame has 2 ms; the way to operation takes a second at most."""
    assert (ethercat.TORQUE_MODE, ethercat.CHECKED_EVERY, ethercat.FRAME_US) == (10, 20, 2000)
    assert ethercat.TRIES * ethercat.STATE_US == 1_000_000


class Scripted(PythonAdapter):
    """An adapter that gives what a test wants, or fails."""

    def __init__(self, reading: Reading | None = None, fails: str = "") -> None:
        super().__init__(1e-3)
        self.reading, self.fails, self.orders, self.closed = reading, fails, [], False

    def write(self, order: Order) -> None:
        if "write" in self.fails:
            raise ValueError("no wire")
        self.orders.append(order)

    def read(self) -> Reading | None:
        if "read" in self.fails:
            raise OSError("no answer")
        return self.reading

    def status(self) -> int:
        if "status" in self.fails:
            raise KeyError("state")
        return super().status()

    def close(self) -> None:
        self.closed = True


def test_what_an_adapter_says_goes_into_the_sample_modulo_2_to_the_32() -> None:
    transport, feedback = PythonTransport(Scripted(Reading(-1, 2**32 + 5, 0x27, 1.5))), CFeedback()
    assert transport._read(None, ctypes.pointer(feedback)) == 0
    assert (feedback.counts, feedback.encoder, feedback.statusword, feedback.torque) == (2**32 - 1, 5, 0x27, 1.5)
    order = COrder(tick=4, controlword=15, torque=-2.5)
    assert transport._write(None, ctypes.pointer(order)) == 0
    assert transport.one.orders == [Order(4, 15, -2.5)]  # type: ignore[attr-defined]
    assert transport._status(None) == 0
    assert transport.statistics() == {}
    assert transport.python
    transport.close()
    assert transport.one.closed  # type: ignore[attr-defined]


def test_an_adapter_that_fails_is_said_by_what_it_raised_first() -> None:
    transport = PythonTransport(Scripted(None))
    assert transport._read(None, ctypes.pointer(CFeedback())) == 1, "nothing new"
    transport = PythonTransport(Scripted(None, "read write status"))
    assert transport._read(None, ctypes.pointer(CFeedback())) == 2
    assert transport._write(None, ctypes.pointer(COrder())) == 1
    assert transport._status(None) == 1
    assert transport.statistics() == {"adapter_error": "OSError: no answer"}


def moving(monkeypatch: pytest.MonkeyPatch, torques: list[float], inertias: list[float]) -> list[tuple[Any, ...]]:
    """Let each move of a test move need a torque and show an inertia; what was asked for."""
    asked: list[tuple[Any, ...]] = []
    need = iter(torques)

    def moved(what: Any, machine: Machine, way: float, needed: float, fast: bool) -> Recording:
        asked.append((what.ticks, machine.adapter, way, needed, fast))
        return Recording("move", {"t": np.zeros(2), "machine.order": np.array([0.0, -next(need)])})

    seen = iter(inertias)
    monkeypatch.setattr(move, "_moved", moved)
    monkeypatch.setattr(move, "_inertia", lambda *_: next(seen))
    return asked


def test_a_move_takes_a_fifth_of_the_following_error_and_a_quarter_of_the_torque(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Needed at first: twice a quarter; so the way is halved, and then it stays."""
    limits = SIMULATED.limits
    quarter = limits.torque / 4
    asked = moving(monkeypatch, [2 * quarter, quarter, 0.9 * quarter], [30.0, 31.0])
    found = move.try_move(scenario(), SIMULATED)
    way = 0.2 * limits.following_error
    assert [one[2] for one in asked] == pytest.approx([way, way / 2, way / 2])
    assert [one[3] for one in asked] == pytest.approx([limits.torque, limits.torque, quarter])
    assert [one[4] for one in asked] == [True, True, False]
    assert {one[0] for one in asked} == {7000}, "six periods and one more at 10 Hz, 0.1 ms each"
    assert (found.way, found.expected, found.seen) == (pytest.approx(way / 2), 30.0, 31.0)
    assert found.torque == pytest.approx(0.9 * quarter)


@pytest.mark.parametrize(("seen", "good"), [(1.49, True), (0.67, True), (1.51, False), (0.66, False)])
def test_a_move_is_right_up_to_a_factor_of_one_and_a_half(
    seen: float, good: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    moving(monkeypatch, [1.0] * 3, [1.0, seen])
    if good:
        assert move.try_move(scenario(), SIMULATED, fast=True).scale == pytest.approx(1 / seen)
        return
    with pytest.raises(HardwareError, match=f"as if its encoder had about {1 / seen:.2g} times the counts"):
        move.try_move(scenario(), SIMULATED, fast=True)


def library_of(calls: list[Any], **also: Any) -> Any:
    """A library whose functions note that they were called."""
    names = ("hardware_run", "hardware_release", "hardware_bare")
    made = {name: lambda *given, name=name: calls.append((name, *given[1:])) for name in names}
    return lambda: SimpleNamespace(**(made | also))


def test_a_loop_that_is_called_runs_what_it_is_told_and_ends_without_torque(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[Any] = []
    monkeypatch.setattr(loops, "library", library_of(calls))
    one = Called("session", "sample")  # type: ignore[arg-type]
    assert one.alive
    one.start()
    one.go(7)
    one.stop()
    assert calls == [("hardware_run", "sample", 7), ("hardware_release",)]


def test_a_loop_in_a_thread_runs_until_it_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[Any] = []
    session = SimpleNamespace(stop=0)

    def run(*given: Any) -> None:
        while not session.stop:
            sleep(0.001)
        sleep(0.05)  # its last cycle
        calls.append(("hardware_run", *given[1:]))

    monkeypatch.setattr(loops, "library", library_of(calls, hardware_run=run))
    one = Threaded(session, "sample")  # type: ignore[arg-type]
    one.start()
    one.go(3)
    one.stop()
    assert session.stop == 1
    assert calls == [("hardware_run", "sample", 2**62), ("hardware_release",)], "no torque once its last cycle is over"


def test_a_bare_clock_is_asked_in_nanoseconds_and_answers_in_microseconds(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []

    def bare(session: CSession, edges: int) -> None:
        asked.append((session.period, session.spin, edges))
        session.tick, session.late, session.worst = edges, 3, 12_500

    monkeypatch.setattr(loops, "library", lambda: SimpleNamespace(hardware_bare=bare))
    assert bare_clock(1.0, 20.0, 30.4) == (30, 3, 12.5)
    assert asked == [(1_000_000_000, 20_000, 30)]


def test_a_loop_without_a_clock_waits_a_second_for_its_drive_and_asks_eight_times_whether_it_is_there() -> None:
    with drive() as there:
        machine = SIMULATED.model_copy(update={"adapter": there.url})
        one = UdpDrive(machine, 1e-4, True)
        assert (one.udp.patience, one.udp.spin) == (1_000_000_000, 0)
        assert not one.python, "its loop is a process of its own"
        one.close()
    assert (udp.TRIES, udp.PATIENCE) == (8, 0.2)


def test_a_socket_waits_a_fifth_of_a_second_and_talks_to_one_place_only() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as there:
        there.bind(("127.0.0.1", 0))
        one = reach(f"udp://127.0.0.1:{there.getsockname()[1]}")
        assert one.gettimeout() == 0.2
        assert one.getpeername() == there.getsockname()
        one.close()


def test_a_drive_waits_five_seconds_for_its_plant_and_is_looked_at_a_hundred_times_a_second() -> None:
    assert (virtual.POLL, virtual.LONGEST, virtual.LEASE, virtual.AHEAD) == (0.01, 5.0, 1e9, 1000)
    assert loops.POLL == 0.002


STORY: dict[str, Any] = {
    "step": 1e-3,
    "quantum": 1e-6,
    "inputs": ["q", "q_d"],
    "encoder": "q",
    "output": "tau",
    "units": {},
    "machine": SIMULATED.model_dump(),
    "controller": {"sha256": "0" * 64},
}


@pytest.mark.parametrize(
    ("changes", "good"),
    [
        ({}, True),
        ({"quantum": 1e-30}, True),
        ({"quantum": 1e30}, True),
        ({"quantum": 0.99e-30}, False),
        ({"quantum": 1.01e30}, False),
        ({"inputs": ["q_d", *(f"i{k}" for k in range(6)), "q"]}, True),
        ({"inputs": ["q_d", *(f"i{k}" for k in range(7)), "q"]}, False),
        ({"inputs": ["q_d"], "encoder": "q_d"}, True),
        ({"inputs": []}, False),
        ({"encoder": "p"}, False),
        ({"inputs": ["q", "p"]}, False),
        ({"controller": {"sha256": "0" * 63}}, False),
        ({"controller": {"sha256": "G" * 64}}, False),
        ({"more": 1}, True),
    ],
)
def test_a_story_has_what_a_replay_needs(changes: dict[str, Any], good: bool) -> None:
    if good:
        assert Story.model_validate(STORY | changes).encoder == changes.get("encoder", "q")
        return
    with pytest.raises(ValueError, match="validation error"):
        Story.model_validate(STORY | changes)


def test_a_solver_says_why_it_failed_by_the_number_that_c_gives() -> None:
    from cosim.master import exchange

    header = Path(exchange.__file__).with_name("loop") / "rodas4.h"
    body = re.search(r"enum \{ SOLVED, ([^}]*?) \}", header.read_text("utf-8"))
    assert body is not None
    words = {
        "SINGULAR": "singular",
        "NOT_FINITE": "not finite",
        "STEP_TOO_SMALL": "too small",
        "TOO_MANY_STEPS": "million",
    }
    said = {number: words[name] for number, name in enumerate(body[1].split(", "), 1)}
    assert list(said) == list(exchange._REASONS)
    assert all(word in exchange._REASONS[number] for number, word in said.items())
    assert exchange.TOLERANCE == 1e-8
