"""Who may order a drive over UDP, and what a drive does whatever is ordered: its key, its session, its own limits."""

import ctypes
import hashlib
import hmac
import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from on_hardware import SIMULATED, altered
from over_udp import BYE, SESSION, WORDS, Loop, drive, frame, over, session, talking

from cosim.hardware.library import library
from cosim.hardware.session import run_session
from cosim.hardware.udp import BUSY, DENIED, HELLO, MAGIC, WELCOME, closed, key_of, sealed
from cosim.hardware.virtual import Event, VirtualDrive
from cosim.hardware.words import STATES
from cosim.support.errors import HardwareError


@pytest.fixture
def keys(tmp_path: Path) -> tuple[str, str]:
    for name in ("a.key", "b.key"):
        (tmp_path / name).write_bytes(os.urandom(32))
    return str(tmp_path / "a.key"), str(tmp_path / "b.key")


@pytest.mark.parametrize("size", [0, 1, 55, 56, 63, 64, 65, 119, 120, 200, 500])
def test_the_tag_is_hmac_sha256_as_everybody_makes_it(size: int) -> None:
    dice = random.Random(size)
    key, data, tag = dice.randbytes(32), dice.randbytes(size), ctypes.create_string_buffer(32)
    library().hardware_mac(key, len(key), data, len(data), tag)
    assert tag.raw == hmac.digest(key, data, hashlib.sha256)


def test_with_a_key_that_both_have_a_session_runs_and_with_another_it_is_refused(tmp_path, keys) -> None:
    with drive(over("simulated", key_file=keys[0])) as there:
        with pytest.raises(HardwareError, match="was given another key than this loop"):
            session(tmp_path / "b", there.url, altered(key_file=keys[1]))
        with pytest.raises(HardwareError, match="was given another key than this loop"):
            session(tmp_path / "c", there.url)
        with session(tmp_path / "a", there.url, altered(key_file=keys[0])) as one:
            assert run_session(one)["completed"]


def test_who_sees_all_but_the_key_can_neither_order_nor_end_nor_replay(keys: tuple[str, str]) -> None:
    with drive(over("simulated", key_file=keys[0])) as there, talking(there, keys[0]) as loop:
        loop.enable()
        assert loop.obeyed(5, 15, 1.0) == 1.0
        torque = loop.order(5, 15, 1.0)
        for forged in (
            frame(6, SESSION, key_of(""), 15, 9.0),
            frame(6, SESSION, bytes(32), 15, 9.0),
            closed((MAGIC, BYE, SESSION, 6, 0, 0, 0, 0, 0, 0.0, b""), key_of("")),
            torque,
        ):
            loop.send(forged)
        assert loop.silent()
        with talking(there, keys[1], greeted=False) as stranger:
            assert stranger.greet() == DENIED, "it learns only that the key is another"
        assert there.drive.held == 1.0
        assert loop.obeyed(6, 15, 2.0) == 2.0
        orders = there.statistics["orders"]
    assert (orders["foreign"], orders["duplicated"]) == (3, 1)


def test_an_order_of_an_earlier_session_is_none_of_a_later_one() -> None:
    with drive() as there, talking(there) as loop:
        loop.enable()
        old = loop.order(5, 15, 5.0)
        loop.send(closed((MAGIC, BYE, SESSION, 6, 0, 0, 0, 0, 0, 0.0, b""), loop.key))
        assert loop.greet() == WELCOME, "the same greeting: another nonce of the drive, another key"
        loop.enable()
        loop.send(old)
        assert loop.silent()
        assert there.drive.held == 0


@pytest.mark.parametrize("lockstep", [False, True])
def test_a_live_session_is_not_stolen_by_who_has_the_key_too(lockstep: bool) -> None:
    slow = altered(watchdog_ms=5000.0)
    with drive(slow, lockstep=lockstep) as there, talking(there) as loop:
        loop.enable()
        assert loop.greet() == WELCOME, "its own greeting once more, as where the answer was lost"
        for other in (SESSION, SESSION + 1, 0):
            with talking(there, session=other, greeted=False) as thief:
                assert thief.greet() == BUSY
        assert loop.obeyed(5, 15, 1.0) == 1.0


