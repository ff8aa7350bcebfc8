"""One process at a time writes into a folder for results."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from cosim.support.errors import OutputError
from cosim.support.files import directory

NAME = ".cosim.lock"
"""The file that is locked; it goes with the lock."""


@contextmanager
def claimed(folder: Path, what: str) -> Iterator[int]:
    """Keep a folder for results to this process while the block lasts; made, and removed again if nothing came into it.

    What processes that were killed left half written there is removed. Yields the file descriptor of the lock: who
    inherits it holds the lock too. A process that ends, however it ends, lets go of it. Where the system has no such
    locks, the user must see to it.

    Raises:
        OutputError: another process is writing there, or the folder cannot be written.
    """
    made = [one for one in (folder, *folder.parents) if not one.exists()]
    path = directory(folder) / NAME
    handle = _locked(path, folder, what)
    try:
        _clear(folder)
        yield handle
    finally:
        path.unlink(missing_ok=True)
        os.close(handle)
        for one in made:
            with suppress(OSError):  # there are results in it
                one.rmdir()


def _clear(folder: Path) -> None:
    """Remove what processes that are gone left half written."""
    for partial in folder.glob(".*.partial") if os.name == "posix" else ():
        owner = partial.suffixes[-2][1:] if len(partial.suffixes) > 1 else ""
        with suppress(ValueError, PermissionError):  # no name of ours, or somebody else's process
            try:
                os.kill(int(owner), 0)
            except ProcessLookupError:
                partial.unlink(missing_ok=True)


def _locked(path: Path, folder: Path, what: str) -> int:
    """Open and lock the file; one that its owner has just removed is opened anew."""
    while True:
        try:
            handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise OutputError(f"{folder} cannot be written: {reason}.", culprit=str(folder)) from error
        if not _lock(handle):
            os.close(handle)
            message = f"Another {what} is writing to {folder}; wait for it, end it, or give another --out."
            raise OutputError(message, culprit=str(folder))
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(handle), os.stat(path)):
                return handle
        os.close(handle)


def _lock(handle: int) -> bool:
    """Lock an open file; returns whether nobody else has."""
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True  # a file system without locks
    return True
