"""Readers in a process of their own: a library that crashes, hangs or takes too much memory on a file is lost alone.

Libraries for HDF5, MAT, MDF4 and bags trust what a file says of itself: a changed byte may be a segmentation fault or
a loop without end, which no check of ours can stop. The process has limits of memory and processor time by the rule of
`cosim.data.limits`, and stays for the next file.
"""

import atexit
import os
import signal
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Lock
from time import process_time

from cosim.data.columns import Columns
from cosim.data.limits import Allowance, allowance, over_memory, over_time, within
from cosim.support.cell import Cell, LostError
from cosim.support.errors import CosimError, RecordingError

BESIDE = 3.5
"""Bytes that a reader may take for each byte that its file unpacks to: the library's, ours, and what is sent."""
PATIENCE = 10.0
"""Seconds of the clock for a second of a processor, on a computer that has other things to do."""
REASON = 200
"""Characters of a library's own message that are shown."""

Reader = Callable[[Path], Columns]
_CELL, _LOCK = Cell(), Lock()


def read_apart(path: Path, suffix: str, reader: Reader) -> Columns:
    """Read a file by a reader, a function of a module, in the process that is kept for that.

    Raises:
        CosimError: the reader raised it; RecordingError also where it failed, crashed, or passed a limit.
    """
    allowed = allowance(path)
    with _LOCK:
        _begun()
        try:
            columns: Columns = _CELL.call(_read, path, suffix, reader, allowed, timeout=PATIENCE * allowed.seconds)
        except MemoryError:
            raise over_memory(path) from None
        except LostError as error:
            raise _lost(path, suffix, error) from None
        except KeyboardInterrupt:
            _CELL.close()  # it is in the middle of a file
            raise
    return columns


def _begun() -> None:
    """Start the process at its first file; at exit it ends before its folder is looked for, which this order makes."""
    if not _CELL.pid:
        _CELL.begin()
        atexit.unregister(close)
        atexit.register(close)


def close() -> None:
    """End the process; the next file starts another."""
    _CELL.close()


def _lost(path: Path, suffix: str, error: LostError) -> RecordingError:
    if error.status == "timeout" or error.code in (-getattr(signal, "SIGXCPU", 0), -getattr(signal, "SIGKILL", 0)):
        return over_time(path)
    text = f"{path} is damaged: the library that reads {suffix} files crashed on it"
    return RecordingError(f"{text} (exit code {error.code}).", culprit=str(path))


def _read(path: Path, suffix: str, reader: Reader, allowed: Allowance) -> Columns:
    """Read in the process; what a library raises becomes a sentence, whose own type may be unknown at home."""
    _limit(allowed)
    with within(allowed):
        return explained(path, suffix, reader)


def explained(path: Path, suffix: str, reader: Reader) -> Columns:
    """Read a file; an exception of a library becomes a RecordingError, as each means the same to the user."""
    try:
        return reader(path)
    except (CosimError, MemoryError):
        raise
    except Exception as error:
        reason = str(error).splitlines()[0].rstrip(".")[:REASON] if str(error).strip() else type(error).__name__
        text = f"{path} cannot be read as {suffix}: {reason}."
        raise RecordingError(text, culprit=str(path)) from error


def _limit(allowed: Allowance) -> None:
    """Set the limits of this process; where the system has none, the clock of the caller alone holds."""
    with suppress(ImportError, OSError, ValueError):
        import resource

        _, hard = resource.getrlimit(resource.RLIMIT_CPU)
        resource.setrlimit(resource.RLIMIT_CPU, (int(process_time() + allowed.seconds) + 2, hard))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        held = int(Path("/proc/self/statm").read_text("ascii").split()[0]) * os.sysconf("SC_PAGE_SIZE")
        resource.setrlimit(resource.RLIMIT_AS, (held + int(BESIDE * allowed.unpacked), hard))