def test_a_drive_is_free_when_its_loop_says_so_or_is_silent_for_its_lease() -> None:
    with drive() as there, talking(there) as loop, talking(there, session=5, greeted=False) as other:
        loop.enable()
        loop.obeyed(5, 15, 1.0)
        assert other.greet() == BUSY
        there.virtual.lease = 10_000_000  # 10 ms instead of a second
        time.sleep(0.02)
        assert other.greet() == WELCOME
        assert there.drive.held == 0
        there.virtual.lease = 10**12
        assert loop.greet() == BUSY
        other.send(closed((MAGIC, BYE, 5, 1, 0, 0, 0, 0, 0, 0.0, b""), other.key))
        assert loop.greet() == WELCOME


@pytest.mark.parametrize("tick", [1_005, 10**6, 2**53, 2**53 + 1, 2**62, -1, -(2**62)])
def test_an_order_of_the_far_future_or_of_no_time_is_dropped(tick: int) -> None:
    with drive() as there, talking(there) as loop:
        loop.enable()
        loop.send(loop.order(5, 15, 1.0, tick))
        assert loop.silent()
        assert there.drive.held == 0
        assert there.drive.tick == 3, "four orders for the ticks 1 to 4, of which the first is the tick at which it was"
        assert loop.obeyed(6, 15, 1.0, 6) == 1.0
        orders = there.statistics["orders"]
    assert orders["early"] + orders["foreign"] == 1


def test_the_drive_keeps_its_own_torque_whatever_it_is_ordered() -> None:
    with drive(altered(limits={"torque": 3.0})) as there, talking(there) as loop:
        loop.enable()
        given = [loop.obeyed(5 + n, 15, torque) for n, torque in enumerate((2.5, 3.5, 1e300, -7.0, -3.0))]
        assert given == [2.5, 3.0, 3.0, -3.0, -3.0]
        assert there.statistics["beyond_limits"] == 3


def test_the_drive_keeps_its_own_slew_but_lets_go_of_torque_at_once() -> None:
    with drive(altered(limits={"slew": 5_000.0})) as there, talking(there) as loop:  # 0.5 N m a tick of 0.1 ms
        loop.enable()
        given = [loop.obeyed(5 + n, 15, torque) for n, torque in enumerate((2.0, 2.0, 2.0, 0.2, -2.0))]
        assert np.allclose(given, [0.5, 1.0, 1.5, 0.2, -0.3], rtol=0, atol=1e-12)
        assert np.isclose(loop.obeyed(12, 15, 40.0), -0.3 + 3 * 0.5), "three ticks after the order before"


def test_the_drive_lets_go_when_it_is_faster_than_its_own_limit() -> None:
    with drive(altered(limits={"speed": 1e-4})) as there, talking(there) as loop:
        loop.enable()
        for number in count(5):
            if loop.obeyed(number, 15, 45.0) == 0:
                break
        assert number < 1000
        assert there.statistics["overspeeds"] == 1
        assert there.drive.state == 7
        assert loop.obeyed(number + 1, 15, 45.0) == 0


def test_a_flood_of_frames_does_not_keep_a_drive_from_its_watchdog_or_its_end() -> None:
    fast = altered(watchdog_ms=50.0)
    with drive(fast, lockstep=False) as there, talking(there) as loop, socket.socket(type=socket.SOCK_DGRAM) as flood:
        flood.connect((there.host, there.port))
        loop.enable()
        last = time.monotonic() + 10
        while there.virtual.session and there.drive.state != 7:
            for _ in range(200):
                flood.send(sealed(HELLO, 5, 1e-4, bytes(16), key_of("")))
            assert time.monotonic() < last
    assert there.drive.held == 0
    assert not there._thread.is_alive()


STUCK = """
import sys, time
from pathlib import Path
sys.path.insert(0, {tests!r})
from over_udp import drive, talking
from cosim.hardware import virtual
virtual.LONGEST = 0.2
import ctypes
with drive() as there, talking(there) as loop:
    loop.enable()
    sleeping = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(lambda *_: time.sleep(60) or 0)
    there._adapter.read = ctypes.cast(sleeping, ctypes.c_void_p).value
    loop.send(loop.order(5, 15, 1.0))
    print("stuck", flush=True)
    time.sleep(60)
"""


def test_ctrl_c_ends_a_drive_whose_plant_does_not_return() -> None:
    code = STUCK.format(tests=str(Path(__file__).parents[1] / "tools"))
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout
        assert process.stdout.readline() == b"stuck\n"
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    assert b"does not end its step" in errors
    assert process.returncode != 0


