"""MCAP with messages of ROS 2, as `ros2 bag record -s mcap` writes them."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cosim.data.binary.messages import columns_of
from cosim.data.binary.packages import package
from cosim.data.columns import Columns
from cosim.data.limits import check_text


def read(path: Path) -> Columns:
    """Read the topic of an MCAP file that tells of an axis."""
    check_text(path, path.stat().st_size)
    reader = package("mcap.reader", "mcap", path)
    decoder = package("mcap_ros2.decoder", "mcap", path)
    return columns_of(path, _messages(path, reader, decoder))


def _messages(path: Path, reader: Any, decoder: Any) -> Iterator[tuple[str, str, int, Any]]:
    with path.open("rb") as file:
        opened = reader.make_reader(file, decoder_factories=[decoder.DecoderFactory()])
        publishers: dict[str, list[int]] = {}
        for schema, channel, message, decoded in opened.iter_decoded_messages():
            known = publishers.setdefault(channel.topic, [channel.id])
            if channel.id not in known:
                known.append(channel.id)
            number = known.index(channel.id) + 1
            topic = f"{channel.topic} (#{number})" if number > 1 else channel.topic
            yield topic, schema.name if schema else "", message.log_time, decoded
