"""Adapters in Python: one of the user's is a drive like any other, and so is a drive on EtherCAT.

What an adapter raises is a fault. On the bus: the bytes of process data, the way up, what is refused or noticed.
"""

import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fake_soem
import numpy as np
import pytest
from on_hardware import SCENARIO, SIMULATED, altered, assert_safe, invoke, recorded, scenario
from pydantic import ValidationError

from cosim.hardware.machine import Machine, parse_machine, read_machine
from cosim.hardware.replay import replay
from cosim.hardware.session import Session, run_session
from cosim.support.errors import CosimError, HardwareError, MissingPackageError
from cosim_ethercat.drive import CHECKED_EVERY, FRAME_US, STATE_US, TRIES
from cosim_ethercat.mapping import Entry, Ethercat, Layout

LIMITS = "[limits]\n" + "".join(f"{name} = {value}\n" for name, value in SIMULATED.limits.model_dump().items())
"""As a machine file has them."""
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


def of_python(tmp_path: Path, kind: str) -> Session:
    given = altered(adapter=f"{tmp_path / 'drive.py'}:{kind}")
    return Session(scenario(), given, tmp_path / "box", fast=True)


def test_orders_reach_an_adapter_in_python_and_its_readings_the_loop(tmp_path: Path, file: Path) -> None:
    with of_python(tmp_path, "Wall") as one:
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
    with of_python(tmp_path, kind) as one:
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
    late = "[reactions]\nlate_in_a_row = 1000\nlate_in_window = 64\nwindow_ms = 1.0\n"
    return f'name = "mine"\nadapter = "{adapter}"\n{LIMITS}{late}'


def test_in_real_time_the_loop_of_an_adapter_in_python_is_a_thread(tmp_path: Path, file: Path) -> None:
    (tmp_path / "s.toml").write_text(SCENARIO, "utf-8")
    (tmp_path / "m.toml").write_text(machine_file("drive.py:Wall"), "utf-8")
    found = invoke("check", str(tmp_path / "s.toml"), "--machine", str(tmp_path / "m.toml"), "--seconds", "0.05")
    assert found.exit_code == 0, found.output
    assert "drive.py:Wall" in found.output


# A drive on EtherCAT.

RATED = 100.0


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch) -> type[fake_soem.Master]:
    class Fresh(fake_soem.Master):
        pass

    monkeypatch.setitem(sys.modules, "pysoem", fake_soem)
    monkeypatch.setattr(fake_soem, "Master", Fresh)
    return Fresh


def machine(interface: str = "fake0", **ethercat: Any) -> Machine:
    section = {"rated_torque": RATED} | ethercat
    return altered(adapter=f"ethercat:{interface}", limits={"torque_mismatch": RATED / 1000}, ethercat=section)


def session(folder: Path, given: Machine | None = None) -> Session:
    return Session(scenario(), given or machine(), folder / "box", fast=True)


def test_a_layout_is_the_entries_one_after_the_other_little_endian_and_signed_where_they_are() -> None:
    named = [("controlword", 0x6040, 16), ("torque", 0x6071, 16), ("mode", 0x6060, 8)]
    entries = [Entry(name=name, object=index, bits=bits) for name, index, bits in named]
    layout = Layout([entries[0], Entry(object=0x60FE, subindex=1, bits=32), *entries[1:]])
    raw = layout.pack({"controlword": 0x800F, "torque": -2, "mode": 10})
    assert raw == bytes.fromhex("0f80 00000000 feff 0a")
    assert layout.unpack(raw) == {"controlword": 0x800F, "torque": -2, "mode": 10}
    assert [layout.entries[1].mapped, Entry(object=0x60FE, subindex=255, bits=32).mapped] == [0x60FE0120, 0x60FEFF20]


def test_what_a_machine_file_does_not_say_of_the_bus_is_what_the_documentation_and_cia_402_say() -> None:
    """docs/hardware.md shows the section with all defaults; CiA 402-2: objects and sizes; ETG.1000.6: first PDOs."""
    text = (Path(__file__).parents[2] / "docs" / "hardware.md").read_text("utf-8")
    shown = tomllib.loads("[ethercat]" + text.partition("```toml\n[ethercat]")[2].partition("```")[0])["ethercat"]
    default = Ethercat(rated_torque=100.0)
    assert Ethercat(**shown) == default
    assert default.model_fields_set == {"rated_torque"}
    assert shown.keys() == default.model_dump().keys()


