"""Bags of ROS 2 in SQLite, `x_0.db3`: messages of known types, or of types that the bag itself defines.

Bags of ROS 2 Iron and later hold the definitions of their messages; of older ones only joint states are read.
Source: rosbag2_storage_sqlite3, tables `topics`, `messages` and `message_definitions`.
"""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

from cosim.data.binary.messages import columns_of
from cosim.data.binary.packages import package
from cosim.data.columns import Columns
from cosim.data.limits import check_text
from cosim.support.errors import RecordingError

LINE = "=" * 80
JOINT_STATE = f"""std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{LINE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{LINE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def read(path: Path) -> Columns:
    """Read the topic of a bag that tells of an axis."""
    check_text(path, path.stat().st_size)
    records = package("mcap.records", "mcap", path)
    decoder = package("mcap_ros2.decoder", "mcap", path).DecoderFactory()
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as bag:
        definitions = _definitions(bag)
        topics = bag.execute("SELECT id, name, type FROM topics").fetchall()
        decoders: dict[int, tuple[str, str, Callable[[bytes], Any]]] = {}
        for number, (key, name, kind) in enumerate(topics, 1):
            if kind in definitions:
                schema = records.Schema(id=number, name=kind, encoding="ros2msg", data=definitions[kind].encode())
                decoders[key] = name, kind, decoder.decoder_for("cdr", schema)
        _check(path, decoders, [kind for _, _, kind in topics])
        return columns_of(path, _messages(bag, decoders))


def _definitions(bag: sqlite3.Connection) -> dict[str, str]:
    """Return the definitions of the types of messages that are known."""
    known = {"sensor_msgs/msg/JointState": JOINT_STATE}
    tables = [name for (name,) in bag.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
    if "message_definitions" in tables:
        rows = bag.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
        known |= {kind: text for kind, encoding, text in rows if encoding == "ros2msg" and text}
    return known


def _check(path: Path, decoders: dict[int, Any], kinds: list[str]) -> None:
    if not decoders:
        text = (
            f"{path} defines none of its messages ({', '.join(sorted(set(kinds))[:5])}) and holds no JointState; "
            "convert it with ros2 bag convert to MCAP, which does."
        )
        raise RecordingError(text, culprit=str(path))


def _messages(bag: sqlite3.Connection, decoders: dict[int, Any]) -> Iterator[tuple[str, str, int, Any]]:
    for key, stamp, data in bag.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp"):
        if key in decoders:
            name, kind, decode = decoders[key]
            yield name, kind, int(stamp), decode(data)
