"""Numbers of the hardware loop: those of the C headers, of the standards, and those made from a machine file."""

import hashlib
import re
from dataclasses import replace
from math import pi
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from commands import call
from on_hardware import altered, scenario, session
from pydantic import ValidationError

from cosim.data.recording import Recording
from cosim.hardware import python_adapter, structures, udp, words
from cosim.hardware.axis import cycles_of
from cosim.hardware.loops import period_of
from cosim.hardware.machine import Inject
from cosim.hardware.move import Move, _inertia, _set_points
from cosim.hardware.simulated import _injection
from cosim.hardware.udp import UdpDrive, key_of
from cosim.hardware.wired import _check_controller
from cosim.master import exchange
from cosim.support.errors import HardwareError

SOURCES = Path(structures.__file__).parent
STEP = 1e-4


def enums(*files: str) -> dict[str, int]:
    """What the headers count, by name."""
    found: dict[str, int] = {}
    for text in ((SOURCES / file).read_text("utf-8") for file in files):
        for body in re.findall(r"enum \{([^}]*)\}", text):
            value = -1
            for one in body.replace("\n", " ").split(","):
                name, _, said = one.strip().partition(" = ")
                value = int(said, 0) if said else value + 1
                found[name] = value
    return found


@pytest.mark.parametrize(
    ("header", "module", "names"),
    [
        ("hardware.h", structures, "INPUTS MISSES HEADS LIMITS"),
        ("hardware.h", words, "ASK_ENABLE ASK_QUICK_STOP ASK_ESTOP ASK_RESET ENTERED STEPPED LIMITED SLEWED FAULT"),
        ("hardware.h", python_adapter, "READ_OK READ_STALE READ_ERROR"),
        ("udp.h", structures, "NONCE TAG KEY"),
        ("udp.h", udp, "MAGIC HELLO WELCOME BUSY DENIED"),
    ],
)
def test_numbers_that_both_sides_write_are_those_of_the_headers(header: str, module: Any, names: str) -> None:
    c = enums(header)
    assert {name: getattr(module, name) for name in names.split()} == {name: c[name] for name in names.split()}


def test_words_stand_in_the_order_of_the_headers() -> None:
    c = enums("hardware.h", "drive.h")
    assert (c["OPERATION_ENABLED"], c["QUICK_STOP_ACTIVE"]) == (words.ENABLED, words.QUICK_STOP_STATE)
    assert len(words.STATES) - 1 == words.FAULT
    assert [c[f"HEAD_{name.upper()}"] for name in words.REASONS[1:]] == [1, 2, 3]
    for counted in (words.FAULTS, words.INJECTIONS):
        assert [c[name.upper()] for name in counted] == list(range(len(counted)))
    assert {*words.OF_FRAMES, *words.OF_HEADS} <= {*words.INJECTIONS}
    sizes = enums("udp.h")
    assert udp.FRAME.size == 16 + 8 + 16 + 8 + sizes["NONCE"] + sizes["TAG"] + 4 == udp.TAGGED + sizes["TAG"] + 4


def test_a_solver_says_why_it_failed_by_the_number_that_c_gives() -> None:
    c = enums("../master/loop/rodas4.h")
    words = {"SINGULAR": "singular", "NOT_FINITE": "not finite", "STEP_TOO_SMALL": "small", "TOO_MANY_STEPS": "million"}
    assert {c[name] for name in words} == {*exchange._REASONS}
    assert all(word in exchange._REASONS[c[name]] for name, word in words.items())
    assert exchange.TOLERANCE == 1e-8


@pytest.mark.parametrize("bits", [0, 1, 0b1010_0000_0000_0001, 0xFFFF])
def test_a_word_of_faults_is_one_name_a_bit_and_each_head_has_four_bits_of_reasons(bits: int) -> None:
    names = list(words.FAULTS)
    assert words.faults_of(bits) == tuple(names[place] for place in range(16) if bits & 2**place)
    reasons = [words.heads_of(word) for word in (0, 0x0123, 0x2000)]
    assert reasons == [{}, {0: "astray", 1: "frozen", 2: "silent"}, {3: "frozen"}]


