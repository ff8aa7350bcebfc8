"""The file of a black box: what its head may say, which records count, and what is made of them."""

import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.hardware.blackbox import HEADER, MAGIC, BlackBox, read_black_box, recording_of, unwrapped
from cosim.hardware.structures import RECORD
from cosim.support.errors import HardwareError

ORIGIN: dict[str, Any] = {
    "inputs": ["q", "q_d"],
    "units": {"q_d": "rad"},
    "step": 1e-3,
    "quantum": 2e-6,
    "encoder": "q",
    "machine": {"encoder": {"heads": 0}},
}
DAMAGED = "whose head is damaged, or that is cut short"


def filled(path: Path, capacity: int, count: int, origin: dict[str, Any] = ORIGIN) -> None:
    """Write as many records as a loop would have: number, torque, counts and all that a reader needs."""
    box = BlackBox(path, capacity, origin)
    for number in range(1, count + 1):
        one = np.zeros(1, RECORD)
        one["sequence"], one["torque"], one["sample"]["tick"] = number, 10 * number, number - 1
        one["sample"]["feedback"]["counts"] = (100 * number) % 2**32
        one["sample"]["input"][:, :2] = [[7, 1000 + number]]
        body = slice(RECORD.fields["sample"][1], RECORD.fields["crc"][1])
        one["crc"] = zlib.crc32(one.tobytes()[body])
        box._records[(number - 1) % capacity] = one[0]
    box.box.written = count
    box.close()


@pytest.mark.parametrize(("capacity", "count"), [(8, 0), (8, 5), (8, 8), (8, 9), (8, 23), (1, 4)])
def test_the_ring_gives_its_newest_records_in_their_order(tmp_path: Path, capacity: int, count: int) -> None:
    filled(tmp_path / "box", capacity, count)
    kept = read_black_box(tmp_path / "box")
    assert kept.records["sequence"].tolist() == list(range(max(0, count - capacity) + 1, count + 1))
    assert kept.torn == 0
    assert kept.origin["capacity"] == capacity


def damaged(path: Path, places: list[int], moved: bool = False) -> None:
    """Change a bit of each record, or put another whole one in its place."""
    raw, size = bytearray(path.read_bytes()), RECORD.itemsize
    for start in (HEADER + place * size for place in places):
        raw[start + RECORD.fields["torque"][1]] ^= 1
        if moved:
            raw[start : start + size] = raw[HEADER + 5 * size : HEADER + 6 * size]
    path.write_bytes(raw)


@pytest.mark.parametrize("moved", [False, True])
@pytest.mark.parametrize(
    ("count", "places", "torn"), [(5, [2], 1), (5, [4], 0), (8, [3], 1), (19, [3], 0), (19, [4], 1), (19, [3, 4, 1], 2)]
)
def test_torn_is_what_is_missing_among_the_records_but_the_one_that_was_being_written(
    tmp_path: Path, count: int, places: list[int], torn: int, moved: bool
) -> None:
    """Of 19 records in a ring of 8 the oldest, at place 3, is the one that the next would go over."""
    filled(tmp_path / "box", 8, count)
    damaged(tmp_path / "box", places, moved)
    kept = read_black_box(tmp_path / "box")
    assert kept.torn == torn
    assert not set(kept.records["sequence"]) & {number for number in range(1, count + 1) if (number - 1) % 8 in places}


def without(*keys: str) -> dict[str, Any]:
    return {key: value for key, value in ORIGIN.items() if key not in keys}


WRONG: list[dict[str, Any]] = [
    *(without(key) for key in ORIGIN),
    *(ORIGIN | {"inputs": one} for one in ("q", ["q", 1], [f"i{k}" for k in range(9)])),
    *(ORIGIN | {key: one} for key in ("step", "quantum") for one in (0.0, -1e-3, 1, "1", float("inf"), float("nan"))),
    ORIGIN | {"encoder": 1},
    ORIGIN | {"units": {"q": 1}},
    ORIGIN | {"units": ["q"]},
    *(ORIGIN | {"machine": one} for one in ({}, {"encoder": {}}, {"encoder": {"heads": 1}}, {"encoder": {"heads": 5}})),
    *(ORIGIN | {"capacity": one} for one in (0, -4, True, 4.0, "4", 3, 5, 99_999_999_999)),
]
"""Heads of 4 records that lack what a recording needs, or say another number of records."""
HEADS = [json.dumps({"capacity": 4} | one).encode() for one in WRONG]
HEADS += [b"x", b"[1]", b"{}", b"[" * 30_000, bytes(range(256)) * 10]


