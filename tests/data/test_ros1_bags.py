"""Bags of ROS 1: written here after the format's description, read by the definitions that they hold."""

import bz2
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from cosim.data.recording import Recording
from cosim.support.errors import RecordingError

LINE = "=" * 80
JOINT_STATE = f"""# joints
Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{LINE}
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
"""
WHEEL = f"""uint8 OFF=0
bool on
int16 ticks
Pair pair
float32[2] extra
{LINE}
MSG: my/Pair
float64 torque
float64 speed
"""
T = np.arange(300) * 4e-3
Q = np.sin(3 * T)
TAU = np.cos(5 * T)


def record(data: bytes, **fields: bytes) -> bytes:
    header = b"".join(
        struct.pack("<I", len(one)) + one for one in (name.encode() + b"=" + value for name, value in fields.items())
    )
    return struct.pack("<I", len(header)) + header + struct.pack("<I", len(data)) + data


def connection(number: int, topic: str, kind: str, definition: str) -> bytes:
    told = {b"topic": topic.encode(), b"type": kind.encode(), b"message_definition": definition.encode()}
    body = b"".join(struct.pack("<I", len(k) + len(v) + 1) + k + b"=" + v for k, v in told.items())
    return record(body, op=b"\x07", conn=struct.pack("<I", number), topic=topic.encode())


def message(number: int, t: float, body: bytes) -> bytes:
    return record(body, op=b"\x02", conn=struct.pack("<I", number), time=stamp(t))


def stamp(t: float) -> bytes:
    nanos = round((1_700_000_000 + t) * 1e9)
    return struct.pack("<II", nanos // 10**9, nanos % 10**9)


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def joint_state(t: float, q: float, tau: float) -> bytes:
    doubles = b"".join(struct.pack("<Id", 1, value) for value in (q, 0.0, tau))
    return struct.pack("<I", 0) + stamp(t) + text("base") + struct.pack("<I", 1) + text("az") + doubles


def joints() -> list[bytes]:
    states = [joint_state(t, q, tau) for t, q, tau in zip(T, Q, TAU, strict=True)]
    return [message(0, t + 0.1, state) for t, state in zip(T, states, strict=True)]


def bag(path: Path, connections: Sequence[bytes], messages: Sequence[bytes], packing: str = "none") -> Path:
    content = b"".join([*connections, *messages])
    packed = {
        "none": lambda data: data,
        "bz2": bz2.compress,
        "lz4": lambda data: pa.Codec("lz4").compress(data, asbytes=True),
    }
    chunk = record(
        packed[packing](content), op=b"\x05", compression=packing.encode(), size=struct.pack("<I", len(content))
    )
    path.write_bytes(b"#ROSBAG V2.0\n" + record(b" " * 40, op=b"\x03") + chunk)
    return path


@pytest.mark.parametrize("packing", ["none", "bz2", "lz4"])
def test_joint_states_of_a_bag_are_read_with_the_stamps_of_their_headers(tmp_path: Path, packing: str) -> None:
    one = connection(0, "/joint_states", "sensor_msgs/JointState", JOINT_STATE)
    seen = Recording.read(bag(tmp_path / "run.bag", [one], joints(), packing))
    np.testing.assert_array_equal(seen["q"], Q)
    np.testing.assert_array_equal(seen["tau"], TAU)
    np.testing.assert_allclose(seen.t, T, atol=2e-7)


def test_numbers_of_any_other_message_are_columns(tmp_path: Path) -> None:
    bodies = [struct.pack("<?hddff", True, 7, tau, q, 1.0, 2.0) for q, tau in zip(Q, TAU, strict=True)]
    messages = [message(0, t, body) for t, body in zip(T, bodies, strict=True)]
    path = bag(tmp_path / "run.bag", [connection(0, "/wheel", "my/Wheel", WHEEL)], messages)
    seen = Recording.read(path, {"tau": "pair.torque", "v": "pair.speed"})
    np.testing.assert_array_equal(seen["v"], Q)
    assert set(seen["extra[1]"]) == {2.0}
    assert set(seen["ticks"]) == {7.0}


def test_a_bag_whose_recorder_was_killed_is_read_with_a_note(tmp_path: Path) -> None:
    one = connection(0, "/joint_states", "sensor_msgs/JointState", JOINT_STATE)
    path = bag(tmp_path / "run.bag", [one], joints())
    path.write_bytes(path.read_bytes() + record(b"x" * 100, op=b"\x05")[:60])
    seen = Recording.read(path)
    assert len(seen) == len(T)
    assert "its last record was left out, as it is torn" in seen.notes[0]


@pytest.mark.parametrize(
    ("definition", "body", "said"),
    [
        ("Node node\n" + LINE + "\nMSG: my/Node\nNode node\n", b"", "my/Node holds itself"),
        ("Other other", b"", "my/Other is not defined"),
        ("float64[] x", struct.pack("<I", 2**31), "bytes too early"),
        ("Empty[] x\n" + LINE + "\nMSG: my/Empty\n", struct.pack("<I", 2**32 - 1), "claims 4,294,967,295 values"),
    ],
)
def test_messages_that_claim_too_much_are_refused(tmp_path: Path, definition: str, body: bytes, said: str) -> None:
    path = bag(tmp_path / "bad.bag", [connection(0, "/x", "my/Type", definition)], [message(0, 0.0, body)])
    with pytest.raises(RecordingError, match=said):
        Recording.read(path)


def test_chunks_that_unpack_to_far_more_than_the_file_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "bomb.bag"
    zeros = bz2.compress(bytes(50_000_000))
    chunk = record(zeros, op=b"\x05", compression=b"bz2", size=struct.pack("<I", 2**31))
    path.write_bytes(b"#ROSBAG V2.0\n" + chunk)
    with pytest.raises(RecordingError, match=r"unpacks to .* or more"):
        Recording.read(path)


def test_an_older_bag_is_refused(tmp_path: Path) -> None:
    (tmp_path / "old.bag").write_bytes(b"#ROSRECORD V1.1\n" + bytes(50))
    with pytest.raises(RecordingError, match=r"no bag of ROS 1 of format 2\.0.*rosbag reindex"):
        Recording.read(tmp_path / "old.bag")
