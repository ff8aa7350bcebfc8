"""Topics of a bag keep their times: a stamp of 0 is one, and torque and position of two topics are joined by time."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from cosim.data.binary.messages import Message, columns_of
from cosim.data.one_run import rows_of_one
from cosim.data.recording import REQUIRED, Recording

T = np.arange(1500) / 1000
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
    found = rows_of_one(PATH, columns_of(PATH, packed), columns, {}, {}, REQUIRED)
    return Recording.judged(PATH, "run", found, "", columns, {}, REQUIRED)


def test_a_stamp_of_0_is_a_stamp() -> None:
    one = read([joints(t, position=np.sin(9 * t), effort=np.cos(9 * t)) for t in T])
    np.testing.assert_allclose(one.t, T, atol=1e-12)


def test_stamps_that_were_never_set_are_none() -> None:
    made = [joints(t, position=np.sin(9 * t), effort=np.cos(9 * t)) for t in T]
    for _, _, _, message in made:
        message.header = header(0.0)
    np.testing.assert_allclose(read(made).t, T, atol=1e-6)


def test_messages_that_come_twice_or_out_of_order_are_put_right() -> None:
    made = [joints(t, position=np.sin(9 * t), effort=np.cos(9 * t)) for t in T]
    made = [one for one in made for _ in range(2)]
    made[600:604] = [made[602], made[603], made[600], made[601]]
    one = read(made)
    np.testing.assert_allclose(one.t, T, atol=1e-12)
    np.testing.assert_allclose(one["q"], np.sin(9 * T))


def test_torque_and_position_of_two_topics_are_joined_by_time() -> None:
    states = [joints(t, position=np.sin(9 * t)) for t in T if t > 0.2]
    torques = [
        ("/torque_command", "std_msgs/msg/Float64", EPOCH + round(1e9 * (t + 2e-4)), Float(np.cos(9 * t)))
        for t in T[::2]
    ]
    one = read([*states, *torques])
    assert (one.sample_time, one.t[0]) == (pytest.approx(2e-3, rel=1e-6), pytest.approx(0.2, abs=4e-3))
    np.testing.assert_allclose(one["tau"], np.cos(9 * one.t), atol=0.05)
    assert any('"/torque_command.data"' in note and '"az.position"' in note for note in one.notes)


def test_joints_of_two_publishers_of_one_topic_have_their_own_times() -> None:
    az = [joints(t, "az", position=np.sin(9 * t), effort=np.cos(9 * t)) for t in T]
    alt = [joints(t + 3e-4, "alt", position=np.cos(5 * t), effort=np.sin(5 * t)) for t in T]
    mixed = sorted([*az, *alt], key=lambda one: one[2])
    one = read(mixed, tau="az.effort", q="az.position")
    np.testing.assert_allclose(one.t, T, atol=1e-12)
    np.testing.assert_allclose(one["q"], np.sin(9 * one.t), atol=1e-12)


def test_publishers_are_told_apart_by_the_frame_in_their_header() -> None:
    """Two encoders in one topic: the values of one would jump to those of the other."""
    made = []
    for t in T:
        made.append(joints(t, position=np.sin(9 * t), effort=np.cos(9 * t)))
        other = joints(t + 1e-4, position=7 + np.sin(9 * t), effort=np.cos(9 * t))
        other[3].header.frame_id = "load"
        made.append(other)
    one = read(made)
    np.testing.assert_allclose(one["q"], np.sin(9 * T))
    assert one.notes[0] == "run: of its topics /joint_states was read; left out: /joint_states (load)."