def test_a_drive_on_the_bus_goes_up_gives_torque_in_per_mille_and_comes_down(tmp_path, bus) -> None:
    with session(tmp_path) as one:
        done = run_session(one)
        assert bus.last.slaves[0].drive == "disabled"
    assert done["completed"], done["faults"]
    found = recorded(tmp_path)
    order, given = found["machine.order"], found["machine.torque"]
    assert np.abs(order).max() > 1
    assert np.allclose(given[1:], RATED / 1000 * np.round(order[:-1] * 1000 / RATED), atol=1e-12)
    assert np.all(found["machine.counts"] == 2**32 - 5)
    assert replay(found).identical


def after(cycle: int, change: Callable[[fake_soem.Master], Any]) -> Callable[[fake_soem.Master, int], None]:
    return lambda master, now: change(master) if now >= cycle else None


def leaves(master: fake_soem.Master) -> None:
    """The bus watchdog trips: the slave has left operation, its inputs go on as if nothing were."""
    master.slaves[0].state, master.slaves[0].al_status = fake_soem.SAFEOP_STATE, 0x1B


def other_mode(master: fake_soem.Master) -> None:
    master.slaves[0].objects[0x6060, 0] = b"\x08"


TORQUE_ALONE = [one.model_dump() for one in Ethercat(rated_torque=1.0).outputs[:2]]
"""Outputs without a mode of operation."""


@pytest.mark.parametrize(
    ("change", "outputs", "fault", "within", "says"),
    [
        (lambda master: setattr(master, "wkc", 1), {}, "frame_lost", 4, ""),
        (leaves, {}, "adapter_failed", CHECKED_EVERY + 1, "has left operation of the bus: Sync manager watchdog"),
        (lambda master: setattr(master.slaves[0], "drive", "fault"), {}, "drive_fault", 3, ""),
        (other_mode, {"outputs": TORQUE_ALONE}, "adapter_failed", 3, "is enabled in mode 8, not 10"),
    ],
)
def test_what_goes_wrong_on_the_bus_is_a_fault(tmp_path, bus, change, outputs, fault, within, says) -> None:
    bus.change = after(2001, change)
    with session(tmp_path, machine(**outputs)) as one:
        done = run_session(one)
    assert_safe(recorded(tmp_path), fault, 1999, within)
    assert says in done.get("adapter_error", "")


@pytest.mark.parametrize(
    ("changes", "bus_is", "sentence"),
    [
        ({"interface": "none0"}, {}, r"could not open interface none0 \(EtherCAT needs the rights of root\)"),
        ({}, {"count": 0}, "no slave 0 at fake0, which has 0"),
        ({"position": 3}, {}, "no slave 3 at fake0, which has 1"),
        ({"rated_torque": 100.1}, {}, r"limits.torque_mismatch = 0.1 N m is below what the drive counts"),
        ({"rated_torque": 50 / 32.7671}, {}, r"limits.torque = 50 N m does not fit into 16 bits of 0.0015"),
        ({}, {"more": (1, 0)}, "has 6 bytes of outputs and the mapping 5"),
        ({}, {"more": (0, -1)}, "has 8 bytes of inputs and the mapping 9"),
        ({}, {"safe": fake_soem.PREOP_STATE}, "does not reach safe operation of the bus: No error"),
        ({}, {"refused": (0x1600, 2)}, "refuses its PDOs: RuntimeError abort 0x06090030"),
    ],
)
def test_a_bus_or_drive_that_does_not_fit_is_refused(tmp_path, bus, changes, bus_is, sentence) -> None:
    for name, value in bus_is.items():
        setattr(bus, name, value)
    with pytest.raises(HardwareError, match=sentence):
        session(tmp_path, machine(**changes))
    assert not hasattr(bus, "last") or bus.last.closed
    assert not (tmp_path / "box").exists()


RATED_ONE = "[ethercat]\nrated_torque = 1.0\n"


@pytest.mark.parametrize(
    ("section", "sentence"),
    [
        ("", r"needs a section \[ethercat\]"),
        ("[ethercat]\n", '"ethercat.rated_torque" is missing'),
        (RATED_ONE + "speed = 2", '"ethercat.speed" is no key of a machine; keys there are: position'),
        (RATED_ONE + "outputs = [{{ {}, bits = 16 }}]", "outputs must have controlword; they have: torque"),
        (RATED_ONE + "inputs = [{{ {}, bits = 12 }}]", "ethercat.inputs.0.bits = 12 breaks a rule"),
    ],
)
def test_a_mapping_that_is_none_is_refused(tmp_path, bus, section, sentence) -> None:
    entry = section.format('name = "torque", object = 0x6071')
    text = f'name = "x"\nadapter = "ethercat:fake0"\n{LIMITS}{entry}'
    with pytest.raises(HardwareError, match=sentence):
        session(tmp_path, parse_machine(text, "m.toml"))


