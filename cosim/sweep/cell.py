"""A process of its own for each line of work: what crashes or hangs there is lost alone.

A plain subprocess, because those of `multiprocessing` are not allowed inside the workers of a Dask cluster.
"""

import os
import pickle
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Event, Timer
from typing import IO, Any

import cosim
from cosim.errors import InputError

GRACE = 2.0
"""Seconds that a process which gave no answer has to end by itself."""


class LostError(Exception):
    """The process ended, or was ended, before it answered; `status` is "crashed" or "timeout"."""

    def __init__(self, status: str, reason: str) -> None:
        super().__init__(reason)
        self.status = status


class Cell:
    """One process at a time; one that is gone is replaced when the next call comes."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._said: IO[bytes] | None = None

    def call(self, function: Callable[..., Any], *arguments: Any, timeout: float | None = None) -> Any:
        """Call a function of a module in the process and return its result.

        Raises:
            InputError: the function raised it.
            LostError: the process crashed, or did not answer within `timeout` seconds.
        """
        process = self._process if self._process and self._process.poll() is None else self.begin()
        late = Event()

        def give_up() -> None:
            late.set()
            process.kill()

        clock = Timer(timeout or 0.0, give_up)
        if timeout:
            clock.start()
        try:
            answer = self._ask(process, function, arguments)
        except (EOFError, OSError, pickle.UnpicklingError):
            raise self._loss(process, f"no answer within {timeout:g} s" if late.is_set() else "") from None
        finally:
            clock.cancel()
        if isinstance(answer, InputError):
            raise answer
        return answer

    def close(self) -> None:
        """End the process, whatever it is doing; may be called from another thread."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
            for file in (process.stdin, process.stdout, self._said):
                with suppress(OSError):  # what was on its way to a process that is gone cannot be flushed
                    if file is not None:
                        file.close()

    def begin(self) -> "subprocess.Popen[bytes]":
        """Start a process, which then makes itself ready; the one before is ended."""
        self.close()
        self._said = tempfile.TemporaryFile("a+b")  # noqa: SIM115 it lives as long as the process
        home = str(Path(cosim.__file__).parents[1])
        paths = os.pathsep.join(filter(None, [home, os.environ.get("PYTHONPATH", "")]))
        # One thread of linear algebra each: the cores are busy with runs already.
        environment = os.environ | {"PYTHONPATH": paths, "OMP_NUM_THREADS": "1"}
        command = [sys.executable, "-m", "cosim.sweep.child"]
        # A session of its own: Ctrl-C at the terminal reaches the parent alone, which then ends this process.
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            env=environment,
            start_new_session=True,
        )
        return self._process

    def _ask(self, process: "subprocess.Popen[bytes]", function: Callable[..., Any], arguments: Any) -> Any:
        assert process.stdin is not None  # both are pipes
        assert process.stdout is not None
        assert self._said is not None
        self._said.truncate(0)
        pickle.dump((function, arguments), process.stdin)
        process.stdin.flush()
        return pickle.load(process.stdout)

    def _loss(self, process: "subprocess.Popen[bytes]", late: str) -> LostError:
        with suppress(subprocess.TimeoutExpired):
            process.wait(0 if late else GRACE)  # it may be ending just now: its own code says more than our signal
        process.kill()
        code, said = process.wait(), self._last_said()
        self.close()
        if late:
            return LostError("timeout", f"It was given up: {late}.")
        return LostError("crashed", f"The process of this run crashed: {_ending(code)}{said}.")

    def _last_said(self) -> str:
        if self._said is None or self._said.closed:
            return ""
        self._said.seek(0)
        lines = self._said.read().decode("utf-8", "replace").strip().splitlines()
        return f'; it last said "{lines[-1].strip()}"' if lines else ""


def _ending(code: int) -> str:
    if code >= 0:
        return f"it ended by itself with code {code}"
    with suppress(ValueError):
        return f"it was ended by signal {-code}, {signal.Signals(-code).name}"
    return f"it was ended by signal {-code}"
