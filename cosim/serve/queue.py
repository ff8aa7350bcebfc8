"""One diagnosis after the other, each in a process of its own, which ends with this one.

A job that is cancelled leaves no process and no result. What was running when this process ended is interrupted; what
waited goes on when the next one begins.
"""

import shutil
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from threading import Condition, Thread
from typing import Any

from cosim.serve.job import Job
from cosim.serve.store import Store, UnknownJobError
from cosim.serve.work import job_order
from cosim.support.cell import Cell, LostError
from cosim.support.errors import CosimError
from cosim.support.plain import Parsed

KEPT = 200
"""Steps of a diagnosis that are remembered; one has some tens."""


@dataclass
class Progress:
    """What the diagnosis under way has told."""

    id: str = ""
    steps: list[str] = field(default_factory=list)
    answer: Parsed = field(default_factory=dict)


class Queue:
    """The queue of jobs and the process of the first one.

    Args:
        store: where the jobs are.
        function: what diagnoses an `Order`, a function of a module.
    """

    def __init__(self, store: Store, function: Callable[..., Parsed]) -> None:
        self._store, self._function = store, function
        self._changed = Condition()
        self._waiting: list[str] = []
        self._cell, self._closed, self._cancelled = Cell(), False, False
        self.progress = Progress()
        self._resume()
        self._thread = Thread(target=self._work, name="queue", daemon=True)
        self._thread.start()

    def submit(self, name: str) -> None:
        """Put a job at the end of the queue."""
        with self._changed:
            self._store.put(name, state="queued", problem="", answer={}, seconds=0.0)
            self._waiting.append(name)
            self._changed.notify_all()

    def cancel(self, name: str) -> None:
        """Take a job out of the queue, or end its process; returns when it is gone."""
        with self._changed:
            if name in self._waiting:
                self._waiting.remove(name)
                self._store.put(name, state="cancelled")
            elif self.progress.id == name:
                self._cancelled = True
                self._changed.wait_for(lambda: self.progress.id != name)

    def before(self, name: str) -> int:
        """Return how many jobs come before this one."""
        with self._changed:
            place = self._waiting.index(name) if name in self._waiting else 0
            return place + (1 if self.progress.id else 0)

    def pid(self) -> int:
        """Return the number of the process that diagnoses, 0 if there is none."""
        return self._cell.pid

    def close(self) -> None:
        """End the process that runs and the thread; the job that ran is interrupted."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._thread.join()

    def _resume(self) -> None:
        """Go on with what an earlier process left."""
        for job in reversed(self._store.all()):
            if job.state == "queued":
                self._waiting.append(job.id)
            elif job.state == "running":
                shutil.rmtree(self._store.result(job.id), ignore_errors=True)
                self._store.put(job.id, state="interrupted")

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: bool(self._waiting) or self._closed)
                if self._closed:
                    return
                self.progress, self._cancelled = Progress(self._waiting.pop(0)), False
            with suppress(UnknownJobError):  # it was removed
                self._run(self.progress.id)
            with self._changed:
                self.progress = Progress()
                self._changed.notify_all()

    def _run(self, name: str) -> None:
        job = self._store.put(name, state="running", begun=time.time())
        began, values = time.monotonic(), Parsed()
        out = self._store.result(name)
        shutil.rmtree(out, ignore_errors=True)
        try:
            values = {"state": "done", "answer": self._diagnosed(job)}
        except LostError as error:
            values = {"state": self._lost(), "problem": f"The diagnosis ended before its answer. {error}"}
        except (CosimError, KeyboardInterrupt) as error:
            values = {"state": self._lost(), "problem": str(error)}
        except Exception as error:  # the disk is full, for example: the next job must have its turn
            values = {"state": self._lost(), "problem": f"{type(error).__name__}: {error}"}
        finally:
            self._cell.close()
        if values["state"] != "done":
            shutil.rmtree(out, ignore_errors=True)
        values |= {"problem": ""} if values["state"] in ("cancelled", "interrupted") else {}
        self._store.put(name, seconds=time.monotonic() - began, **values)

    def _diagnosed(self, job: Job) -> Parsed:
        recordings = self._store.folder(job.id) / "recordings"
        order = job_order(job, recordings, self._store.card(job), self._store.result(job.id))
        answer: Parsed = self._cell.call(self._function, order, on_message=self._told, overdue=self._given_up)
        return answer

    def _told(self, kind: str, content: Any) -> None:
        if kind == "answer":
            self.progress.answer = content
        else:
            self.progress.steps = [*self.progress.steps, str(content)][-KEPT:]

    def _given_up(self) -> str:
        """Say why the process is ended."""
        return "it was cancelled" if self._cancelled else "the server ends" if self._closed else ""

    def _lost(self) -> str:
        return "cancelled" if self._cancelled else "interrupted" if self._closed else "failed"