@pytest.mark.parametrize("head", HEADS, ids=lambda one: one[-30:].decode("ascii", "replace"))
def test_a_head_that_lacks_what_a_recording_needs_or_is_none_is_damaged(tmp_path: Path, head: bytes) -> None:
    head = MAGIC + head + b"\n"
    (tmp_path / "box").write_bytes(head.ljust(HEADER, b"\n") + bytes(4 * RECORD.itemsize))
    with pytest.raises(HardwareError, match=DAMAGED):
        read_black_box(tmp_path / "box")


@pytest.mark.parametrize("more", [{"inputs": [f"i{k}" for k in range(8)]}, {"machine": {"encoder": {"heads": 4}}}])
def test_a_head_that_has_it_is_whole(tmp_path: Path, more: dict[str, Any]) -> None:
    origin = ORIGIN | more
    BlackBox(tmp_path / "box", 4, origin).close()
    assert read_black_box(tmp_path / "box").origin == origin | {"capacity": 4}


@pytest.mark.parametrize("size", [HEADER // 2, HEADER, -1, 1])
def test_a_black_box_that_is_cut_or_longer_is_damaged(tmp_path: Path, size: int) -> None:
    filled(tmp_path / "box", 8, 10)
    raw = (tmp_path / "box").read_bytes()
    (tmp_path / "box").write_bytes(raw + b"\0" if size == 1 else raw[:size])
    with pytest.raises(HardwareError, match=f"is no black box of this version|{DAMAGED}"):
        read_black_box(tmp_path / "box")


def test_a_head_may_fill_its_place_and_not_a_byte_more(tmp_path: Path) -> None:
    bare = len(MAGIC + json.dumps(ORIGIN | {"scenario": "", "capacity": 4}).encode()) + 1
    BlackBox(tmp_path / "full", 4, ORIGIN | {"scenario": "x" * (HEADER - bare)}).close()
    assert len(read_black_box(tmp_path / "full").origin["scenario"]) == HEADER - bare
    with pytest.raises(HardwareError, match="what the scenario says of itself is longer than 65536 bytes"):
        BlackBox(tmp_path / "more", 4, ORIGIN | {"scenario": "x" * (HEADER - bare + 1)})
    assert [one.name for one in tmp_path.iterdir()] == ["full"]


def test_the_torque_of_a_row_is_the_mean_of_the_order_that_ends_there_and_the_one_that_begins(tmp_path: Path) -> None:
    """Order k, 10 (k + 1) N m, acts from edge k + 1 on; a sample interval is centred at its edge."""
    filled(tmp_path / "box", 8, 5)
    found = recording_of(read_black_box(tmp_path / "box"), "box")
    np.testing.assert_array_equal(found["tau"], [0, 5, 15, 25, 35])
    np.testing.assert_array_equal(found["machine.order"], [10, 20, 30, 40, 50])
    np.testing.assert_allclose(found.t, 1e-3 * np.arange(5), rtol=1e-15)
    np.testing.assert_allclose(found["q"], 2e-6 * 100 * np.arange(1, 6), rtol=1e-15)
    np.testing.assert_array_equal(found["q_d"], 1001 + np.arange(5))
    assert found.units["q_d"] == "rad"
    assert found.units["tau"] == found.units["machine.order"] == found.units["machine.command"] == "N.m"
    assert not [name for name in found if name.startswith("machine.head")]
    assert found.origin["torn"] == 0


def test_a_loop_that_has_gone_on_leaves_out_what_it_may_be_writing(tmp_path: Path) -> None:
    """A sixteenth of the ring, the oldest records, is left to the loop while this one copies."""
    box = BlackBox(tmp_path / "box", 32, ORIGIN)
    box._records["sequence"] = np.arange(1, 33)
    box.box.written = 32
    assert box.drain()["sequence"].tolist() == list(range(3, 33))
    box._records["sequence"][:3] = [33, 34, 35]
    box.box.written = 35
    assert box.drain()["sequence"].tolist() == [33, 34, 35]
    assert box.drain()["sequence"].tolist() == []
    box.close()


@pytest.mark.parametrize("first", [0, -1, -(2**31), 2**31 - 1, 123_456_789])
def test_counts_that_wrap_are_a_position_that_does_not(first: int) -> None:
    ends = [2**31 - 1, -(2**31) + 1]
    steps = np.random.default_rng(7).integers(-(2**31) + 1, 2**31, 300)
    places = np.cumsum([first, *ends, *ends[:1] * 3, *ends[1:] * 5, 0, 1, -1, *steps])
    np.testing.assert_array_equal(unwrapped(places % 2**32), places)
    np.testing.assert_array_equal(unwrapped(places[:1] % 2**32), places[:1])
