"""A process of its own for each line of work: what crashes or hangs there is lost alone.

A plain subprocess, because those of `multiprocessing` are not allowed inside the workers of a Dask cluster. It leads a
session of its own, has a folder of its own for temporary files, and both go with it, whatever it left there or started.
"""

import os
import pickle
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread
from time import monotonic
from typing import IO, Any

from cosim.support.activity import SIZE, Board
from cosim.support.errors import CosimError
from cosim.support.scratch import Scratch
from cosim.support.threads import VARIABLES

GRACE = 2.0
"""Seconds that a process which gave no answer has to end by itself."""
LOOK = 0.1
"""Seconds between two looks at a process that must not take too long."""
BOARD = "activity"
"""File of the process's board, in its folder."""

Overdue = Callable[[], str]
"""Says why a process that is watched is given up; empty as long as it is not."""


class LostError(Exception):
    """The process ended, or was ended, before it answered; `status` is "crashed" or "timeout", `code` its exit code."""

    def __init__(self, status: str, reason: str, code: int = 0) -> None:
        super().__init__(reason)
        self.status = status
        self.code = code


class Cell:
    """One process at a time; one that is gone is replaced when the next call comes.

    Args:
        quiet: keep what the process writes to stderr for the reason of a crash, in place of showing it.
        keep: file descriptors that the process inherits, for example that of a lock which shall outlive this process.
    """

    def __init__(self, quiet: bool = True, keep: tuple[int, ...] = ()) -> None:
        self._quiet, self._keep = quiet, keep
        self._process: subprocess.Popen[bytes] | None = None
        self._said: IO[bytes] | None = None
        self._folder: Scratch | None = None

    def call(
        self,
        function: Callable[..., Any],
        *arguments: Any,
        timeout: float | None = None,
        overdue: Overdue | None = None,
        on_message: Callable[..., None] = lambda *_: None,
    ) -> Any:
        """Call a function of a module in the process and return its result.

        Args:
            function: of a module; it may call `cosim.support.child.tell`.
            arguments: what it is called with.
            timeout: seconds that it may take.
            overdue: asked every tenth of a second whether it is given up.
            on_message: called with what the process tells before it answers.

        Raises:
            CosimError, OSError, MemoryError: the function raised it; or KeyboardInterrupt: it was told to end and did.
            LostError: the process crashed, or was given up.
        """
        process = self._process if self._process and self._process.poll() is None else self.begin()
        with self._guarded(process, _either(timeout, overdue)) as late:
            try:
                self._send(process, function, arguments)
                answer = self._answer(process, on_message)
            except (EOFError, OSError, pickle.UnpicklingError):
                raise self._loss(process, late) from None
        if isinstance(answer, CosimError | KeyboardInterrupt | OSError | MemoryError):
            raise answer
        return answer

    def finish(self, overdue: Overdue) -> None:
        """Ask the process to end its call well, and end it when it is overdue."""
        process = self._process
        if process is None or process.stdin is None or process.stdout is None:
            return
        with self._guarded(process, overdue), suppress(OSError):
            process.terminate()
            process.stdin.close()  # no further call: it ends after this one
            while process.stdout.read1():  # type: ignore[attr-defined]  # what comes may begin in the middle
                pass
        self.close()

    def board(self) -> Board:
        """Return what the process that was begun says about what it is doing."""
        assert self._folder is not None  # there is a process
        return Board(Path(self._folder.name) / BOARD)

    @property
    def pid(self) -> int:
        """Number of the process, 0 where there is none."""
        return self._process.pid if self._process else 0

    def close(self) -> None:
        """End the process and all that it started, and remove its folder; may be called from another thread."""
        process, self._process = self._process, None
        folder, self._folder = self._folder, None
        if process is not None:
            _kill(process)
            process.wait()
            for file in (process.stdin, process.stdout, self._said):
                with suppress(OSError):  # what was on its way to a process that is gone cannot be flushed
                    if file is not None:
                        file.close()
        if folder is not None:
            folder.cleanup()

    def begin(self) -> "subprocess.Popen[bytes]":
        """Start a process, which then makes itself ready; the one before is ended."""
        self.close()
        self._folder = Scratch()
        folder = self._folder.name
        _reserve(Path(folder) / BOARD, self._folder)
        self._said = tempfile.TemporaryFile("a+b") if self._quiet else None  # noqa: SIM115 it lives as long as the process
        home = str(Path(__file__).parents[2])
        paths = os.pathsep.join(filter(None, [home, os.environ.get("PYTHONPATH", "")]))
        environment = dict.fromkeys(VARIABLES, "1") | os.environ | {"PYTHONPATH": paths}
        environment |= dict.fromkeys(("TMPDIR", "TEMP", "TMP"), folder)
        command = [sys.executable, "-m", "cosim.support.child", str(Path(folder) / BOARD), str(os.getpid())]
        # A session of its own: Ctrl-C at the terminal reaches the parent alone, which then ends this process.
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            env=environment,
            start_new_session=True,
            pass_fds=self._keep,
        )
        return self._process

    def _send(self, process: "subprocess.Popen[bytes]", function: Callable[..., Any], arguments: Any) -> None:
        assert process.stdin is not None  # both are pipes
        if self._said is not None:
            self._said.truncate(0)
        pickle.dump((function, arguments), process.stdin)
        process.stdin.flush()

    def _answer(self, process: "subprocess.Popen[bytes]", on_message: Callable[..., None]) -> Any:
        assert process.stdout is not None
        while True:
            kind, content = pickle.load(process.stdout)
            if kind == "answer":
                return content
            on_message(*content)

    @contextmanager
    def _guarded(self, process: "subprocess.Popen[bytes]", overdue: Overdue) -> Iterator[list[str]]:
        """End the process when it is overdue; yields a list that then holds the reason.

        What the process started may hold the pipe of its answers open: it ends with the process.
        """
        late: list[str] = []
        done = Event()

        def look() -> None:
            while not done.wait(LOOK):
                if reason := overdue():
                    late.append(reason)
                if late or process.poll() is not None:
                    _kill(process)
                    return

        guard = Thread(target=look, daemon=True)
        guard.start()
        try:
            yield late
        finally:
            done.set()
            guard.join()

    def _loss(self, process: "subprocess.Popen[bytes]", late: list[str]) -> LostError:
        with suppress(subprocess.TimeoutExpired):
            process.wait(0 if late else GRACE)  # it may be ending just now: its own code says more than our signal
        process.kill()
        code, said = process.wait(), self._last_said()
        if late:
            return LostError("timeout", f"It was given up: {late[0]}.", code)
        return LostError("crashed", f"The process of this run crashed: {ending(code)}{said}.", code)

    def _last_said(self) -> str:
        if self._said is None or self._said.closed:
            return ""
        self._said.seek(0)
        lines = self._said.read().decode("utf-8", "replace").strip().splitlines()
        return f'; it last said "{lines[-1].strip()}"' if lines else ""


def cores() -> int:
    """Return how many processes this one may use at a time."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _reserve(board: Path, folder: Scratch) -> None:
    """Make the file of the board with all its bytes: writing to mapped memory for which there is no room is a crash."""
    try:
        board.write_bytes(bytes(SIZE))
    except OSError:
        folder.cleanup()
        raise


def ending(code: int) -> str:
    """Say how a process with this exit code ended."""
    if code >= 0:
        return f"it ended by itself with code {code}"
    with suppress(ValueError):
        return f"it was ended by signal {-code}, {signal.Signals(-code).name}"
    return f"it was ended by signal {-code}"


def _either(timeout: float | None, overdue: Overdue | None = None) -> Overdue:
    """Join both limits of a call."""
    rest = overdue or (lambda: "")
    if not timeout:
        return rest
    end = monotonic() + timeout
    return lambda: f"no answer within {timeout:g} s" if monotonic() > end else rest()


def _kill(process: "subprocess.Popen[bytes]") -> None:
    """End a process and its session."""
    with suppress(OSError, AttributeError):  # its session may be gone; Windows has none
        os.killpg(process.pid, signal.SIGKILL)
    process.kill()
