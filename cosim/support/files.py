"""Files that are complete or absent, never half written, and never overwritten unasked."""

import hashlib
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path

from cosim.support.errors import OutputError

_PARTIALS: set[Path] = set()
"""What this process may have half written."""
_NUMBERS = count(1)
"""No two files that grow have one name, also where threads write to one path."""


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file as hexadecimal text."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def cache_home() -> Path:
    """Return the folder for what can be made again: $MOUNT_COSIM_CACHE or the user's cache directory."""
    from platformdirs import user_cache_path

    return Path(os.environ.get("MOUNT_COSIM_CACHE") or user_cache_path("mount-cosim"))


def check_free(path: Path, force: bool) -> None:
    """Refuse a path that is taken.

    Raises:
        OutputError: the file exists and `force` is not set.
    """
    above = next((one for one in path.parents if one.exists()), path.parent)
    if above.exists() and not above.is_dir():
        raise _no_directory(path.parent, above)
    if path.exists() and not force:
        raise OutputError(f"{path} exists already; give --force to overwrite it.", culprit=str(path))


def directory(path: Path) -> Path:
    """Make a directory for results and return it.

    Raises:
        OutputError: it cannot be made, for example because a file has its name.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        file = next((one for one in (path, *path.parents) if one.is_file()), None)
        raise _no_directory(path, file or (error.strerror or str(error)).lower()) from error
    return path


def check_directory(path: Path) -> None:
    """Refuse a directory that cannot be made, and leave none.

    Raises:
        OutputError: as `directory`.
    """
    resolved = path.resolve()
    made = [one for one in (resolved, *resolved.parents) if not one.exists()]
    directory(path)
    for one in made:
        one.rmdir()


def _no_directory(path: Path, why: Path | str) -> OutputError:
    """The refusal of a folder for results: a file has its name, or the system's own reason."""
    reason = f"{why} is {'a file' if why.is_file() else 'no folder'}" if isinstance(why, Path) else why
    return OutputError(f"The directory {path} cannot be made: {reason}.", culprit=str(path))


def check_room(path: Path | None, size: int, advice: str) -> None:
    """Refuse a file (or, without a path, an array in memory) of `size` bytes for which there is no room.

    Raises:
        OutputError: names what is needed, what is free, and `advice`.
    """
    where = "memory" if path is None else next(one for one in path.absolute().parents if one.exists())
    free = memory() if path is None else shutil.disk_usage(str(where)).free
    if size > free:
        message = f"{in_bytes(size)} are needed and {where} has {in_bytes(free)}: {advice}."
        raise OutputError(message[0].upper() + message[1:], culprit=str(where), value=size)


def memory() -> int:
    """Return the bytes of memory of this machine; where it does not say, so much that nothing is refused."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return 1 << 62


def in_bytes(size: float) -> str:
    """Write a number of bytes for people."""
    for unit in ("bytes", "kB", "MB", "GB", "TB", "PB"):
        if size < 1000 or unit == "PB":
            return f"{size:.3g} {unit}"
        size /= 1000
    raise AssertionError("unreachable")


@contextmanager
def replacing(path: Path, force: bool = False) -> Iterator[Path]:
    """Yield a temporary path beside `path` that takes its place when the block ends well, and vanishes otherwise.

    Raises:
        OutputError: `path` exists and `force` is not set, or its directory cannot be made.
    """
    check_free(path, force)
    partial = partial_of(path)
    try:
        yield partial
        take_place(partial, path, force)
    finally:
        partial.unlink(missing_ok=True)


def partial_of(path: Path) -> Path:
    """Make the directory of a file to be written and return the path beside it under which it grows."""
    partial = directory(path.parent) / f".{path.name}.{next(_NUMBERS)}.{os.getpid()}.partial"
    _PARTIALS.add(partial)
    return partial


def take_place(partial: Path, path: Path, force: bool) -> None:
    """Give a file that is complete its name; without `force` one that came into being meanwhile stays.

    Raises:
        OutputError: there is a file of that name, and `force` is not set.
    """
    if not force:
        try:
            os.link(partial, path)
        except FileExistsError:
            check_free(path, force)
        except OSError:  # a file system without hard links, where the look before must do
            check_free(path, force)
            os.replace(partial, path)
    else:
        os.replace(partial, path)
    partial.unlink(missing_ok=True)


def forget_partials(process: int | None = None, folder: Path | None = None) -> None:
    """Remove what is half written: by this process, or by one that is gone in a folder."""
    left = _PARTIALS if process is None or folder is None else folder.glob(f".*.{process}.partial")
    for partial in list(left):
        partial.unlink(missing_ok=True)
