"""Bags of ROS 2 in SQLite, `x_0.db3`: messages of known types, or of types that the bag itself defines.

Bags of ROS 2 Iron and later hold the definitions of their messages; of older ones only joint states are read.
Source: rosbag2_storage_sqlite3, tables `topics`, `messages` and `message_definitions`.
"""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from cosim.data.columns import Columns
from cosim.data.limits import allowance, check_text, is_late, over_time
from cosim.support.errors import RecordingError
from cosim_readers.messages import Message, columns_of
from cosim_readers.package import package

LINE = "=" * 80
TABLES = ("topics", "messages", "message_definitions")
GENERATED = (2, 3)
"""What SQLite calls a column that is computed, when it is read or when it is written."""
STEPS = 100_000
"""Steps of SQLite's machine between two looks at the time: some ms."""
LONGEST = 1_000_000_000
"""Bytes of a text or of a blob that SQLite knows at all."""
FORBIDDEN = ("prohibited", "not authorized", "unsafe use of")
"""What SQLite says of what it is not allowed to do."""
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
    with _opened(path) as bag:
        definitions = _definitions(bag)
        topics = bag.execute("SELECT id, name, type FROM topics").fetchall()
        decoders: dict[int, tuple[str, str, Callable[[bytes], Any]]] = {}
        for number, (key, name, kind) in enumerate(topics, 1):
            if kind in definitions:
                schema = records.Schema(id=number, name=kind, encoding="ros2msg", data=definitions[kind].encode())
                decoders[key] = name, kind, decoder.decoder_for("cdr", schema)
        if not decoders:
            kinds = ", ".join(sorted({kind for _, _, kind in topics})[:5])
            text = f"{path} defines none of its messages ({kinds}) and holds no JointState"
            raise RecordingError(f"{text}; convert it with ros2 bag convert to MCAP, which does.", culprit=str(path))
        return columns_of(path, _messages(bag, decoders))


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    """Open a database of which only plain tables are read, within what reading may cost.

    A view, a generated column or a recursion is a program: a few kB of it run for ever, or make rows without end.

    Raises:
        RecordingError: something else is read there, it takes too long, or it is no database.
    """
    allowed = allowance(path)
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as bag:
        bag.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, int(min(allowed.unpacked, LONGEST)))
        bag.execute("PRAGMA trusted_schema = OFF")
        columns = [one for table in TABLES for one in bag.execute(f"PRAGMA table_xinfo({table})")]
        if any(kind in GENERATED for *_, kind in columns):
            raise _computed(path)
        bag.set_progress_handler(lambda: is_late(allowed), STEPS)
        bag.set_authorizer(_permission)
        try:
            yield bag
        except sqlite3.Error as error:
            if is_late(allowed):
                raise over_time(path) from None
            if any(word in str(error) for word in FORBIDDEN):
                raise _computed(path) from error
            raise


def _computed(path: Path) -> RecordingError:
    text = f"{path}: a table of it is computed (a view, a function, a recursion); those of a bag are plain"
    return RecordingError(f"{text}. Convert it with ros2 bag convert.", culprit=str(path))


def _permission(action: int, table: str | None, column: str | None, database: str | None, inside: str | None) -> int:
    """Say whether SQLite may do something: read columns of tables, not of what a view or a trigger refers to."""
    plain = action in (sqlite3.SQLITE_SELECT, sqlite3.SQLITE_READ) and inside is None
    return sqlite3.SQLITE_OK if plain else sqlite3.SQLITE_DENY


def _definitions(bag: sqlite3.Connection) -> dict[str, str]:
    """Return the definitions of the types of messages that are known."""
    known = {"sensor_msgs/msg/JointState": JOINT_STATE}
    tables = [name for (name,) in bag.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
    if "message_definitions" in tables:
        rows = bag.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
        known |= {kind: text for kind, encoding, text in rows if encoding == "ros2msg" and text}
    return known


def _messages(bag: sqlite3.Connection, decoders: dict[int, Any]) -> Iterator[Message]:
    """Walk through the messages by their times; what is sorted are their numbers, not their bytes."""
    for (row,) in bag.execute("SELECT rowid FROM messages ORDER BY timestamp").fetchall():
        found = bag.execute("SELECT topic_id, timestamp, data FROM messages WHERE rowid = ?", (row,))
        for key, stamp, data in found:
            if key in decoders:
                name, kind, decode = decoders[key]
                yield Message(name, kind, int(stamp), len(data), partial(decode, data))
