"""An adapter in Python is a drive like any other, and what it raises is a fault."""

from pathlib import Path

import numpy as np
import pytest
from on_hardware import SCENARIO, SIMULATED, assert_safe, invoke, recorded, scenario

from cosim.hardware.machine import changed, read_machine
from cosim.hardware.replay import replay
from cosim.hardware.session import Session, run_session
from cosim.support.errors import CosimError

DRIVE = """
from cosim.hardware.python_adapter import PythonAdapter, Order, Reading

UP = {6: 0x21, 7: 0x23, 15: 0x27, 0: 0x40}
FIRST = 2**32 - 100

class Wall(PythonAdapter):
    '''A drive that goes up as it is told and whose axis rests whatever the torque; `later`: after 2000 samples.'''

    log = []

    def __init__(self, step):
        super().__init__(step)
        self.samples, self.torque, self.word, self.closed = FIRST, 0.0, 0x40, False

    def write(self, order):
        self.asked("write", None)
        self.log.append((order.tick, order.controlword, order.torque))
        enabled = order.controlword == 15
        self.word, self.torque = UP.get(order.controlword, 0x40), order.torque if enabled else 0.0

    def read(self):
        self.samples += 1
        return self.asked("read", Reading(-1, self.samples, self.word, self.torque))

    def status(self):
        return self.asked("status", super().status())

    def asked(self, what, answer):
        return answer if self.samples <= FIRST + 2000 else self.later(what, answer)

    def later(self, what, answer):
        return answer

    def close(self):
        self.closed = True

class Failing(Wall):
    def later(self, what, answer):
        raise OSError(f"no {what}")

class Mute(Wall):
    later = lambda self, what, answer: 1 / 0 if what == "write" else answer

class Lost(Wall):
    later = lambda self, what, answer: {}["state"] if what == "status" else answer

class Unwell(Wall):
    later = lambda self, what, answer: 2 if what == "status" else answer

class Sleepy(Wall):
    later = lambda self, what, answer: None if what == "read" else answer

class Nothing:
    pass
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "drive.py"
    path.write_text(DRIVE, "utf-8")
    return path


def session(tmp_path: Path, kind: str) -> Session:
    given = changed(SIMULATED, "test", adapter=f"{tmp_path / 'drive.py'}:{kind}")
    return Session(scenario(), given, tmp_path / "box", fast=True)


def test_orders_reach_an_adapter_in_python_and_its_readings_the_loop(tmp_path: Path, file: Path) -> None:
    with session(tmp_path, "Wall") as one:
        log = one.transport.one.log  # type: ignore[attr-defined]
        done = run_session(one)
    assert (done["completed"], "adapter_error" in done) == (True, False)
    assert (one.transport.python, one.transport.one.closed) == (True, True)  # type: ignore[attr-defined]
    found = recorded(tmp_path)
    orders = np.array(log)
    assert np.array_equal(orders[1:-1, 2], found["machine.order"][:-1]), "an order acts one tick after its sample"
    assert orders[-1, 1] == orders[-1, 2] == 0, "the last order is zero"
    assert found["machine.order"].any()
    assert np.all(found["machine.counts"] == 2**32 - 1), "counts are taken modulo 2^32"
    assert np.all(np.diff(found["machine.encoder"]) % 2**32 == 1), "and so are samples"
    assert replay(found).identical


@pytest.mark.parametrize(
    ("kind", "fault", "within", "error"),
    [
        ("Failing", "adapter_failed", 2, "OSError: no read"),
        ("Mute", "adapter_failed", 2, "ZeroDivisionError: division by zero"),
        ("Lost", "adapter_failed", 2, "KeyError: 'state'"),
        ("Unwell", "adapter_failed", 2, None),
        ("Sleepy", "frame_lost", 4, None),
    ],
)
def test_an_adapter_that_fails_or_falls_silent_is_a_fault_and_what_it_raised_first_is_told(
    tmp_path: Path, file: Path, kind: str, fault: str, within: int, error: str | None
) -> None:
    with session(tmp_path, kind) as one:
        done = run_session(one)
    assert fault in done["faults"]
    assert_safe(recorded(tmp_path), fault, 2000, within)
    assert done.get("adapter_error") == error


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
