"""The black box: a file of a header and a ring of records that a killed process leaves readable.

Header (4096 bytes): a line that names the format, a line of JSON that says where the records come from. Records are
those of hardware.h. A record counts if its sequence number stands where it belongs and its CRC fits.
"""

import json
import mmap
import os
import zlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from cosim.data.recording import Recording
from cosim.hardware.library import shared
from cosim.hardware.story import seal_of
from cosim.hardware.structures import HEADS, INPUTS, RECORD, CBox, CRecord
from cosim.support.errors import HardwareError
from cosim.support.files import check_free, check_room, directory
from cosim.support.plain import Parsed

MAGIC = b"mount-cosim black box 1\n"
HEADER = 65_536
_BODY = slice(CRecord.sample.offset, CRecord.crc.offset)


class BlackBox:
    """A black box that a session writes; `box` is what the C loop sees of it."""

    def __init__(self, path: Path, capacity: int, origin: Mapping[str, Any], force: bool = False) -> None:
        check_free(path, force)
        directory(path.parent)
        size = HEADER + capacity * RECORD.itemsize
        check_room(path, size, "let the black box keep fewer seconds (black_box_seconds)")
        head = MAGIC + json.dumps(dict(origin) | {"capacity": capacity}).encode() + b"\n"
        if len(head) > HEADER:
            raise HardwareError(f"{path}: what the scenario says of itself is longer than {HEADER} bytes.")
        partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
        try:
            with partial.open("w+b") as file:
                _reserve(file.fileno(), size)
                file.write(head.ljust(HEADER, b"\n"))
                file.flush()
                self._map = mmap.mmap(file.fileno(), size)
            os.replace(partial, path)
        finally:
            partial.unlink(missing_ok=True)
        self.path, self._drained = path, 0
        self._records = np.frombuffer(self._map, RECORD, capacity, HEADER)
        self.box = shared(CBox(record=self._records.ctypes.data, capacity=capacity))

    def drain(self) -> np.ndarray:
        """Return a copy of the whole records since the last call, while the loop goes on writing.

        Those that the ring has overwritten meanwhile are missing: their sequence numbers do not follow each other.
        """
        newest, capacity = self.box.written, self.box.capacity
        numbers = np.arange(max(self._drained, newest - capacity + capacity // 16), newest)
        found: np.ndarray = self._records[numbers % capacity]
        found = found[found["sequence"] == numbers + 1]
        self._drained = int(found["sequence"][-1]) if len(found) else self._drained
        return found

    def close(self) -> None:
        """Let go of the file; its records are in it already."""
        self._map.flush()
        del self._records
        with suppress(BufferError):  # somebody still looks at the records
            self._map.close()


def _reserve(file: int, size: int) -> None:
    """Give a file its size, with room on the disk: writing to mapped memory for which there is none is a crash."""
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(file, 0, size)
    else:
        os.ftruncate(file, size)


@dataclass(frozen=True)
class Kept:
    """What a black box holds: whole records in their order, how many are torn, and where they come from.

    The one record that was being overwritten when its process ended is not counted as torn.
    """

    records: np.ndarray
    torn: int
    origin: Parsed


def read_black_box(path: Path) -> Kept:
    """Read a black box, also one whose process was killed.

    Raises:
        HardwareError: the file is no black box.
    """
    raw = path.read_bytes() if path.is_file() else b""
    if not raw.startswith(MAGIC) or len(raw) < HEADER:
        raise HardwareError(f"{path} is no black box of this version.", culprit=str(path))
    origin = _head(raw, path)
    records = np.frombuffer(raw, RECORD, origin["capacity"], HEADER)
    numbers = records["sequence"]
    place = np.arange(len(records)) + 1
    written = numbers > 0
    whole = written & ((numbers - place.astype(np.uint64)) % np.uint64(len(records)) == 0)
    whole[whole] = [zlib.crc32(one.tobytes()[_BODY]) == one["crc"] for one in records[whole]]
    newest = int(numbers[whole].max(initial=0))
    oldest = newest % len(records)
    expected = newest if newest < len(records) else len(records) - (0 if whole[oldest] else 1)
    kept = records[whole & (numbers.astype(np.int64) > newest - len(records))]
    return Kept(kept[np.argsort(kept["sequence"])], expected - len(kept), origin)


def _head(raw: bytes, path: Path) -> Parsed:
    """Read the line that says where the records come from, and how many there is room for."""
    try:
        origin = json.loads(raw[len(MAGIC) : HEADER].partition(b"\n")[0])
        capacity = origin["capacity"]
        fits = type(capacity) is int and capacity > 0 and len(raw) == HEADER + capacity * RECORD.itemsize
        fits = fits and _is_whole(origin)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        fits = False
    if not fits:
        raise HardwareError(f"{path} is a black box whose head is damaged, or that is cut short.", culprit=str(path))
    return dict(origin)


def _is_whole(origin: Parsed) -> bool:
    """Whether a head has what a recording needs of it (KeyError, TypeError or AttributeError: no)."""
    inputs, units, numbers = origin["inputs"], origin["units"], (origin["step"], origin["quantum"])
    named = type(inputs) is list and len(inputs) <= INPUTS and all(type(one) is str for one in inputs)
    scaled = all(type(one) is float and isfinite(one) and one > 0 for one in numbers)
    said = all(type(one) is str for one in (origin["encoder"], *units.values()))
    return named and scaled and said and origin["machine"]["encoder"]["heads"] in (0, HEADS)


def recording_of(kept: Kept, name: str) -> Recording:
    """Return records as a recording: `tau` and `q` as everywhere, and every number that a replay needs.

    `tau` [N m] is the mean of the ordered torque over the sample interval centred at t, `q` [rad] is the encoder's.
    """
    records, origin = kept.records, kept.origin
    sample, feedback = records["sample"], records["sample"]["feedback"]
    acting = np.concatenate(([0.0], records["torque"][:-1]))
    before = np.concatenate(([0.0], acting[:-1]))
    table = {
        "t": sample["tick"] * origin["step"],
        "tau": (acting + before) / 2,
        "q": origin["quantum"] * unwrapped(feedback["counts"]),
    }
    places = {name: sample["input"][:, place] for place, name in enumerate(origin["inputs"])}
    table |= {name: column for name, column in places.items() if name != origin["encoder"]}
    table |= {f"machine.{key}": feedback[key] for key in ("counts", "encoder", "statusword", "torque", "link")}
    table |= {f"machine.{key}": sample[key] for key in ("tick", "read", "status", "late", "request", "change", "value")}
    table |= {f"machine.{key}": records[key] for key in ("state", "faults", "notes", "controlword")}
    if origin["machine"]["encoder"]["heads"]:
        table |= {f"machine.head{k}": feedback["head"][:, k] for k in range(HEADS)}
        table |= {"machine.heads": feedback["heads"], "machine.left_out": records["heads"]}
    table |= {"machine.command": records["command"], "machine.order": records["torque"]}
    units = {"t": "s", "tau": "N.m", "q": "rad", "machine.command": "N.m", "machine.order": "N.m"}
    units |= {name: unit for name, unit in origin["units"].items() if name in table and unit}
    columns = {key: np.ascontiguousarray(column, dtype=np.float64) for key, column in table.items()}
    return Recording(name, columns, units, {"hardware": origin, "torn": kept.torn, "seal": seal_of(columns, origin)})


def unwrapped(counts: np.ndarray) -> np.ndarray:
    """Return counts of 32 bits as a position that does not wrap, from the signed first one on."""
    steps = np.diff(counts.astype(np.uint32)).view(np.int32).astype(np.int64)
    first = counts[:1].astype(np.uint32).view(np.int32).astype(np.int64)
    return np.cumsum(np.concatenate((first, steps)))
