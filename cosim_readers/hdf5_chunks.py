"""Chunks of HDF5: judged before the library unpacks them, for it takes as much memory as a packed chunk says.

The library asks neither whether a chunk of 8 kB unpacks to 40 GB nor whether one that was never written has 8 GB, and
what it began cannot be stopped.
"""

import zlib
from collections.abc import Iterator
from math import ceil, prod
from pathlib import Path
from typing import Any

from cosim.data.limits import check_time, check_unpacked, short
from cosim.support.errors import RecordingError

DEFLATE, SHUFFLE, FLETCHER, SZIP, NBIT, SCALE, LZF = 1, 2, 3, 4, 5, 6, 32000
NAMES = {SZIP: "szip", NBIT: "nbit", SCALE: "scaleoffset", LZF: "lzf"}
"""Filters of the library and of h5py by the numbers that files name them by."""
PACKING = {DEFLATE: 1032, LZF: 90, SZIP: 0, NBIT: 0, SCALE: 0}
"""Bytes, at most, that a byte becomes; 0: the packed chunk or the file states what it becomes."""
CHECKSUM = 4
"""Bytes that Fletcher's checksum adds to a chunk."""
HARMLESS = 50_000_000
"""Bytes that a chunk may unpack to before it is unpacked for trial."""
RUN, LONG = 32, 7 << 5
"""Of LZF: a byte below 32 announces so many bytes and one more; from 224 on the length goes on in the next byte."""
CELLS, CHUNKS = 1 << 22, 1 << 13
"""Numbers, and chunks, that are read between two looks at the clock; a chunk takes some 10 to 40 us."""


def check_chunks(path: Path, name: str, item: Any) -> None:
    """Refuse a dataset whose chunks are larger, or unpack to more, than they may (RecordingError)."""
    if not item.chunks:
        return
    size = prod(item.chunks) * item.dtype.itemsize
    check_unpacked(path, size, f'a chunk of "{short(name)}"')
    filters = _filters(path, name, item)
    packing = next((code for code in filters if code in PACKING), 0)
    if packing:
        item.id.chunk_iter(lambda chunk: _check_chunk(path, name, item, chunk, packing, filters, size))


def _filters(path: Path, name: str, item: Any) -> list[int]:
    """Return the filters of a dataset; refuse what is unknown, packed twice, or states other sizes than its own."""
    plan, cells = item.id.get_create_plist(), prod(item.chunks)
    filters = [plan.get_filter(place) for place in range(plan.get_nfilters())]
    codes = [code for code, _, _, _ in filters]
    unknown = next((code for code in codes if code not in (*PACKING, SHUFFLE, FLETCHER)), 0)
    if unknown:
        raise _bad(path, name, f"is packed by a filter that is not known ({unknown}); h5repack -f GZIP=4 packs it anew")
    if sum(code in PACKING for code in codes) > 1:
        raise _bad(path, name, "is packed twice; h5repack -f GZIP=4 packs it once")
    for code, _, values, _ in filters:
        stated = values[2:5:2]  # both filters have them there: numbers of a chunk, and bytes of one
        if code in (NBIT, SCALE) and stated != (cells, item.dtype.itemsize):
            text = f"{stated[0]:,} numbers of {stated[1]} bytes by its filter {NAMES[code]}"
            raise _bad(path, name, f"has chunks of {cells:,} numbers of {item.dtype.itemsize} bytes, and {text}")
    return codes


def _check_chunk(path: Path, name: str, item: Any, chunk: Any, packing: int, filters: list[int], size: int) -> None:
    """Refuse a packed chunk that becomes more than it is said to be."""
    check_time(path)
    most, place = size + CHECKSUM, filters.index(packing)
    if chunk.filter_mask >> place & 1:  # this one was left as it is
        return
    if packing in (DEFLATE, LZF) and chunk.size * PACKING[packing] <= max(HARMLESS, most):
        return
    _, raw = item.id.read_direct_chunk(chunk.chunk_offset)
    raw = raw[:-CHECKSUM] if FLETCHER in filters[place + 1 :] else raw
    if packing == DEFLATE:
        unpacked = len(zlib.decompressobj().decompress(raw, most + 1))
    elif packing == LZF:
        unpacked = _unpacked_lzf(path, raw)
    else:
        unpacked = int.from_bytes(raw[:CHECKSUM], "little") if packing == SZIP else 0
    if unpacked > most:
        raise _bad(path, name, f"has a chunk that unpacks to more than the {size:,} bytes of a chunk")


def _unpacked_lzf(path: Path, raw: bytes) -> int:
    """Count the bytes that LZF makes of a chunk."""
    place = unpacked = 0
    while place < len(raw):
        head = raw[place]
        if head < RUN:
            unpacked += head + 1
            place += head + 2
        else:
            long = head >= LONG
            unpacked += 2 + (head >> 5) + (raw[place + 1] if long and place + 1 < len(raw) else 0)
            place += 2 + long
        if not place % CHUNKS:
            check_time(path)
    return unpacked


def _bad(path: Path, name: str, what: str) -> RecordingError:
    return RecordingError(f'{path}: "{short(name)}" {what}.', culprit=str(path), value=name)


def pieces(item: Any) -> Iterator[tuple[slice, ...] | tuple[()]]:
    """Cut a dataset into pieces along its longest side, whole chunks each, that are read in a moment."""
    shape = item.shape
    if not shape or not item.size:
        yield ()
        return
    side = max(range(len(shape)), key=lambda place: shape[place])
    chunk = item.chunks[side] if item.chunks else 1
    across = item.size // shape[side]
    others = (
        prod(ceil(n / c) for n, c in zip(shape, item.chunks, strict=True)) / ceil(shape[side] / chunk)
        if item.chunks
        else 0
    )
    chunks = min(max(1, CELLS // (across * chunk)), max(1, int(CHUNKS // others)) if others else CELLS)
    for first in range(0, shape[side], chunks * chunk):
        yield tuple(
            slice(first, first + chunks * chunk) if place == side else slice(None) for place in range(len(shape))
        )