@pytest.mark.parametrize(("ms", "cycles"), [(1e-9, 1), (0.149, 1), (0.151, 2), (20.0, 200), (20.04, 200)])
def test_a_time_is_the_nearest_number_of_cycles_and_at_least_one(ms: float, cycles: int) -> None:
    assert cycles_of(ms, STEP) == cycles


def test_an_axis_and_its_session_have_the_numbers_of_their_files(tmp_path: Path) -> None:
    reactions = {"heartbeat_ms": 30.0, "ramp_ms": 7.0, "window_ms": 400.0}
    encoder = {"heads": 4, "apart": 2e-4, "eccentricity": 1e-5}
    given = altered(reactions=reactions, encoder=encoder, black_box_seconds=60.0)
    with session(tmp_path, given) as one:
        axis, quantum = one.axis, one.wired.quantum
        assert (axis.ramp, axis.patience, axis.late_window) == (70, 1000, 4000)
        assert (axis.lost_limit, axis.stale_limit, axis.mismatch_limit) == (2, 2, 10)
        assert (axis.late_row_limit, axis.late_limit) == (3, 10)
        assert list(axis.limit) == [getattr(given.limits, name) for name in words.LIMITS]
        assert (axis.heads.used, axis.heads.apart) == (4, round(2e-4 / quantum))
        assert axis.heads.jump == round(given.limits.jump / quantum)
        own = one._session
        assert (own.period, own.waits, own.setpoints, own.heartbeat_limit) == (0, 1, 4000, 300)
        assert own.spin == 20_000
        assert one._box.box.capacity == 104_000, "the session's 0.4 s and ten more, not the 60 s of the file"
        drive = one.transport.drive  # type: ignore[attr-defined]
        assert (drive.watchdog, drive.heads, drive.eccentricity) == (20, 4, 1e-5)
        assert (drive.torque, drive.slew, drive.speed) == (given.limits.torque, given.limits.slew, given.limits.speed)
        one.advance(7)
        own.late, own.waited, own.worst, axis.refused = 2, 3, 4500, 6
        told = one.statistics
        assert (told["cycles"], told["late_cycles"], told["worst_wake_up_us"]) == (5, 5, 4.5)
        assert told["refused_limits"] == 6
        assert (told["real_time"], told["heads_left_out"]) == (False, {})


@pytest.mark.parametrize(
    "wrong", [{"at": -1e-9}, {"at": 1.001e12}, {"lasts": 0.0}, {"lasts": 1.001e12}, {"head": -1}, {"head": 4}]
)
def test_a_fault_of_a_drive_has_cycles_and_one_at_no_time_or_of_no_head_is_refused(wrong: dict[str, Any]) -> None:
    found = _injection(Inject(kind="stray_head", at=0.02, lasts=0.005, size=2.5, head=3), STEP)
    assert (found.kind, found.first, found.last) == (words.INJECTIONS.index("stray_head"), 200, 250)
    assert (found.size, found.head) == (2.5, 3)
    always = Inject(**({"kind": "lost", "at": 0.0}))
    assert (always.lasts, always.size, always.head) == (1e9, 0.0, 0), "docs/hardware.md: it stays"
    Inject(kind="frozen_head", at=1e12, lasts=1e12, head=3)
    with pytest.raises(ValidationError):
        Inject(**({"kind": "lost", "at": 0.0} | wrong))


def test_what_has_no_whole_answer_is_lost() -> None:
    drive = object.__new__(UdpDrive)
    drive.udp = structures.CUdp()
    numbers = dict(zip(structures.COUNTED, (100, 80, 0, 7, 5, 3, 2, 1, 0), strict=True))
    for name, value in (*numbers.items(), ("worst", 41_500)):
        setattr(drive.udp.link, name, value)
    assert drive.statistics()["link"] == numbers | {"lost": 100 - 80 - 7 - 3, "worst_round_trip_us": 41.5}


@pytest.mark.parametrize(("size", "fits"), [(0, False), (15, False), (16, True), (65_536, True), (65_537, False)])
def test_a_key_has_16_bytes_to_64_kib_and_all_of_them_count(tmp_path: Path, size: int, fits: bool) -> None:
    file = tmp_path / "key"
    with pytest.raises(HardwareError, match="cannot be read"):
        key_of(str(file))
    content = bytes(k * 7 % 251 for k in range(size))
    file.write_bytes(content)
    if fits:
        assert key_of(str(file)) == hashlib.sha256(content).digest()
        return
    with pytest.raises(HardwareError, match="a key has 16 to 65,536 random bytes"):
        key_of(str(file))


