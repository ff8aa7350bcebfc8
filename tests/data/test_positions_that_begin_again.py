"""Counters, turns and ranges of positions are continued where the motion goes on; a motion that jumps stays."""

from math import pi

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from cosim.data.recording import Recording
from cosim.data.registers import continued

ROWS = 3000
T = np.arange(ROWS) / 1000
SEEDS = st.integers(0, 2**32 - 1)
TURN = {"rad": 2 * pi, "deg": 360.0, "turn": 1.0, "arcmin": 21_600.0, "arcsec": 1_296_000.0, "mrad": 2000 * pi}


def motion(seed: int, size: float) -> np.ndarray:
    """A smooth motion forth and back over `size` from one end to the other."""
    rng = np.random.default_rng(seed)
    lines = sum(
        a * np.sin(w * T + p)
        for a, w, p in zip(rng.uniform(0.2, 1, 4), rng.uniform(1, 9, 4), rng.uniform(0, 6, 4), strict=True)
    )
    way = np.asarray(lines) + rng.uniform(-2, 2) * T
    return np.asarray(size * (way - way.min()) / np.ptp(way))


def read(q: np.ndarray, unit: str = "", t: np.ndarray = T) -> tuple[np.ndarray, tuple[str, ...]]:
    table, notes = continued("run", {"t": t, "q": q}, {"q": unit} if unit else {})
    return table["q"], notes


@settings(max_examples=80, deadline=None)
@given(
    seed=SEEDS,
    bits=st.sampled_from([8, 12, 14, 16, 20, 24, 32]),
    turns=st.floats(1.2, 12),
    signed=st.booleans(),
    first=st.floats(0, 1),
    scale=st.sampled_from([1.0, 0.001, 360 / 3_276_800, 2.5e-7]),
    stated=st.sampled_from(["", "deg", "0.00010986328125 deg", "count", "um"]),
)
def test_a_counter_of_whole_steps_is_continued(
    seed: int, bits: int, turns: float, signed: bool, first: float, scale: float, stated: str
) -> None:
    counts = np.rint(motion(seed, turns * 2.0**bits)).astype(np.int64) + int(first * 2**bits)
    low = 2 ** (bits - 1) if signed else 0
    wrapped = (counts + low) % 2**bits - low
    assume(np.abs(np.diff(counts)).max() < 2**bits / 8)
    scale = scale if bits < 24 else 1.0  # a motion over more steps than rows does not show them
    ends = np.flatnonzero(np.abs(np.diff(wrapped)) > 2**bits / 2)
    assume(len(ends))
    ways = np.sign(counts[ends + 1] - counts[ends])
    before = counts[ends] - counts[np.maximum(ends - 50, 0)]
    after = counts[np.minimum(ends + 51, ROWS - 1)] - counts[ends + 1]
    most = 2 * np.abs(np.diff(counts)).max()  # of few bits: the motion is seen to go on behind the end
    assume(bits >= 16 or (np.minimum(ways * before, ways * after) > most).any())
    joined, (note,) = read(scale * wrapped, stated)
    np.testing.assert_allclose(joined - joined[0], scale * (counts - counts[0]), atol=1e-6 * scale * 2.0**bits)
    assert note.startswith('run: "q" begins again at ')


@settings(max_examples=80, deadline=None)
@given(
    seed=SEEDS,
    scale=st.sampled_from([*TURN.items(), ("", 2 * pi), ("", 360.0)]),
    turns=st.floats(1.1, 12),
    low=st.sampled_from([0.0, -0.5, -0.25]),
    digits=st.booleans(),
)
def test_a_turn_in_any_unit_is_continued(
    seed: int, scale: tuple[str, float], turns: float, low: float, digits: bool
) -> None:
    unit, turn = scale
    q = motion(seed, turns * turn)
    wrapped = np.mod(q - low * turn, turn) + low * turn
    joined, notes = read(np.round(wrapped / turn, 5) * turn if digits else wrapped, unit)
    np.testing.assert_allclose(joined - joined[0], q - q[0], atol=2e-5 * turn)
    assert len(notes) == int((np.abs(np.diff(wrapped)) > turn / 2).any())


