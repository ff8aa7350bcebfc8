"""Universal ("fat") Mach-O files: libraries of several processors in one file, of which macOS takes its own."""

import struct

_MAGIC, _MACH_O_64 = 0xCAFEBABE, 0xFEEDFACF
_ALIGNMENT = 14
"""Slices start at multiples of 2^14 bytes, the page of Apple's ARM processors."""


def universal_binary(slices: list[bytes]) -> bytes:
    """Join 64-bit Mach-O libraries, one a processor, into one universal file.

    Layout: a header in big-endian order (magic, count; per slice processor, subtype, offset, size, alignment), then
    the slices, untouched, so that their signatures stay valid. Reference: `mach-o/fat.h` of macOS.
    Raises ValueError if one of them is no 64-bit Mach-O file.
    """
    header = struct.pack(">2I", _MAGIC, len(slices))
    offset, body = _aligned(len(header) + 20 * len(slices)), b""
    first = offset
    for content in slices:
        magic, processor, subtype = struct.unpack_from("<3I", content.ljust(12, b"\0"))
        if magic != _MACH_O_64:
            raise ValueError(f"no 64-bit Mach-O file: it starts with {content[:4].hex()}")
        header += struct.pack(">5I", processor, subtype, offset, len(content), _ALIGNMENT)
        body = body.ljust(offset - first, b"\0") + content
        offset = _aligned(offset + len(content))
    return header.ljust(first, b"\0") + body


def _aligned(offset: int) -> int:
    return -(-offset >> _ALIGNMENT) << _ALIGNMENT
