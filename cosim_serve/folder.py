"""Reading in folders of jobs: plain files and real folders only.

A link leads elsewhere, and a pipe or a device may never end.
"""

import os
import stat
from collections.abc import Iterable
from pathlib import Path

CLOSED = 0o700
"""Mode of the folders that are made here: recordings are nobody else's business."""


def check_plain(folders: Iterable[Path], files: Iterable[Path]) -> None:
    """Refuse what is there and is no folder, or no plain file (ValueError names it)."""
    for paths, is_right, what in ((folders, stat.S_ISDIR, "folder"), (files, stat.S_ISREG, "plain file")):
        for path in paths:
            if os.path.lexists(path) and not is_right(path.lstat().st_mode):
                raise ValueError(f"{path.name} is {'a link' if path.is_symlink() else f'no {what}'}")


def read_plain(path: Path, most: int) -> bytes:
    """Return the content of a plain file (ValueError: it is none, or has more bytes than `most`; OSError)."""
    check_plain((), (path,))
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
    with os.fdopen(handle, "rb") as file:
        if os.fstat(handle).st_size > most:
            raise ValueError(f"{path.name} has more than {most:,} bytes")
        return file.read(most)


def plain_files(folder: Path) -> dict[str, Path]:
    """Return the plain files of a folder by name; none where it is missing, or a link."""
    if folder.is_symlink() or not folder.is_dir():
        return {}
    return {one.name: one for one in folder.iterdir() if stat.S_ISREG(one.lstat().st_mode)}


def open_to(folder: Path) -> str:
    """Return who else may enter a folder: "everybody", "its group"; "" for nobody."""
    mode = folder.stat().st_mode if os.name == "posix" else 0
    return "everybody" if mode & 0o007 else "its group" if mode & 0o070 else ""
