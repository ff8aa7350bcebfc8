"""Folders for what lives as long as a command: removed at its end, or by a later command where it was killed.

SIGKILL leaves nobody to tidy up. Whoever makes a folder here holds a lock on it (flock, which ends with the process and
holds across containers that share the folder); the first folder of a process removes those that nobody holds any more.
"""

import os
import shutil
import time
import weakref
from contextlib import suppress
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir

from cosim.support.interrupts import uninterrupted

PREFIX = "cosim-scratch-"
"""Of every such folder, and of nothing that a person would make."""
YOUNG = 60.0
"""Seconds in which a folder may be made and not yet held."""


class Scratch(TemporaryDirectory[str]):
    """A temporary folder that is held while this process lives; `name` is its path."""

    def __init__(self) -> None:
        tidy(gettempdir())
        super().__init__(prefix=PREFIX, ignore_cleanup_errors=True)
        if (handle := _held(Path(self.name))) is not None:
            weakref.finalize(self, os.close, handle)

    def cleanup(self) -> None:
        """Remove the folder; a signal that comes meanwhile waits, for half of it removed is as good as left."""
        with uninterrupted():
            super().cleanup()


@cache
def tidy(folder: str) -> None:
    """Remove what killed commands of this user left in a folder; once in a process."""
    if not hasattr(os, "getuid"):  # Windows, which has no such locks either: nobody knows whose a folder is
        return
    for one in Path(folder).glob(f"{PREFIX}*"):
        with suppress(OSError):
            if one.stat().st_uid == os.getuid() and time.time() - one.stat().st_mtime > YOUNG:
                _removed(one)


def _removed(folder: Path) -> None:
    """Remove a folder unless somebody holds it."""
    if (handle := _held(folder)) is not None:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(handle)


def _held(folder: Path) -> int | None:
    """The handle by which this process holds a folder; None where another does, or the system has no such locks."""
    try:
        import fcntl
    except ImportError:  # pragma: no cover - Windows
        return None
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        return None
    return handle


__all__ = ["Scratch"]
