"""Messages of ROS as columns: each topic that is read has its own times.

A `sensor_msgs/msg/JointState` gives `joint.position`, `joint.velocity` and `joint.effort` of every joint; of any other
message every number becomes a column, named by its path in the message. The topic that tells of an axis is read: joint
states first, else the one with most numbers. Where it has no torque or no motion the other topics are read too, their
columns named after them: `/torque_command.data`. Publishers of one topic are told apart by the joints they name, by the
frame in their header, or by their number.

Time is the stamp in the header, and 0 is a stamp where time counts from 0; without a stamp it is when the message was
logged.
Source: common_interfaces, sensor_msgs/msg/JointState: position in rad or m, velocity in rad/s or m/s, effort
in N.m or N.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from cosim.data.columns import Columns
from cosim.data.limits import COLUMNS, NUMBER, allowance, check_cells, check_columns, check_time, listed
from cosim.data.roles import tell_an_axis

JOINTS = ("position", "velocity", "effort")
NANO = 1e-9
WIDE, LEAST = 100, 2
"""Numbers of a message, beyond which it is an image or a cloud and no signal beside others; and messages of a topic."""
DATES = 10**18
"""Stamps [ns] from which on they are dates (2001): among them 0 says that none was set."""
APART = 60 * 10**9
"""Stamps that are so far [ns] from the time of the log are of another clock: a simulation's."""


@dataclass
class Topic:
    """Messages of one publisher of a topic: stamps, -1 for none, and times of the log in ns, and one row of numbers."""

    name: str
    kind: str
    stamps: list[int] = field(default_factory=list)
    logged: list[int] = field(default_factory=list)
    rows: list[dict[str, float]] = field(default_factory=list)

    @property
    def tells_an_axis(self) -> tuple[bool, int]:
        """Rank among topics: joint states first, then the one with most numbers."""
        return self.kind.endswith("JointState"), sum(map(len, self.rows[:1])) * len(self.rows)

    @property
    def names(self) -> tuple[str, ...]:
        """Its columns."""
        return tuple(dict.fromkeys(name for row in self.rows for name in row))

    @property
    def is_whole(self) -> bool:
        """Whether it tells of torque and of motion."""
        return tell_an_axis(self.names, {})

    def times(self) -> np.ndarray:
        """Times of its messages in ns, shape (rows,)."""
        stamps, logged = np.array(self.stamps, dtype=np.int64), np.array(self.logged, dtype=np.int64)
        unset = (stamps < 0) | ((stamps == 0) & ((stamps <= 0).all() or stamps[stamps > 0].min() >= DATES))
        return np.where(unset, logged, stamps)


@dataclass(frozen=True)
class Message:
    """A message as it lies in a file: topic, type, time it was logged [ns], bytes, and what decodes it."""

    topic: str
    kind: str
    logged: int
    size: int
    decode: Callable[[], Any]


def columns_of(path: Path, messages: Iterable[Message], release: str = "ROS 2") -> Columns:
    """Make columns of messages; `release` wrote them. Images and clouds are left out before they are decoded."""
    topics: dict[tuple[str, str], Topic] = {}
    wide: dict[str, int] = {}
    most = COLUMNS * allowance(path).raised
    for one in messages:
        check_time(path)
        if one.size > NUMBER * most:
            wide[one.topic] = one.size // NUMBER
        if one.topic in wide:
            continue
        message = one.decode()
        row = dict(islice(_numbers(message, one.kind), most + 1))
        if len(row) > most:
            wide[one.topic] = len(row)
            continue
        topic = _topic(topics, one, getattr(message, "header", None))
        topic.logged.append(one.logged)
        topic.rows.append(row)
        check_cells(path, len(topic.rows), len(row) + 1)
    narrow = [topic for (name, _), topic in topics.items() if name not in wide]
    chosen = max(narrow, key=lambda topic: topic.tells_an_axis, default=None)
    if chosen is None or not any(chosen.rows):
        check_columns(path, max(wide.values(), default=0))
        return Columns({})
    others = [one for one in narrow if one is not chosen]
    beside = [one for one in others if len(one.rows) >= LEAST and 0 < len(one.names) <= WIDE]
    left = [*(one.name for one in others), *wide]
    return _joined(path, [chosen, *(() if chosen.is_whole else beside)], left, release)


def _topic(topics: dict[tuple[str, str], Topic], message: Message, header: Any) -> Topic:
    """Return the topic of a message with its stamp noted; publishers that name different frames have one each."""
    frame = str(getattr(header, "frame_id", ""))
    if (message.topic, frame) not in topics:
        again = any(other == message.topic for other, _ in topics)
        topics[message.topic, frame] = Topic(f"{message.topic} ({frame})" if again else message.topic, message.kind)
    topic = topics[message.topic, frame]
    topic.stamps.append(_stamp(header))
    return topic


def _joined(path: Path, topics: Sequence[Topic], others: Sequence[str], release: str) -> Columns:
    """Columns of topics, the first of which is the one that tells of an axis; `others` are named where left out."""
    check_columns(path, sum(len(one.names) for one in topics))
    times = [one.times() for one in topics]
    if any(abs(int(t[0]) - one.logged[0]) > APART for t, one in zip(times, topics, strict=True)) and len(topics) > 1:
        own = [bool((t == one.logged).all()) for t, one in zip(times, topics, strict=True)]
        times = [np.array(one.logged, dtype=np.int64) for one in topics] if any(own) else times
    first = min(int(one[0]) for one in times)
    values: dict[str, np.ndarray] = {}
    clocks: dict[str, np.ndarray] = {}
    for topic, stamps in zip(topics, times, strict=True):
        clock = (stamps - first) * NANO
        for name in topic.names:
            told = np.array([name in row for row in topic.rows])
            whole = name if topic is topics[0] else f"{topic.name}.{name}"
            values[whole] = np.array([row[name] for row in topic.rows if name in row])
            clocks[whole] = clock if told.all() else clock[told]
    left = tuple(sorted({*others} - {one.name for one in topics}))
    read = " and ".join(one.name for one in topics)
    notes = (f"{path.stem}: of its topics {read} was read; left out: {listed(left)}.",) if left else ()
    start = str(np.datetime64(first // 1_000_000, "ms")) if first > DATES else ""
    kind = topics[0].kind.split("/")[-1]
    return Columns(values, format=f"{release} {kind}", start=start, notes=notes, clocks=clocks)


def _stamp(header: Any) -> int:
    """Return the stamp of a header in ns, -1 where there is none."""
    stamp = getattr(header, "stamp", None)
    return int(stamp.sec) * 10**9 + int(stamp.nanosec) if stamp is not None else -1


def _numbers(message: Any, kind: str) -> Iterator[tuple[str, float]]:
    if not kind.endswith("JointState"):
        yield from _leaves(message, "")
        return
    for what in JOINTS:
        for joint, value in zip(message.name, getattr(message, what), strict=False):
            yield f"{joint}.{what}", float(value)


def _leaves(value: Any, name: str) -> Iterator[tuple[str, float]]:
    """Walk through a message to its numbers; stamps are no data."""
    if isinstance(value, bool | int | float | np.number):
        yield name, float(value)
    elif isinstance(value, list | tuple | np.ndarray):
        for place, item in enumerate(value):
            yield from _leaves(item, f"{name}[{place}]")
    elif hasattr(value, "__slots__") or hasattr(value, "__dict__"):
        fields = getattr(value, "__slots__", None) or vars(value)
        for one in fields:
            if one != "header" and not one.startswith("_"):
                yield from _leaves(getattr(value, one), f"{name}.{one}" if name else one)
