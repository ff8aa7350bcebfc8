"""An adapter in Python is a drive like any other, and what it raises is a fault."""

import ctypes
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from on_hardware import SCENARIO, SIMULATED, assert_safe, invoke, recorded, scenario

from cosim.hardware.machine import changed, read_machine
from cosim.hardware.python_adapter import Order, PythonAdapter, PythonTransport, Reading
from cosim.hardware.replay import replay
from cosim.hardware.session import Session, run_session
from cosim.hardware.structures import CFeedback, COrder
from cosim.support.errors import CosimError

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the loop needs absolute sleeps")

DRIVE = """
from cosim.hardware.python_adapter import PythonAdapter, Order, Reading

UP = {6: 0x21, 7: 0x23, 15: 0x27, 0: 0x40}

class Wall(PythonAdapter):
    '''A drive that goes up as it is told and whose axis rests whatever the torque.'''

    log = []

    def __init__(self, step):
        super().__init__(step)
        self.samples, self.torque, self.word = 0, 0.0, 0x40

    def write(self, order):
        self.log.append((order.tick, order.controlword, order.torque))
        enabled = order.controlword == 15
        self.word, self.torque = UP.get(order.controlword, 0x40), order.torque if enabled else 0.0

    def read(self):
        self.samples += 1
        return Reading(-1, self.samples, self.word, self.torque)

class Failing(Wall):
    def read(self):
        if self.samples == 2000:
            raise OSError("the cable is gone")
        return super().read()

class Unwell(Wall):
    def status(self):
        return int(self.samples > 2000)

class Sleepy(Wall):
    def read(self):
        found = super().read()
        return None if self.samples > 2000 else found

class Nothing:
    pass
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "drive.py"
    path.write_text(DRIVE, "utf-8")
    return path


def session(tmp_path: Path, kind: str, **options: Any) -> Session:
    given = changed(SIMULATED, "test", adapter=f"{tmp_path / 'drive.py'}:{kind}")
    return Session(scenario(), given, tmp_path / "box", **({"fast": True} | options))


def test_orders_reach_an_adapter_in_python_and_its_readings_the_loop(tmp_path: Path, file: Path) -> None:
    with session(tmp_path, "Wall") as one:
        log = one.transport.one.log  # type: ignore[attr-defined]
        assert run_session(one)["completed"]
    found = recorded(tmp_path)
    orders = np.array(log)
    assert np.array_equal(orders[1:-1, 2], found["machine.order"][:-1]), "an order acts one tick after its sample"
    assert orders[-1, 1] == orders[-1, 2] == 0, "the last order is zero"
    assert found["machine.order"].any()
    assert np.all(found["machine.counts"] == 2**32 - 1), "counts are taken modulo 2^32"
    assert np.all(np.diff(found["machine.encoder"]) == 1)
    assert replay(found).identical


@pytest.mark.parametrize(
    ("kind", "fault", "within"),
    [("Failing", "adapter_failed", 2), ("Unwell", "adapter_failed", 2), ("Sleepy", "frame_lost", 4)],
)
def test_an_adapter_that_fails_or_falls_silent_is_a_fault(
    tmp_path: Path, file: Path, kind: str, fault: str, within: int
) -> None:
    with session(tmp_path, kind) as one:
        done = run_session(one)
    assert fault in done["faults"]
    assert_safe(recorded(tmp_path), fault, 1999, within)
    assert done.get("adapter_error") == ("OSError: the cable is gone" if kind == "Failing" else None)


@pytest.mark.parametrize(
    ("adapter", "sentence"),
    [
        ("gone.py:Wall", "the file does not exist"),
        ("drive.py:Gone", 'there is no function "Gone"; there are: '),
        ("drive.py:Nothing", "is no PythonAdapter"),
    ],
)
def test_what_is_no_adapter_is_refused_in_a_sentence(tmp_path: Path, file: Path, adapter: str, sentence: str) -> None:
    (tmp_path / "m.toml").write_text(machine_file(adapter), "utf-8")
    with pytest.raises(CosimError, match=sentence):
        Session(scenario(), read_machine(tmp_path / "m.toml"), tmp_path / "box")
    assert not (tmp_path / "box").exists()


def machine_file(adapter: str) -> str:
    limits = "\n".join(f"{name} = {value}" for name, value in SIMULATED.limits.model_dump().items())
    late = "[reactions]\nlate_in_a_row = 1000\nlate_in_window = 64\nwindow_ms = 1.0\n"
    return f'name = "mine"\nadapter = "{adapter}"\n[limits]\n{limits}\n{late}'


def test_in_real_time_the_loop_of_an_adapter_in_python_is_a_thread(tmp_path: Path, file: Path) -> None:
    (tmp_path / "s.toml").write_text(SCENARIO, "utf-8")
    (tmp_path / "m.toml").write_text(machine_file("drive.py:Wall"), "utf-8")
    found = invoke("check", str(tmp_path / "s.toml"), "--machine", str(tmp_path / "m.toml"), "--seconds", "0.05")
    assert found.exit_code == 0, found.output
    assert "drive.py:Wall" in found.output


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