@pytest.mark.parametrize("half", [12.5, 4 * pi, 95.5])
@pytest.mark.parametrize("unit", ["", "rad"])
def test_the_range_that_a_drive_sends_is_continued(half: float, unit: str) -> None:
    q = motion(3, 5 * half) - half
    code = np.floor((q + half) * 65_535 / (2 * half)).astype(np.int64) % 65_536
    joined, (note,) = read(code * (2 * half) / 65_535 - half, unit)
    np.testing.assert_allclose(joined - joined[0], q - q[0], atol=1e-3 * half)
    assert "begins again at" in note


SWING = 8 * np.sin(2 * T)
ENDS = np.flatnonzero(np.abs(np.diff(np.mod(SWING, 2 * pi))) > pi)
NOISE = np.random.default_rng(5).normal(0, 1e-3, ROWS)
TURNED = {
    "an axis that rests at the end of a turn": (np.where(T < 1, 0.0, 0.4 * np.sin(3 * (T - 1))) + NOISE, T >= 0, 0.0),
    "rows that are missing where it begins again": (SWING, np.abs(np.arange(ROWS) - ENDS[1] + 0.5) > 8, 0.0),
    "a false reading": (SWING, T >= 0, 2.9),
}


@pytest.mark.parametrize("what", TURNED)
def test_a_turn_is_continued_at_rest_over_a_hole_and_beside_a_false_reading(what: str) -> None:
    q, kept, wrong = TURNED[what]
    wrapped = np.mod(q + wrong * (np.arange(ROWS) == 1500), 2 * pi)
    joined, _ = read(wrapped[kept], "", T[kept])
    right = (joined - q[kept])[np.arange(ROWS)[kept] != 1500]
    np.testing.assert_allclose(right, right[0], atol=1e-9)


@settings(max_examples=100, deadline=None)
@given(
    seed=SEEDS,
    low=st.floats(-200, 200),
    size=st.sampled_from([1.0, 2 * pi, 25.0, 180.0, 255.0, 360.0, 4095.0, 65_535.0]) | st.floats(0.01, 1e5),
    cycles=st.floats(0.6, 40),
    whole=st.booleans(),
    unit=st.sampled_from(["", "rad", "deg", "turn", "count"]),
)
def test_a_triangle_between_limits_stays(
    seed: int, low: float, size: float, cycles: float, whole: bool, unit: str
) -> None:
    phase = np.random.default_rng(seed).uniform()
    q = low + size * np.abs(np.mod(cycles * T / T[-1] + phase, 1.0) * 2 - 1)
    joined, notes = read(np.rint(q) if whole else q, unit)
    np.testing.assert_array_equal(joined, np.rint(q) if whole else q)
    assert notes == ()


@settings(max_examples=100, deadline=None)
@given(
    seed=SEEDS,
    jumps=st.integers(1, 6),
    size=st.sampled_from([1.0, 2.0, 10.0, 90.0, 100.0, 180.0, 200.0, 1000.0]) | st.floats(0.5, 1e4),
    moved=st.floats(0, 0.3),
    noise=st.floats(0, 0.01),
    unit=st.sampled_from(["", "rad", "deg", "turn", "count"]),
)
def test_a_motion_that_jumps_stays(seed: int, jumps: int, size: float, moved: float, noise: float, unit: str) -> None:
    """Steps to and fro by one size, over a motion that is a share of it, with noise."""
    rng = np.random.default_rng(seed)
    at = np.sort(rng.choice(np.arange(100, ROWS - 100), jumps, replace=False))
    high = np.searchsorted(at, np.arange(ROWS), side="right") % 2
    q = size * high + moved * size * np.sin(5 * T) + rng.normal(0, noise * size + 1e-12, ROWS)
    assume(abs(size / TURN.get(unit, 2 * pi) - 1) > 0.05 and abs(size / 360 - 1) > 0.05)
    joined, notes = read(q, unit)
    np.testing.assert_array_equal(joined, q)
    assert notes == ()


@settings(max_examples=60, deadline=None)
@given(
    seed=SEEDS, size=st.floats(0.05, 0.9), back=st.integers(2, 30), unit=st.sampled_from(["", "rad", "deg", "count"])
)
def test_a_scan_that_flies_back_in_some_rows_stays(seed: int, size: float, back: int, unit: str) -> None:
    turn = TURN.get(unit, 2 * pi)
    phase = np.mod(np.arange(ROWS) + seed % 400, 400)
    q = turn * size * np.where(phase < 400 - back, phase / (400 - back), (400 - phase) / back)
    joined, notes = read(q, unit)
    np.testing.assert_array_equal(joined, q)
    assert notes == ()


