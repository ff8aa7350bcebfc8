"""From the bytes of a file to text: compression, byte order marks and code pages."""

import codecs
import gzip
import re
from pathlib import Path

from cosim.data.limits import check_text, check_time, check_unpacked
from cosim.support.errors import RecordingError

CHUNK = 1 << 22
"""Bytes that are unpacked at a time."""
HEAD = 1 << 16
"""Bytes from which the code page is judged."""
MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}


def text_of(path: Path, encoding: str = "") -> tuple[bytes, str]:
    """Read a text file, unpacked if it is a .gz.

    Args:
        path: the file.
        encoding: its code page, if it was stated; else it is recognised: a byte order mark, UTF-16 without one,
            UTF-8, and cp1252 for what is none of these.

    Returns:
        The text as UTF-8 with lines that end in a line feed, and the name of the encoding.

    Raises:
        RecordingError: it is too long, no text, or not of the stated encoding.
    """
    if path.suffix.lower() == ".gz":
        raw = _unpacked(path)
    else:
        check_text(path, path.stat().st_size)
        raw = path.read_bytes()
    mark = next((mark for mark in MARKS if raw.startswith(mark)), b"")
    name = encoding or MARKS.get(mark) or _guessed(path, raw[:HEAD])
    data = raw[len(mark) :] if mark else raw
    if name != "utf-8":
        data = _decoded(path, data, name).encode()
    if (place := data.find(b"\0")) >= 0:
        text = f"{path} holds a zero byte at byte {place + 1:,}: it was not written to its end, or is no text."
        raise RecordingError(text, culprit=str(path), value=place)
    return _lines(data), name


def _lines(data: bytes) -> bytes:
    """End lines with a line feed where some end with a carriage return alone, or with two of them."""
    if b"\r" not in data or data.count(b"\r") == data.count(b"\r\n"):
        return data
    return re.sub(rb"\r+\n|\r", b"\n", data)


def _unpacked(path: Path) -> bytes:
    chunks, size = [], 0
    with gzip.open(path) as file:
        while chunk := file.read(CHUNK):
            chunks.append(chunk)
            size += len(chunk)
            check_text(path, size)
            check_unpacked(path, size)
            check_time(path)
    return b"".join(chunks)


def _guessed(path: Path, head: bytes) -> str:
    """Judge the head of a text without a byte order mark."""
    for name, zeros in (("utf-16-le", head[1::2]), ("utf-16-be", head[::2])):
        if zeros.count(0) > 0.4 * len(zeros):
            return name
    if len(head) > 8 and sum(byte < 9 or 13 < byte < 32 for byte in head) > 0.1 * len(head):
        raise RecordingError(f"{path} is no text: it holds bytes that no text has.", culprit=str(path))
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def _decoded(path: Path, data: bytes, encoding: str) -> str:
    try:
        return data.decode(encoding)
    except LookupError:
        text = f'"{encoding}" is no encoding; for example: utf-8, cp1252, utf-16, latin-1.'
        raise RecordingError(text, culprit="encoding", value=encoding) from None
    except UnicodeDecodeError as error:
        if encoding == "cp1252":
            return data.decode("latin-1")
        text = (
            f"{path} is no {encoding} at byte {error.start:,}; --layout encoding=cp1252 (or another) says what it is."
        )
        raise RecordingError(text, culprit=str(path), value=encoding) from None