@pytest.mark.parametrize(("share", "fits"), [(0.0, True), (0.9e-9, True), (1.1e-9, False), (-1.1e-9, False)])
def test_a_controller_is_sampled_as_often_as_the_loop_to_its_last_digits(share, fits, monkeypatch) -> None:
    monkeypatch.setattr("cosim.hardware.wired.period_of", lambda _: STEP * (1 + share))
    component: Any = SimpleNamespace(can_get_and_set_state=True)
    eight = ["q_d", *(f"a{k}" for k in range(structures.INPUTS - 1))]
    if fits:
        _check_controller(scenario(), "k", component, eight)
        with pytest.raises(HardwareError, match="has 9 inputs, and a record has room for 8"):
            _check_controller(scenario(), "k", component, [*eight, "b"])
        return
    with pytest.raises(HardwareError, match=r"is sampled every .* s and the loop every 0\.0001 s"):
        _check_controller(scenario(), "k", component, eight)


@pytest.mark.parametrize("inertia", [0.4, 33.0])
def test_the_inertia_of_a_move_is_the_torque_in_phase_with_the_acceleration(inertia: float) -> None:
    """Ten periods a second; friction, a constant load, and the first two periods with what settles do not count."""
    t = STEP * np.arange(7000)
    w = 2 * pi * 10
    q, swing = -2e-3 * np.cos(w * t), 2e-3 * w**2 * np.cos(w * t)
    beginning = np.where(t < 0.1999, 50 * np.cos(w * t), 0) + np.where(t > 0.6001, 50 * np.cos(w * t), 0)
    tau = inertia * swing + 0.3 * np.sin(w * t) + 1.7 + beginning
    found = Recording("move", {"t": t, "tau": tau, "q": q, "machine.tick": 123.0 + np.arange(7000)})
    assert _inertia(found, STEP) == pytest.approx(inertia, rel=1e-9)
    move = Move(way=1e-3, seen=2.0, expected=3.0, torque=5.0)
    assert move.shown == {"way": 1e-3, "seen": 2.0, "expected": 3.0, "torque": 5.0, "scale": 1.5}


def test_a_move_is_a_sine_that_starts_at_rest_where_the_axis_is() -> None:
    wired = SimpleNamespace(inputs=("q", "q_d", "v_d", "a_d"), setpoints=np.full((4, 2001), 9.0))
    _set_points(SimpleNamespace(wired=wired, scenario=replace(scenario(), step=STEP)), 0.5, 2e-3)  # type: ignore[arg-type]
    untouched, q, v, a = wired.setpoints
    assert (untouched == 9).all(), "the encoder's own input"
    t, w = STEP * np.arange(2001), 20 * pi
    np.testing.assert_allclose(q, 0.5 + 1e-3 * (1 - np.cos(w * t)), rtol=1e-12)
    np.testing.assert_allclose(v, 1e-3 * w * np.sin(w * t), atol=1e-15)
    np.testing.assert_allclose(a, 1e-3 * w**2 * np.cos(w * t), atol=1e-12)
    assert np.ptp(q) == pytest.approx(2e-3)


def test_a_cycle_is_counted_in_nanoseconds_and_one_of_no_clock_is_refused() -> None:
    assert [period_of(step) for step in (1e-6, 1e-4, 10.0)] == [1_000, 100_000, 10_000_000_000]
    for step in (1e300, 11.0, 1e-9, float("nan"), float("inf")):
        with pytest.raises(HardwareError, match=r"has cycles of 1e-06 s to 10 s"):
            period_of(step)


@pytest.mark.parametrize(("option", "value"), [("--step", "1e300"), ("--counts-per-turn", "1e-320")])
def test_a_virtual_drive_says_what_it_cannot_be(option: str, value: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("hardware", "virtual-drive", "paper_mount", "--port", "0", option, value) == 2
    assert "Traceback" not in (said := capsys.readouterr().err)
    assert said.startswith("cosim: ")