def test_a_counter_is_read_so_with_its_set_point() -> None:
    counts = np.rint(20_000 + 90_000 * np.sin(2 * T)).astype(np.int64)
    columns = {"t": T, "tau": np.cos(2 * T), "q": counts % 65_536, "q_d": (counts + 40) % 65_536}
    made = Recording.of(columns, units={"q": "0.001 deg"})
    np.testing.assert_allclose(made["q"] - made["q"][0], np.deg2rad(0.001 * (counts - counts[0])), atol=1e-9)
    np.testing.assert_allclose(made["q_d"] - made["q"], np.deg2rad(0.04), atol=1e-9)
    assert made.notes == ('table: "q" begins again at 65,536; its turns were counted, from the first row on.',)
    # A position comes to the turn of a set point that goes on: so those of several recordings have one zero.
    table, _ = continued("run", {"q": np.mod(5 + SWING, 2 * pi), "q_d": 5.01 + SWING}, {})
    np.testing.assert_allclose(table["q"], 5 + SWING, atol=1e-9)


@pytest.mark.parametrize("half", [12.5, 95.5])
def test_where_a_drive_sends_no_more_nothing_is_judged(half: float) -> None:
    q = 1.3 * half * np.sin(2 * T)
    made = Recording.of({"t": T, "tau": np.cos(2 * T), "q": np.clip(q, -half, half)})
    beyond = np.abs(q) >= half
    assert sum(np.sum((start <= T) & (end >= T)) for start, end in made.masked) == beyond.sum()
    assert f'"q" stays at {half:g}, the end of what the drive sends, in {beyond.sum():,} rows' in made.notes[0]
    whole = Recording.of({"t": T, "tau": np.cos(2 * T), "q": half * np.sin(2 * T)})
    assert (whole.masked, whole.notes) == ((), ())


# Registers that begin again are put together, and what only looks like one is left as it is.

TIMES = np.arange(4000) / 500
Q = 3.0 * np.sin(0.9 * TIMES) + 2.5 * TIMES
"""Three turns and a half, forth and back."""
TAU = np.rint(400 * np.sin(1.3 * TIMES))


STAYS = {
    "a whole position": {"q": Q},
    "a position that begins again at no turn": {"q": np.mod(Q, 5.0)},
    "one false reading": {"q": np.where(np.arange(len(TIMES)) == 50, -np.pi, Q)},
    "a position that is too fast to tell": {"q": np.mod(1e3 * Q, 2 * np.pi)},
    "a position of more than a turn": {"q": np.mod(Q, 2 * np.pi) + 1.5 * (TIMES > 4)},
    "a set point that steps by a turn": {"q": 0.1 * Q, "q_d": np.where(TIMES > 4, 2 * np.pi, 0.0)},
    "a signed torque": {"tau": TAU},
    "a torque that is never negative": {"tau": TAU + 400},
    "a torque that is on and off": {"tau": np.where(TAU > 0, 65.0, 0.0)},
    "a torque of two values": {"tau": np.where(TAU > 0, 65535.0, 0.0) * (TIMES > 1)},
    "a torque without steps": {"tau": np.where(TAU < 0, TAU + 65536, TAU) + 0.3 * np.sin(7 * TIMES)},
    "a torque of no register": {"tau": np.where(TAU < 0, TAU + 40000, TAU)},
    "no torque": {"tau": np.zeros(len(TIMES))},
}


@pytest.mark.parametrize("what", STAYS)
def test_what_is_no_register_stays(what: str) -> None:
    table, notes = continued("run", dict(STAYS[what]), {})
    assert all(table[name] is read for name, read in STAYS[what].items())
    assert notes == ()


COARSE = np.rint(2.69 * np.rint(TAU / 2.69))
"""A current in steps of 2.69 mA, written as whole mA: it fills a register in threes and twos."""


@pytest.mark.parametrize(
    ("counts", "bits", "step"), [(TAU, 16, 1.0), (TAU, 16, 0.00045), (TAU, 32, 1.0), (TAU, 16, 2.5), (COARSE, 16, 1.0)]
)
def test_a_number_that_lost_its_sign_gets_it_back(counts: np.ndarray, bits: int, step: float) -> None:
    read = np.round(np.where(counts < 0, counts + 2.0**bits, counts) * step, 6)
    table, (note,) = continued("run", {"tau": read}, {})
    np.testing.assert_allclose(table["tau"], step * counts, atol=0.01 * step)
    assert note.startswith('run: "tau" was written without its sign; ')
