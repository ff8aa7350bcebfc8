"""Bags of ROS 2 in SQLite that cost more than they hold; each maker says in a sentence what it does."""

import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from random import Random

Maker = Callable[[Random, Path], None]
JOINT = "sensor_msgs/msg/JointState"
COUNTED = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c)"
"""A table without end."""


def state(number: int) -> bytes:
    """A JointState as CDR: stamp, no frame, one joint with position and effort."""
    out = b"\0\1\0\0" + struct.pack("<iI", number // 100, number % 100 * 10_000_000) + struct.pack("<I", 1) + b"\0"
    out += bytes(-(len(out) - 4) % 4) + struct.pack("<II", 1, 2) + b"a\0"
    for values in ((number * 1e-3,), (), (0.5 * (number % 20),)):
        out += bytes(-(len(out) - 4) % 4) + struct.pack("<I", len(values))
        out += (bytes(-(len(out) - 4) % 8) if values else b"") + struct.pack(f"<{len(values)}d", *values)
    return out


def written(path: Path, script: str, rows: int = 200) -> None:
    """Write a bag with joint states, whose tables a script then changes."""
    path.unlink(missing_ok=True)
    with closing(sqlite3.connect(path)) as bag:
        bag.executescript("CREATE TABLE topics(id INTEGER, name TEXT, type TEXT);")
        bag.execute("INSERT INTO topics VALUES (1, '/joints', ?)", (JOINT,))
        bag.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
        made = [(1, 10**9 + number * 10**7, state(number)) for number in range(rows)]
        bag.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", made)
        bag.executescript(script)
        bag.commit()


def plain_bag(dice: Random, path: Path) -> None:
    """Nothing wrong."""
    written(path, "")


def endless_messages(dice: Random, path: Path) -> None:
    """Messages are a view without end."""
    wide = dice.choice(["zeroblob(100)", "x", "randomblob(1000)"])
    view = f"CREATE VIEW messages AS {COUNTED} SELECT 1 AS topic_id, x AS timestamp, {wide} AS data FROM c;"
    written(path, f"DROP TABLE messages; {view}")


def endless_topics(dice: Random, path: Path) -> None:
    """Topics are a view without end."""
    view = f"CREATE VIEW topics AS {COUNTED} SELECT x AS id, '/' || x AS name, '{JOINT}' AS type FROM c;"
    written(path, f"DROP TABLE topics; {view}")


def endless_definitions(dice: Random, path: Path) -> None:
    """Definitions of messages are a view without end, which the list of tables calls a table."""
    columns = "x AS topic_type, 'ros2msg' AS encoding, hex(zeroblob(1000)) AS encoded_message_definition"
    script = f"CREATE VIEW message_definitions AS {COUNTED} SELECT {columns} FROM c; PRAGMA writable_schema = ON;"
    written(path, f"{script} UPDATE sqlite_master SET type = 'table' WHERE name = 'message_definitions';")


def joined_with_itself(dice: Random, path: Path) -> None:
    """Messages are a view of a table joined with itself four times."""
    among = ", ".join(f"kept AS k{number}" for number in range(4))
    script = f"ALTER TABLE messages RENAME TO kept; CREATE VIEW messages AS SELECT k0.* FROM {among};"
    written(path, script)


def computed_column(dice: Random, path: Path) -> None:
    """The bytes of a message are computed: a hundred million zeros each."""
    size = dice.choice([10**7, 10**8, 9 * 10**8])
    script = "DROP TABLE messages; CREATE TABLE messages(topic_id INTEGER, timestamp INTEGER,"
    many = "".join(f"INSERT INTO messages VALUES (1, {number});" for number in range(300))
    written(path, f"{script} data BLOB GENERATED ALWAYS AS (zeroblob({size}))); {many}")


def doubled_column(dice: Random, path: Path) -> None:
    """The bytes of a message are those of another column, doubled 24 times."""
    doubled = ", ".join(f"c{number + 1} TEXT AS (c{number} || c{number})" for number in range(23))
    script = f"DROP TABLE messages; CREATE TABLE messages(topic_id INTEGER, timestamp INTEGER, c0 TEXT, {doubled},"
    written(path, f"{script} data TEXT AS (c23 || c23)); INSERT INTO messages VALUES (1, 1, 'xy'), (1, 2, 'xy');")


def large_message(dice: Random, path: Path) -> None:
    """One message of joint states of 30 MB."""
    count = 4_000_000
    written(path, "")
    data = b"\0\1\0\0" + bytes(8) + struct.pack("<I", 1) + bytes(4) + struct.pack("<II", 0, count) + bytes(8 * count)
    with closing(sqlite3.connect(path)) as bag:
        bag.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (1, 5, ?)", (data,))
        bag.commit()


def many_messages(dice: Random, path: Path) -> None:
    """A million messages that hold nothing."""
    written(path, f"{COUNTED} INSERT INTO messages(topic_id, timestamp, data) SELECT 1, x, x'00' FROM c LIMIT 1000000;")


MAKERS = (
    plain_bag, endless_messages, endless_topics, endless_definitions, joined_with_itself, computed_column,
    doubled_column, large_message, many_messages,
)  # fmt: skip
KINDS = {"bag": (".db3", MAKERS)}
