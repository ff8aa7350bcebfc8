"""Messages of ROS as columns: the topic that tells of an axis, one row a message.

A `sensor_msgs/msg/JointState` gives `joint.position`, `joint.velocity` and `joint.effort` of every joint; of any other
message every number becomes a column, named by its path in the message. Time is the stamp in the header, or else when
the message was logged.
Source: common_interfaces, sensor_msgs/msg/JointState: position in rad or m, velocity in rad/s or m/s, effort
in N.m or N.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cosim.data.columns import Columns
from cosim.data.limits import check_cells, check_columns, check_time, listed

JOINTS = ("position", "velocity", "effort")
NANO = 1e-9


@dataclass
class Topic:
    """Messages of one topic so far: times in ns, and one row of numbers each."""

    name: str
    kind: str
    times: list[int] = field(default_factory=list)
    rows: list[dict[str, float]] = field(default_factory=list)

    @property
    def tells_an_axis(self) -> tuple[bool, int]:
        """Rank among topics: joint states first, then the one with most numbers."""
        return self.kind.endswith("JointState"), sum(map(len, self.rows[:1])) * len(self.rows)


def columns_of(path: Path, messages: Iterable[tuple[str, str, int, Any]], release: str = "ROS 2") -> Columns:
    """Make columns of messages, each (topic, type, time it was logged in ns, decoded message); `release` wrote them."""
    topics: dict[str, Topic] = {}
    for name, kind, logged, message in messages:
        topic = topics.setdefault(name, Topic(name, kind))
        topic.times.append(_stamp(message) or logged)
        topic.rows.append(dict(_numbers(message, kind)))
        check_cells(path, len(topic.rows), len(topic.rows[-1]) + 1)
        check_time(path)
    chosen = max(topics.values(), key=lambda topic: topic.tells_an_axis, default=None)
    if chosen is None or not any(chosen.rows):
        return Columns({})
    others = tuple(sorted(set(topics) - {chosen.name}))
    notes = (f"{path.stem}: of its topics {chosen.name} was read; left out: {listed(others)}.",) if others else ()
    return _table(path, chosen, notes, release)


def _table(path: Path, topic: Topic, notes: tuple[str, ...], release: str) -> Columns:
    names = dict.fromkeys(name for row in topic.rows for name in row)
    check_columns(path, len(names))
    times = np.array(topic.times, dtype=np.int64)
    table = {"t": (times - times[0]) * NANO}
    table |= {name: np.array([row.get(name, np.nan) for row in topic.rows]) for name in names}
    start = str(np.datetime64(int(times[0]) // 1_000_000, "ms")) if times[0] > 10**18 else ""
    return Columns(table, {"t": "s"}, format=f"{release} {topic.kind.split('/')[-1]}", start=start, notes=notes)


def _stamp(message: Any) -> int:
    """Return the stamp of a message in ns, 0 where it has none."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    return int(stamp.sec) * 10**9 + int(stamp.nanosec) if stamp is not None else 0


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