# In real time a virtual drive obeys orders of now only: one that is older than its watchdog moves nothing.

NOW = 1_000_000
"""Tick of the first order."""


@contextmanager
def from_now_on(watchdog_ms: float) -> Iterator[tuple[VirtualDrive, Loop]]:
    """A drive in operation whose orders began at a late tick."""
    given = altered(watchdog_ms=watchdog_ms)
    with drive(given, lockstep=False) as there, talking(there) as loop:
        for sequence, word in enumerate(WORDS, 1):
            loop.obeyed(sequence, word, tick=NOW)
        yield there, loop


@pytest.mark.parametrize(("behind", "obeyed"), [(0, True), (40_000, True), (50_001, False), (500_001, False)])
def test_an_order_older_than_the_watchdog_of_50_000_ticks_moves_nothing_and_is_counted(behind, obeyed) -> None:
    with from_now_on(5000.0) as (there, loop):
        loop.send(loop.order(5, 15, 1.0, NOW - behind))
        assert loop.silent() != obeyed
        assert there.drive.held == (1.0 if obeyed else 0.0)
        assert there.statistics["orders"]["late"] == (0 if obeyed else 1)
        assert loop.obeyed(6, 15, 2.0, tick=NOW) == 2.0


def test_orders_that_are_too_old_do_not_keep_the_watchdog_quiet() -> None:
    with from_now_on(200.0) as (there, loop):
        assert loop.obeyed(5, 15, 1.0, tick=NOW) == 1.0
        sequence, last = 6, time.monotonic() + 5
        while there.drive.held != 0:
            assert time.monotonic() < last, "the torque stays"
            loop.send(loop.order(sequence, 15, 1.0, NOW - 10 * 2_000))
            sequence += 1
            time.sleep(0.01)
        assert there.statistics["watchdog_trips"] == 1
        assert there.drive.state == 7


# What a virtual drive tells of itself: its states, and torques that its watchdog took away.


def test_a_drive_tells_each_change_once_and_what_its_watchdog_took(monkeypatch: pytest.MonkeyPatch) -> None:
    there = object.__new__(VirtualDrive)
    there.drive = SimpleNamespace(state=0, held=0.0)  # type: ignore[assignment]
    there.virtual = SimpleNamespace(trips=0, silence=0, taken=0.0, let_go=0)  # type: ignore[assignment]
    # Between two looks: nothing, operation, a trip, nothing, another one in the same state; nothing more is told.
    script = [(0, 0.0, 0), (4, 1.5, 0), (7, 0.0, 1), (7, 0.0, 1), (7, 0.0, 2)]
    waits: list[float] = []

    def later(seconds: float) -> None:
        there.drive.state, there.drive.held, trips = script[len(waits)]
        waits.append(seconds)
        there.virtual = SimpleNamespace(trips=trips, silence=20_500_000 + trips, taken=-2.5, let_go=77)  # type: ignore[assignment]

    monkeypatch.setattr("cosim.hardware.virtual.sleep", later)
    told = there.events()
    found = [next(told) for _ in range(5)]
    assert found == [
        Event("state", STATES[0], {"torque": 0.0}),
        Event("state", STATES[4], {"torque": 1.5}),
        Event("watchdog", STATES[7], {"silence_ms": 20.500001, "torque_taken": -2.5, "clock_ns": 77}),
        Event("state", STATES[7], {"torque": 0.0}),
        Event("watchdog", STATES[7], {"silence_ms": 20.500002, "torque_taken": -2.5, "clock_ns": 77}),
    ]
    assert len(waits) == 5
    assert 0 < max(waits) <= 0.1


@pytest.mark.parametrize("lockstep", [True, False])
def test_a_drive_counts_in_the_units_of_its_clock(lockstep: bool) -> None:
    """Nanoseconds; a session is free after a second without an order, or the watchdog's time where that is longer."""
    patient = altered(watchdog_ms=1500.0)
    for machine, lease in ((SIMULATED, 1_000_000_000), (patient, 1_500_000_000)):
        with drive(machine, lockstep=lockstep) as there:
            assert there.virtual.period == (0 if lockstep else 100_000)
            assert there.virtual.watchdog == machine.watchdog_ms * 1_000_000
            assert there.virtual.lease == lease
            assert there.virtual.ahead == max(1000, there.drive.watchdog)
