"""What adapters and buses are asked and what they answer, one call at a time, against stand-ins that note it."""

import ctypes
from types import SimpleNamespace
from typing import Any

import pytest

from cosim.hardware.python_adapter import Order, PythonAdapter, PythonTransport, Reading
from cosim.hardware.structures import CFeedback, COrder
from cosim.support.errors import HardwareError
from cosim_ethercat import drive as ethercat
from cosim_ethercat.drive import EthercatDrive
from cosim_ethercat.mapping import Ethercat, Layout


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