def test_without_pysoem_a_sentence_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pysoem", None)
    with pytest.raises(MissingPackageError, match='pip install "pysoem'):
        session(tmp_path)


# What the bus is told on the way up, and how often its slave is looked at.


def test_a_pdo_is_unassigned_emptied_filled_and_assigned_in_this_order(tmp_path, bus) -> None:
    """ETG.1000.6: a slave refuses entries of a PDO that is assigned, or that says it has some.

    Torque of 50 N m fits into its 16 bits to the last count.
    """
    outputs = [{"name": "torque", "object": 0x6071, "bits": 16}, {"object": 0x60FE, "subindex": 1, "bits": 32}]
    outputs += [{"name": "controlword", "object": 0x6040, "bits": 16}]
    given = {"outputs": outputs, "receive_pdo": 0x1602, "distributed_clock": True, "rated_torque": 50 / 32.767}
    with session(tmp_path, machine(**given)):
        slave = bus.last.slaves[0]
        assert slave.objects[0x6060, 0] == b"\x0a", "cyclic synchronous torque, also where it is not in the PDO"
        assert (slave.watchdog, slave.sync) == (("processdata", SIMULATED.watchdog_ms), (True, 100_000))
        assert slave.state == fake_soem.OP_STATE
    assert (bus.last.closed, bus.last.states[-1]) == (True, fake_soem.INIT_STATE)
    written = [(index, place, int.from_bytes(data, "little"), len(data)) for index, place, data in slave.written]
    assert written[:8] == [
        (0x1C12, 0, 0, 1),
        (0x1602, 0, 0, 1),
        (0x1602, 1, 0x60710010, 4),
        (0x1602, 2, 0x60FE0120, 4),
        (0x1602, 3, 0x60400010, 4),
        (0x1602, 0, 3, 1),
        (0x1C12, 1, 0x1602, 2),
        (0x1C12, 0, 1, 1),
    ]
    assert [one[1:] for one in written[8:] if one[0] in (0x1C12, 0x1C13)] == [(0, 0, 1), (1, 0x1A00, 2), (0, 1, 1)]


def test_a_bus_that_does_not_go_up_is_asked_often_but_not_for_ever(tmp_path: Path, bus: type[fake_soem.Master]) -> None:
    """Process data without voltage all the while, or the slave's watchdog trips; each wait is short."""
    bus.goes_up = False
    with pytest.raises(HardwareError, match="does not reach operation of the bus: No error"), session(tmp_path):
        pass
    first, *told = bus.last.told
    assert first[:2] == ("state_check", fake_soem.SAFEOP_STATE)
    rounds = [tuple(one[:2] for one in told[k : k + 3]) for k in range(0, 3 * TRIES, 3)]
    waits = ("send",), ("receive", FRAME_US), ("state_check", fake_soem.OP_STATE)
    assert rounds == [waits] * TRIES
    assert told[3 * TRIES :] == []
    assert 0.5 <= TRIES * STATE_US * 1e-6 <= 20
    seen = bus.last.slaves[0].seen
    assert (seen[0x6040], seen[0x6071], seen[0x6060]) == (0, 0, 10), "controlword, torque, mode"
    assert (bus.last.states, bus.last.closed) == ([fake_soem.OP_STATE, fake_soem.INIT_STATE], True)


def test_a_slave_is_looked_at_every_few_cycles(tmp_path: Path, bus: type[fake_soem.Master]) -> None:
    with session(tmp_path) as one:
        before = len(bus.last.told)
        one.advance(3 * CHECKED_EVERY)
        looks = [k for k, what in enumerate(bus.last.told[before:]) if what == ("read_state",)]
    assert len(looks) == 3
    assert set(np.diff(looks)) == {2 * CHECKED_EVERY + 1}, "each cycle sends and receives"


@pytest.mark.parametrize(
    "wrong", [{"object": 0}, {"object": 0x10000}, {"subindex": -1}, {"subindex": 256}, {"bits": 64}]
)
def test_an_object_beyond_its_index_is_refused(wrong: dict[str, Any]) -> None:
    Entry(object=0xFFFF, bits=8)
    Entry(object=1, bits=8)
    with pytest.raises(ValidationError):
        Entry(**({"object": 0x6040, "bits": 16} | wrong))
    for numbers in ({"rated_torque": 0.0}, {"rated_torque": 1.0, "position": -1}):
        with pytest.raises(ValidationError):
            Ethercat(**numbers)  # type: ignore[arg-type]
