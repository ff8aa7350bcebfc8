"""What the bus is told on the way up, and how often its slave is looked at."""

import struct
import sys
from pathlib import Path

import fake_soem
import numpy as np
import pytest
from test_ethercat import bus, machine, session

from cosim.support.errors import HardwareError
from cosim_ethercat.drive import CHECKED_EVERY, FRAME_US, STATE_US, TRIES

__all__ = ["bus"]

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the loop needs absolute sleeps")


def test_a_pdo_is_unassigned_emptied_filled_and_assigned_in_this_order(
    tmp_path: Path, bus: type[fake_soem.Master]
) -> None:
    """ETG.1000.6: a slave refuses entries of a PDO that is assigned, or that says it has some."""
    outputs = [{"name": "torque", "object": 0x6071, "bits": 16}, {"object": 0x60FE, "subindex": 1, "bits": 32}]
    outputs += [{"name": "controlword", "object": 0x6040, "bits": 16}]
    with session(tmp_path, machine(outputs=outputs, receive_pdo=0x1602)):
        written = bus.last.slaves[0].written
    assert [(index, place, int.from_bytes(data, "little"), len(data)) for index, place, data in written[:8]] == [
        (0x1C12, 0, 0, 1),
        (0x1602, 0, 0, 1),
        (0x1602, 1, 0x60710010, 4),
        (0x1602, 2, 0x60FE0120, 4),
        (0x1602, 3, 0x60400010, 4),
        (0x1602, 0, 3, 1),
        (0x1C12, 1, 0x1602, 2),
        (0x1C12, 0, 1, 1),
    ]
    assert [index for index, *_ in written[8:]].count(0x1C12) == 0
    assert [(place, data) for index, place, data in written if index == 0x1C13] == [
        (0, b"\0"),
        (1, struct.pack("<H", 0x1A00)),
        (0, b"\x01"),
    ]


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
