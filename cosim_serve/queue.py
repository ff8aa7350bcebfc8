"""One diagnosis after the other, each in a process of its own, which ends with this one.

A job that is cancelled leaves no process and no result. What was running when this process ended is interrupted; what
waited goes on when the next one begins.
"""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from threading import Condition, Thread
from typing import Any

from cosim.support.cell import Cell, LostError
from cosim.support.errors import CosimError
from cosim.support.plain import Parsed
from cosim.support.system_errors import surroundings
from cosim_serve.job import Answer, Job, State, answer_of
from cosim_serve.store import Store, UnknownJobError, UnreadableJobError
from cosim_serve.work import job_order

KEPT = 200
"""Steps of a diagnosis that are remembered; one has some tens."""
LONGEST = 2000
"""Characters of the reason for which a diagnosis failed."""


@dataclass
class Progress:
    """What the diagnosis under way has told."""

    id: str = ""
    steps: list[str] = field(default_factory=list)
    answer: Answer | None = None


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

    def submit(self, name: str, checked: Callable[[Job], Job] = lambda job: job) -> None:
        """Put a job at the end of the queue; `checked` refuses one that is not to be diagnosed."""

        def queued(job: Job) -> Job:
            return replace(checked(job), state="queued", problem="", answer=Answer(), seconds=0.0)

        with self._changed:
            self._store.change(name, queued)
            self._waiting.append(name)
            self._changed.notify_all()

    def cancel(self, name: str) -> None:
        """Take a job out of the queue, or end its process; returns when it is gone."""
        with self._changed:
            if name in self._waiting:
                self._waiting.remove(name)
            elif self.progress.id == name:
                self._cancelled = True
                self._changed.wait_for(lambda: self.progress.id != name)
            with suppress(UnreadableJobError):
                if self._store.get(name).live:
                    self._store.settle(name, state="cancelled")

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
                self._store.clear_result(job.id)
                self._store.settle(job.id, state="interrupted")

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: bool(self._waiting) or self._closed)
                if self._closed:
                    return
                self.progress, self._cancelled = Progress(self._waiting.pop(0)), False
            with suppress(UnknownJobError, UnreadableJobError):  # it was removed, or damaged
                self._run(self.progress.id)
            with self._changed:
                self.progress = Progress()
                self._changed.notify_all()

    def _run(self, name: str) -> None:
        job = self._store.settle(name, state="running", begun=time.time())
        began = time.monotonic()
        self._store.clear_result(name)
        try:
            state, answer, problem = "done", self._diagnosed(job), ""
        except Exception as error:  # a defect, for example: the next job must have its turn
            state, answer, problem = self._lost(), Answer(), _told_of(error)
        except KeyboardInterrupt as error:
            state, answer, problem = self._lost(), Answer(), str(error)
        finally:
            self._cell.close()
        if state != "done":
            self._store.clear_result(name)
        problem = "" if state in ("cancelled", "interrupted") else problem[:LONGEST]
        self._store.settle(name, seconds=time.monotonic() - began, state=state, answer=answer, problem=problem)

    def _diagnosed(self, job: Job) -> Answer:
        recordings = self._store.folder(job.id) / "recordings"
        order = job_order(job, recordings, self._store.card(job), self._store.result(job.id))
        return answer_of(self._cell.call(self._function, order, on_message=self._receive, overdue=self._given_up))

    def _receive(self, kind: str, content: Any) -> None:
        if kind == "answer":
            self.progress.answer = answer_of(content)
        else:
            self.progress.steps = [*self.progress.steps, str(content)][-KEPT:]

    def _given_up(self) -> str:
        """Say why the process is ended."""
        return "it was cancelled" if self._cancelled else "the server ends" if self._closed else ""

    def _lost(self) -> State:
        return "cancelled" if self._cancelled else "interrupted" if self._closed else "failed"


def _told_of(error: Exception) -> str:
    """Say why a diagnosis has failed."""
    if isinstance(error, LostError):
        return f"The diagnosis ended before its answer. {error}"
    if isinstance(error, OSError | MemoryError):
        return f"The diagnosis ended before its answer: {surroundings(error)}"
    return str(error) if isinstance(error, CosimError) else f"{type(error).__name__}: {error}"
