"""Bags: of ROS 1, written here after the format's description; topics keep their times and are joined by them."""

import bz2
import struct
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest

from cosim.data.columns import Request
from cosim.data.one_run import rows_of_one
from cosim.data.recording import REQUIRED, Recording
from cosim.support.errors import RecordingError
from cosim_readers.messages import Message, columns_of

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
@pytest.mark.parametrize("torn", [b"", record(b"x" * 100, op=b"\x05")[:60]], ids=["whole", "its recorder was killed"])
def test_joint_states_of_a_bag_are_read_with_the_stamps_of_their_headers(
    tmp_path: Path, packing: str, torn: bytes
) -> None:
    one = connection(0, "/joint_states", "sensor_msgs/JointState", JOINT_STATE)
    path = bag(tmp_path / "run.bag", [one], joints(), packing)
    path.write_bytes(path.read_bytes() + torn)
    seen = Recording.read(path)
    assert ("its last record was left out, as it is torn" in seen.notes[0]) == bool(torn)
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


ZEROS = record(bz2.compress(bytes(50_000_000)), op=b"\x05", compression=b"bz2", size=struct.pack("<I", 2**31))


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"#ROSBAG V2.0\n" + ZEROS, r"unpacks to .* or more"),
        (b"#ROSRECORD V1.1\n" + bytes(50), r"no bag of ROS 1 of format 2\.0.*rosbag reindex"),
    ],
    ids=["chunks that unpack to far more than the file", "an older bag"],
)
def test_what_is_no_bag_of_today_or_a_bomb_is_refused(tmp_path: Path, data: bytes, sentence: str) -> None:
    (tmp_path / "bad.bag").write_bytes(data)
    with pytest.raises(RecordingError, match=sentence):
        Recording.read(tmp_path / "bad.bag")


# Topics of a bag keep their times: a stamp of 0 is one, and torque and position of two topics are joined by time.

STAMPS = np.arange(1500) / 1000
EPOCH = 1_766_000_000 * 10**9
PATH = Path("run.mcap")


def state(t: float, name: str = "az", frame: str = "", stamp: float = -1.0, **values: float) -> tuple:
    """A message of joint states: topic, type, time it was logged, and what it holds."""
    ns = round(1e9 * (t if stamp < 0 else stamp))
    header = SimpleNamespace(stamp=SimpleNamespace(sec=ns // 10**9, nanosec=ns % 10**9), frame_id=frame)
    lists = {key: [values[key]] if key in values else [] for key in ("position", "velocity", "effort")}
    state = SimpleNamespace(header=header, name=[name], **lists)
    return "/joint_states", "sensor_msgs/msg/JointState", EPOCH + round(1e9 * t), state


def both(t: float, **more: object) -> tuple:
    return state(t, position=np.sin(9 * t), effort=np.cos(9 * t), **more)


def topics(messages: list[tuple], **columns: str) -> Recording:
    packed = [Message(topic, kind, logged, 100, lambda given=given: given) for topic, kind, logged, given in messages]
    request = Request(PATH, columns, required=REQUIRED)
    return Recording.judged(request, "run", rows_of_one(request, columns_of(PATH, packed)), "")


@pytest.mark.parametrize("stamp", [-1.0, 0.0], ids=["a stamp of 0 is one", "stamps that were never set are none"])
def test_stamps_are_the_times_of_messages_or_those_of_the_log(stamp: float) -> None:
    np.testing.assert_allclose(topics([both(t, stamp=stamp) for t in STAMPS]).t, STAMPS, atol=1e-12 if stamp else 1e-6)


def test_torque_and_position_of_two_topics_are_joined_by_time() -> None:
    states = [state(t, position=np.sin(9 * t)) for t in STAMPS if t > 0.2]
    torques = [
        ("/torque_command", "std_msgs/msg/Float64", EPOCH + round(1e9 * t + 2e5), SimpleNamespace(data=np.cos(9 * t)))
        for t in STAMPS[::2]
    ]
    one = topics([*states, *torques])
    assert (one.sample_time, one.t[0]) == (pytest.approx(2e-3, rel=1e-6), pytest.approx(0.2, abs=4e-3))
    np.testing.assert_allclose(one["tau"], np.cos(9 * one.t), atol=0.05)
    assert any('"/torque_command.data"' in note and '"az.position"' in note for note in one.notes)


def test_publishers_of_one_topic_are_told_apart_and_messages_out_of_order_are_put_right() -> None:
    """Two encoders in one topic: the values of one would jump to those of the other."""
    alt = [state(t + 3e-4, "alt", position=np.cos(5 * t), effort=np.sin(5 * t)) for t in STAMPS]
    mixed = sorted([*(both(t) for t in STAMPS), *alt], key=lambda one: one[2])
    one = topics(mixed, tau="az.effort", q="az.position")
    np.testing.assert_allclose(one.t, STAMPS, atol=1e-12)
    np.testing.assert_allclose(one["q"], np.sin(9 * one.t), atol=1e-12)
    load = [state(t + 1e-4, frame="load", position=7 + np.sin(9 * t), effort=np.cos(9 * t)) for t in STAMPS]
    one = topics([message for pair in zip(map(both, STAMPS), load, strict=True) for message in pair])
    np.testing.assert_allclose(one["q"], np.sin(9 * STAMPS))
    assert one.notes[0] == "run: of its topics /joint_states was read; left out: /joint_states (load)."
    made = [both(t) for t in STAMPS for _ in range(2)]
    made[600:604] = [made[602], made[603], made[600], made[601]]
    one = topics(made)
    np.testing.assert_allclose(one.t, STAMPS, atol=1e-12)
    np.testing.assert_allclose(one["q"], np.sin(9 * STAMPS))
