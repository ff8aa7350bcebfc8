"""In real time a virtual drive obeys orders of now only: one that is older than its watchdog moves nothing."""

import sys
import time

import pytest
from on_hardware import SIMULATED
from over_udp import drive, talking

from cosim.hardware.machine import changed

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the loop needs absolute sleeps")
NOW, WATCHDOG = 1_000_000, 50_000
"""Tick of the first order, and ticks of a watchdog of 5 s: a test takes far less."""


@pytest.mark.parametrize("behind", [0, 10_000, WATCHDOG - 10_000])
def test_an_order_that_is_late_by_less_than_the_watchdog_is_obeyed(behind: int) -> None:
    with drive(changed(SIMULATED, "test", watchdog_ms=5000.0), lockstep=False) as there, talking(there) as loop:
        for sequence, word in enumerate((0, 6, 7, 15), 1):
            loop.obeyed(sequence, word, tick=NOW)
        assert loop.obeyed(5, 15, 1.0, tick=NOW - behind) == 1.0
        assert there.statistics["orders"]["late"] == 0


@pytest.mark.parametrize("watchdogs", [1, 2, 10])
def test_an_order_older_than_the_watchdog_moves_nothing_and_is_counted(watchdogs: int) -> None:
    with drive(changed(SIMULATED, "test", watchdog_ms=5000.0), lockstep=False) as there, talking(there) as loop:
        for sequence, word in enumerate((0, 6, 7, 15), 1):
            loop.obeyed(sequence, word, tick=NOW)
        loop.send(loop.order(5, 15, 1.0, NOW - watchdogs * WATCHDOG - 1))
        assert loop.silent()
        assert there.drive.held == 0
        assert there.statistics["orders"]["late"] == 1
        assert loop.obeyed(6, 15, 2.0, tick=NOW) == 2.0


def test_orders_that_are_too_old_do_not_keep_the_watchdog_quiet() -> None:
    with drive(changed(SIMULATED, "test", watchdog_ms=200.0), lockstep=False) as there, talking(there) as loop:
        for sequence, word in enumerate((0, 6, 7, 15), 1):
            loop.obeyed(sequence, word, tick=NOW)
        assert loop.obeyed(5, 15, 1.0, tick=NOW) == 1.0
        sequence, last = 6, time.monotonic() + 5
        while there.drive.held != 0:
            assert time.monotonic() < last, "the torque stays"
            loop.send(loop.order(sequence, 15, 1.0, NOW - 10 * 2_000))
            sequence += 1
            time.sleep(0.01)
        assert there.statistics["watchdog_trips"] == 1
        assert there.drive.state == 7
