"""MCAP with messages of ROS 2, as `ros2 bag record -s mcap` writes them."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from cosim.data.columns import Columns
from cosim.data.limits import check_text, check_unpacked, short
from cosim_readers.messages import Message, columns_of
from cosim_readers.package import package


def read(path: Path) -> Columns:
    """Read the topic of an MCAP file that tells of an axis."""
    check_text(path, path.stat().st_size)
    reader = package("mcap.reader", "mcap", path)
    decoder = package("mcap_ros2.decoder", "mcap", path)
    return columns_of(path, _messages(path, reader, decoder))


def _messages(path: Path, reader: Any, decoder: Any) -> Iterator[Message]:
    factory = decoder.DecoderFactory()
    with path.open("rb") as file:
        opened = reader.make_reader(file)
        summary = opened.get_summary()
        for chunk in summary.chunk_indexes if summary else ():
            check_unpacked(path, chunk.uncompressed_size, "a chunk")
        publishers: dict[str, list[int]] = {}
        for schema, channel, message in opened.iter_messages():
            known = publishers.setdefault(channel.topic, [channel.id])
            if channel.id not in known:
                known.append(channel.id)
            number = known.index(channel.id) + 1
            topic = f"{channel.topic} (#{number})" if number > 1 else channel.topic
            decode = factory.decoder_for(channel.message_encoding, schema)
            if decode is None:
                encoding = (
                    f"as {channel.message_encoding or '?'} by a schema of {schema.encoding if schema else 'none'}"
                )
                rule = "messages of ROS 2 (cdr, by ros2msg) are read"
                raise ValueError(f'"{short(channel.topic)}" is encoded {encoding}; {rule}')
            kind = schema.name if schema else ""
            yield Message(topic, kind, message.log_time, len(message.data), partial(decode, message.data))
