"""Zip archives that somebody else made: judged by their table of contents before a byte is unpacked, then unpacked.

What is refused could not be meant: names that lead elsewhere or that no file system takes, links, members under one
name, passwords, packings that are not known, and sizes that fill a disk. Sizes that lie are found while unpacking,
because no more is taken than the table promises.
"""

import os
import re
import stat
import zipfile
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path

MEMBERS = 100_000
"""Most members of an archive."""
LARGEST = 2**32
"""Bytes of all members together at most."""
BOMB, RATIO = 2**26, 200
"""From this size on (64 MiB) an archive whose members are more than 200 times as large as their packing is refused:
models and libraries pack 2 to 20 times, tables of zeros a thousand times."""
NAME, PART = 512, 255
"""Characters of a name, with the folder it is unpacked to still a path; bytes of one part of it on any file system."""
PACKINGS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError)
"""What `zipfile` raises where an archive is damaged, packed in a way it does not know, or has a password."""
PIECE = 2**20
_ENCRYPTED = 1
_FORBIDDEN = re.compile(r"[\x00-\x1f\x7f]")

Complaint = Callable[[str], Exception]
"""Makes an error from what is wrong with an archive: "it holds ..."."""


def contents(path: Path, error: Complaint) -> list[zipfile.ZipInfo]:
    """Return the members of an archive.

    Raises:
        what `error` makes: it is no archive, or holds what could not be meant.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
    except (*DAMAGED, OSError) as reason:
        raise error(
            "it is no zip archive" if "not a zip" in str(reason) else f"its zip archive is damaged: {_said(reason)}"
        ) from reason
    for member in members[:MEMBERS]:
        wrong = _wrong(member)
        if wrong:
            raise error(f'its member "{_shown(member.orig_filename)}" {wrong}')
    wrong = _wrong_together(members)
    if wrong:
        raise error(wrong)
    return members


def unpack(path: Path, folder: Path, wanted: Callable[[str], bool], error: Complaint) -> None:
    """Unpack the members of a judged archive whose names are wanted.

    Raises:
        what `error` makes: a member is damaged, or there is no room.
    """
    for member in contents(path, error):
        if wanted(member.filename):
            _unpack(path, member, folder / member.filename, error)


def read(path: Path, name: str, error: Complaint, most: int = LARGEST) -> bytes:
    """Return a member of a judged archive, of at most so many bytes.

    Raises:
        what `error` makes: it is larger, or damaged.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            if archive.getinfo(name).file_size > most:
                raise error(f'its member "{_shown(name)}" has more than {most >> 20} MiB')
            return archive.read(name)
    except DAMAGED as reason:
        raise error(f'its member "{_shown(name)}" is damaged: {_said(reason)}') from reason


def _unpack(path: Path, member: zipfile.ZipInfo, target: Path, error: Complaint) -> None:
    try:
        if member.is_dir():
            target.mkdir(parents=True, exist_ok=True)
            return
        target.parent.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(path) as archive, archive.open(member) as packed, target.open("wb") as file:
            while piece := packed.read(PIECE):
                file.write(piece)
        mode = (member.external_attr >> 16) & 0o777
        os.chmod(target, mode | stat.S_IRUSR | stat.S_IWUSR)
    except (*DAMAGED, OSError) as reason:
        raise error(f'its member "{_shown(member.filename)}" cannot be unpacked: {_said(reason)}') from reason


def _wrong(member: zipfile.ZipInfo) -> str:
    """Say what is wrong with a member; empty where nothing is."""
    name = member.orig_filename
    parts = name.rstrip("/").split("/")
    kind = stat.S_IFMT(member.external_attr >> 16)
    if name.startswith("/"):
        return "has an absolute name"
    if re.match(r"[A-Za-z]:", name) or "\\" in name:
        return "has a drive letter or a backslash in its name"
    if _FORBIDDEN.search(name) or not name:
        return "has a name with characters that no file has"
    if any(part in ("..", ".", "") for part in parts):
        return "has a name that leads elsewhere"
    if len(name) > NAME or any(len(part.encode("utf-8", "replace")) > PART for part in parts):
        return "has a name that is too long"
    if kind and kind not in (stat.S_IFREG, stat.S_IFDIR):
        return "is a link or a device, and only files and folders are unpacked"
    if member.flag_bits & _ENCRYPTED:
        return "has a password"
    if member.compress_type not in PACKINGS:
        return f"is packed in a way that is not known ({member.compress_type})"
    return ""


def _wrong_together(members: Sequence[zipfile.ZipInfo]) -> str:
    """Say what is wrong with all members together; empty where nothing is."""
    if len(members) > MEMBERS:
        return f"it holds {len(members):,} members, and {MEMBERS:,} are the most"
    size, packed = sum(one.file_size for one in members), sum(one.compress_size for one in members)
    if size > LARGEST:
        return f"its members have {size / 2**30:,.1f} GiB, and {LARGEST >> 30} are the most"
    if size > BOMB and size > RATIO * packed:
        return f"its members are {size / max(packed, 1):,.0f} times as large as their packing, and {RATIO} is the most"
    seen: dict[str, tuple[int, int]] = {}
    for one in members:
        held = (one.CRC, one.file_size)
        if seen.setdefault(one.filename, held) != held and not one.is_dir():  # packed twice is no harm
            return f'it holds two members "{_shown(one.filename)}"'
    return ""


def _shown(name: str) -> str:
    clean = _FORBIDDEN.sub("?", name)
    return clean if len(clean) <= 80 else f"{clean[:80]}..."


def _said(reason: BaseException) -> str:
    text = getattr(reason, "strerror", None) or str(reason) or type(reason).__name__
    return str(text).splitlines()[0].rstrip(".")
