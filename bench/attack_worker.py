"""One attack: the command in a forked process with limits of time and memory; what it said and what it left."""

import os
import resource
import select
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from shutil import rmtree

from tree_cost import megabytes

BUSY, SECONDS, GRACE, MEMORY = 15.0, 120.0, 60.0, 6_000_000_000
"""What a command may take: s of a processor, or of the clock, until Ctrl-C; s to end then; bytes beyond those at its
start. The clock's are many, for a computer that has other things to do."""
LOOK = 0.1
"""Seconds between two looks at what it takes."""
TICK = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100
FILE = 500_000_000
"""Bytes of a file that it may write."""


@dataclass(frozen=True)
class Ended:
    """How a command ended: exit code (negative: signal), whether by Ctrl-C or not even so, streams, what was left.

    `megabytes`: most memory that it and what it started held together, looked at ten times a second.
    """

    code: int
    asked: bool
    hung: bool
    out: str
    err: str
    left: tuple[str, ...]
    running: int
    seconds: float
    megabytes: float = 0.0


def attempt(command: Callable[[], object], folder: Path) -> Ended:
    """Run a command in a fork, in `folder`, with a folder for temporary files of its own."""
    (folder / "tmp").mkdir(exist_ok=True)
    streams = folder / "stdout", folder / "stderr"
    began = time.monotonic()
    process = os.fork()
    if process == 0:
        _live(command, folder, streams)
    held = [0.0]
    asked = not _ended(process, folder, SECONDS, held)
    hung = asked and not _interrupted(process, folder, held)
    _, status = os.waitpid(process, 0)
    running = _running(folder)
    with suppress(ProcessLookupError):
        os.killpg(process, signal.SIGKILL)
    out, err = (one.read_text("utf-8", "replace") for one in streams)
    left = tuple(sorted(str(one.relative_to(folder)) for one in _left(folder)))
    rmtree(folder / "tmp", ignore_errors=True)
    return Ended(
        os.waitstatus_to_exitcode(status), asked, hung, out, err, left, running, time.monotonic() - began, max(held)
    )


def _interrupted(process: int, folder: Path, held: list[float]) -> bool:
    """Press Ctrl-C; returns whether the process ends by it, else it is killed."""
    os.kill(process, signal.SIGINT)
    if _ended(process, folder, GRACE, held):
        return True
    os.killpg(process, signal.SIGKILL)
    return False


def _left(folder: Path) -> list[Path]:
    """What nobody wants: anything in the temporary folder, half-written files, locks."""
    hidden = [one for one in folder.rglob(".*") if one.name.endswith((".partial", ".lock"))]
    return [*(folder / "tmp").iterdir(), *hidden]


def _ended(process: int, folder: Path, seconds: float, held: list[float]) -> bool:
    """Wait for the end of a process; returns whether it came in time. What it held meanwhile goes into a list [MB]."""
    handle, used, last = os.pidfd_open(process), _used(folder), time.monotonic() + seconds
    try:
        while not select.select([handle], [], [], LOOK)[0]:
            held.append(megabytes(process))
            if time.monotonic() > last or _used(folder) - used > BUSY:
                return False
        return True
    finally:
        os.close(handle)


def _used(folder: Path) -> float:
    """Seconds of a processor of all processes that were started there."""
    used = 0.0
    for process in _all(folder):
        with suppress(OSError):
            used += sum(map(int, (process / "stat").read_text().rpartition(")")[2].split()[11:13])) / TICK
    return used


def _running(folder: Path) -> int:
    """Count processes that were started there and still are; one that is just ending has a second."""
    for _ in range(20):
        found = _all(folder)
        if not found:
            return 0
        time.sleep(0.05)
    return len(found)


def _all(folder: Path) -> list[Path]:
    return [one for one in Path("/proc").iterdir() if one.name.isdigit() and _here(one, folder)]


def _here(process: Path, folder: Path) -> bool:
    with suppress(OSError):
        return (
            os.readlink(process / "cwd") == str(folder)
            and (process / "stat").read_text().rpartition(")")[2].split()[0] != "Z"
        )
    return False


def _live(command: Callable[[], object], folder: Path, streams: tuple[Path, Path]) -> None:
    """Be the process; does not return."""
    code = 70
    try:
        os.setsid()
        for number, path in enumerate(streams, 1):
            os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644), number)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        os.chdir(folder)
        _limit()
        os.environ["TMPDIR"], tempfile.tempdir = str(folder / "tmp"), None
        sys.stdout, sys.stderr = (open(number, "w", encoding="utf-8", closefd=False) for number in (1, 2))  # noqa: SIM115
        code = _code(command)
    finally:
        with suppress(BaseException):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def _limit() -> None:
    now = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (now + MEMORY, now + MEMORY))
    resource.setrlimit(resource.RLIMIT_FSIZE, (FILE, FILE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)


def _code(command: Callable[[], object]) -> int:
    """Run the command as the interpreter would: exit code, traceback, and what is due at its end."""
    import atexit
    import traceback

    code = 0
    try:
        command()
    except SystemExit as left:
        code = left.code if isinstance(left.code, int) else 0 if left.code is None else 1
    except BaseException:
        traceback.print_exc()
        code = 1
    atexit._run_exitfuncs()
    return code
