"""MCAP files that cost more than they hold; each maker says in a sentence what it does."""

import io
import struct
from collections.abc import Callable
from pathlib import Path
from random import Random

from mcap.writer import CompressionType, Writer

Maker = Callable[[Random, Path], None]


def _mcap(path: Path, messages: list[bytes], definition: bytes = b"float64[] x", packing: str = "ZSTD") -> None:
    """Write an MCAP."""
    out = io.BytesIO()
    writer = Writer(out, compression=CompressionType[packing], chunk_size=1 << 30)
    writer.start()
    schema = writer.register_schema(name="a/msg/B", encoding="ros2msg", data=definition)
    channel = writer.register_channel(topic="/x", message_encoding="cdr", schema_id=schema)
    for number, data in enumerate(messages):
        writer.add_message(channel_id=channel, log_time=number * 10**7, publish_time=0, data=data)
    writer.finish()
    path.write_bytes(out.getvalue())


def _zeros(count: int) -> bytes:
    return b"\0\1\0\0" + struct.pack("<I", count) + bytes(4) + bytes(8 * count)


def wide_message(dice: Random, path: Path) -> None:
    """One message of millions of zeros, packed."""
    _mcap(path, [_zeros(dice.choice([10**5, 10**6, 6 * 10**6]))], packing=dice.choice(["ZSTD", "LZ4"]))


def wide_messages(dice: Random, path: Path) -> None:
    """Thousands of messages of ten thousand zeros each, packed."""
    _mcap(path, [_zeros(9_000)] * dice.choice([500, 2500]))


def large_text(dice: Random, path: Path) -> None:
    """Messages that hold a text of a megabyte each, packed."""
    text = struct.pack("<I", 10**6 + 1) + b"a" * 10**6 + b"\0"
    _mcap(path, [b"\0\1\0\0" + text] * 100, b"string x")


def array_that_claims_more(dice: Random, path: Path) -> None:
    """An array that claims four thousand million numbers."""
    _mcap(path, [b"\0\1\0\0" + struct.pack("<I", 2**32 - 1) + bytes(100)] * 3)


def many_strings(dice: Random, path: Path) -> None:
    """Arrays of ten million empty texts, packed."""
    _mcap(path, [b"\0\1\0\0" + struct.pack("<I", 5 * 10**6) + struct.pack("<II", 1, 0) * 5 * 10**6], b"string[] x")


def nested_definition(dice: Random, path: Path) -> None:
    """A type that holds itself, or a hundred thousand members."""
    line = b"=" * 80
    endless = b"a/B x\n" + line + b"\nMSG: a/B\na/B y\n"
    _mcap(
        path,
        [b"\0\1\0\0" + bytes(100)] * 3,
        dice.choice([endless, b"".join(b"float64 f%d\n" % k for k in range(10**5))]),
    )


MAKERS = (
    wide_message, wide_messages, large_text, array_that_claims_more, many_strings, nested_definition,
)  # fmt: skip
KINDS = {"mcap": (".mcap", MAKERS)}
