"""Vectors of time of their own lengths in MAT, HDF5, NumPy and Parquet files: each channel is read at its own times."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from scipy.io import savemat

from cosim.data.columns import Request
from cosim.data.one_run import rows_of_one
from cosim.data.recording import REQUIRED, Recording
from cosim.support.errors import UndecidedError
from cosim_readers.messages import Message, columns_of

TA, TQ = np.arange(2000) / 1000, 3e-4 + np.arange(1000) / 500
TAU, Q = np.cos(9 * TA), 0.1 * np.sin(9 * TQ)
Arrays = Mapping[str, np.ndarray]


def npz(path: Path, arrays: Arrays) -> Path:
    np.savez(path.with_suffix(".npz"), **arrays)
    return path.with_suffix(".npz")


def mat(path: Path, arrays: Arrays) -> Path:
    savemat(path.with_suffix(".mat"), dict(arrays))
    return path.with_suffix(".mat")


def structs(path: Path, arrays: Arrays) -> Path:
    first, second = ([*arrays.values()][start : start + 2] for start in (0, 2))
    whole = {"torque": {"time": first[0], "data": first[1]}, "angle": {"time": second[0], "data": second[1]}}
    savemat(path.with_suffix(".mat"), whole)
    return path.with_suffix(".mat")


def simulink(path: Path, arrays: Arrays) -> Path:
    first, second = ([*arrays.values()][start : start + 2] for start in (0, 2))
    whole = {"tau": first, "q": second}
    logs = {name: {"time": t, "signals": {"values": x, "label": "", "dimensions": 1}} for name, (t, x) in whole.items()}
    savemat(path.with_suffix(".mat"), logs)
    return path.with_suffix(".mat")


def hdf5(path: Path, arrays: Arrays) -> Path:
    h5py = pytest.importorskip("h5py")
    names = ("drive/timestamp", "drive/torque", "encoder/timestamp", "encoder/angle")
    with h5py.File(path.with_suffix(".h5"), "w") as file:
        for name, (own, column) in zip(names, arrays.items(), strict=True):
            file[name] = column
            file[name].attrs["unit"] = "ms" if own.endswith("ms") else "s" if "t_" in own else "1"
    return path.with_suffix(".h5")


def lists(path: Path, arrays: Arrays) -> Path:
    parquet.write_table(pa.table({name: [one.tolist()] for name, one in arrays.items()}), path.with_suffix(".parquet"))
    return path.with_suffix(".parquet")


def columns(path: Path, arrays: Arrays) -> Path:
    rows = max(map(len, arrays.values()))
    padded = {name: np.append(one, np.full(rows - len(one), np.nan)) for name, one in arrays.items()}
    ordered = {name: padded[name] for name in sorted(padded, key=lambda name: name.startswith("t_"))}
    parquet.write_table(pa.table(ordered), path.with_suffix(".parquet"))
    return path.with_suffix(".parquet")


WRITERS = (npz, mat, structs, simulink, hdf5, lists, columns)


@pytest.mark.parametrize("write", WRITERS)
def test_a_time_for_each_channel_is_read_whatever_the_format(tmp_path: Path, write: Callable[..., Path]) -> None:
    path = write(tmp_path / "run", {"t_tau": TA, "tau": TAU, "t_q": TQ, "q": Q})
    seen = Recording.read(path)
    assert {*seen.columns} == {"t", "tau", "q"}
    np.testing.assert_allclose(seen.t, TQ, atol=1e-12)
    np.testing.assert_allclose(seen["q"], Q, atol=1e-12)
    np.testing.assert_allclose(seen["tau"], np.cos(9 * TQ), atol=2e-5)
    assert "by its mean over each row's interval" in " ".join(seen.notes)


@pytest.mark.parametrize("write", [npz, mat, lists, columns])
def test_times_of_one_length_belong_to_the_channels_that_they_are_named_after(
    tmp_path: Path, write: Callable[..., Path]
) -> None:
    late = TA + 3e-4
    seen = Recording.read(write(tmp_path / "run", {"t_tau": TA, "tau": TAU, "t_q": late, "q": 0.1 * np.sin(9 * late)}))
    np.testing.assert_allclose(seen["q"], 0.1 * np.sin(9 * seen.t), atol=1e-9)
    np.testing.assert_allclose(seen["tau"], np.cos(9 * seen.t), atol=2e-5)


def test_a_device_has_one_time_for_its_channels_and_a_unit_of_its_own(tmp_path: Path) -> None:
    arrays = {"t_drive_ms": 1e3 * TA, "drive_torque": TAU, "drive_load": TAU**2, "t_encoder": TQ, "encoder_angle": Q}
    seen = Recording.read(npz(tmp_path / "run", arrays))
    assert {*seen.columns} == {"t", "tau", "q", "drive_load"}
    np.testing.assert_allclose(seen["tau"], np.cos(9 * seen.t), atol=2e-5)


def test_arrays_without_a_time_of_their_length_are_named(tmp_path: Path) -> None:
    arrays = {"t_tau": TA, "tau": TAU, "t_q": TQ, "q": Q, "gains": np.arange(7.0)}
    assert (
        "run: arrays without a time of their length were left out: gains."
        in Recording.read(npz(tmp_path / "run", arrays)).notes
    )


def test_the_owner_may_say_which_time_is_meant(tmp_path: Path) -> None:
    path = npz(tmp_path / "run", {"t_tau": TA, "tau": TAU, "q_raw": 0.1 * np.sin(9 * TA), "t_2": TQ, "noise": Q})
    seen = Recording.read(path, {"t": "t_tau", "q": "q_raw"})
    np.testing.assert_array_equal(seen["tau"], TAU)


def test_samples_of_one_time_that_differ_are_asked_for_in_a_channel_too(tmp_path: Path) -> None:
    stands = TA.copy()
    stands[700] = stands[699]
    path = npz(tmp_path / "run", {"t_tau": stands, "tau": TAU, "t_q": TQ, "q": Q})
    with pytest.raises(UndecidedError, match=r"values differ at its sample 701 .* --layout repeated=first"):
        Recording.read(path)
    assert len(Recording.read(path, layout={"repeated": "last"})) == len(TQ) - 1  # its interval is half empty


# Topics of a bag keep their times: a stamp of 0 is one, and torque and position of two topics are joined by time.

STAMPS = np.arange(1500) / 1000
EPOCH = 1_766_000_000 * 10**9
PATH = Path("run.mcap")


@dataclass
class Stamp:
    sec: int
    nanosec: int


@dataclass
class Header:
    stamp: Stamp
    frame_id: str = ""


@dataclass
class Joints:
    header: Header
    name: list[str]
    position: list[float] = field(default_factory=list)
    velocity: list[float] = field(default_factory=list)
    effort: list[float] = field(default_factory=list)


@dataclass
class Float:
    data: float


def header(t: float, frame: str = "") -> Header:
    ns = round(1e9 * t)
    return Header(Stamp(ns // 10**9, ns % 10**9), frame)


def joints(t: float, name: str = "az", **values: float) -> tuple[str, str, int, Joints]:
    lists = {key: [value] for key, value in values.items()}
    return "/joint_states", "sensor_msgs/msg/JointState", EPOCH + round(1e9 * t), Joints(header(t), [name], **lists)


def read(messages: list[tuple[str, str, int, object]], **columns: str) -> Recording:
    packed = [Message(topic, kind, logged, 100, lambda given=given: given) for topic, kind, logged, given in messages]
    request = Request(PATH, columns, required=REQUIRED)
    return Recording.judged(request, "run", rows_of_one(request, columns_of(PATH, packed)), "")


def test_a_stamp_of_0_is_a_stamp() -> None:
    one = read([joints(t, position=np.sin(9 * t), effort=np.cos(9 * t)) for t in STAMPS])
    np.testing.assert_allclose(one.t, STAMPS, atol=1e-12)


def test_stamps_that_were_never_set_are_none() -> None:
    made = [joints(t, position=np.sin(9 * t), effort=np.cos(9 * t)) for t in STAMPS]
    for _, _, _, message in made:
        message.header = header(0.0)
    np.testing.assert_allclose(read(made).t, STAMPS, atol=1e-6)


def test_messages_that_come_twice_or_out_of_order_are_put_right() -> None:
    made = [joints(t, position=np.sin(9 * t), effort=np.cos(9 * t)) for t in STAMPS]
    made = [one for one in made for _ in range(2)]
    made[600:604] = [made[602], made[603], made[600], made[601]]
    one = read(made)
    np.testing.assert_allclose(one.t, STAMPS, atol=1e-12)
    np.testing.assert_allclose(one["q"], np.sin(9 * STAMPS))


def test_torque_and_position_of_two_topics_are_joined_by_time() -> None:
    states = [joints(t, position=np.sin(9 * t)) for t in STAMPS if t > 0.2]
    torques = [
        ("/torque_command", "std_msgs/msg/Float64", EPOCH + round(1e9 * (t + 2e-4)), Float(np.cos(9 * t)))
        for t in STAMPS[::2]
    ]
    one = read([*states, *torques])
    assert (one.sample_time, one.t[0]) == (pytest.approx(2e-3, rel=1e-6), pytest.approx(0.2, abs=4e-3))
    np.testing.assert_allclose(one["tau"], np.cos(9 * one.t), atol=0.05)
    assert any('"/torque_command.data"' in note and '"az.position"' in note for note in one.notes)


def test_joints_of_two_publishers_of_one_topic_have_their_own_times() -> None:
    az = [joints(t, "az", position=np.sin(9 * t), effort=np.cos(9 * t)) for t in STAMPS]
    alt = [joints(t + 3e-4, "alt", position=np.cos(5 * t), effort=np.sin(5 * t)) for t in STAMPS]
    mixed = sorted([*az, *alt], key=lambda one: one[2])
    one = read(mixed, tau="az.effort", q="az.position")
    np.testing.assert_allclose(one.t, STAMPS, atol=1e-12)
    np.testing.assert_allclose(one["q"], np.sin(9 * one.t), atol=1e-12)


def test_publishers_are_told_apart_by_the_frame_in_their_header() -> None:
    """Two encoders in one topic: the values of one would jump to those of the other."""
    made = []
    for t in STAMPS:
        made.append(joints(t, position=np.sin(9 * t), effort=np.cos(9 * t)))
        other = joints(t + 1e-4, position=7 + np.sin(9 * t), effort=np.cos(9 * t))
        other[3].header.frame_id = "load"
        made.append(other)
    one = read(made)
    np.testing.assert_allclose(one["q"], np.sin(9 * STAMPS))
    assert one.notes[0] == "run: of its topics /joint_states was read; left out: /joint_states (load)."
