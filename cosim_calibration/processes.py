"""Points of a calibration simulated in several processes, here or on a cluster; what a model does there costs a point.

A point at which a model crashes, hangs or gives no number has no outputs. What was simulated is kept in a store, where
there is one, and is not simulated again.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from queue import SimpleQueue
from time import perf_counter
from types import TracebackType
from typing import Any, Self
from uuid import uuid4

from cosim.support.cell import Cell, LostError, ending
from cosim.support.cells import MOST, close_cells, most_workers, own_cell
from cosim.support.errors import CosimError, InputError
from cosim.system.portable_job import PortableJob, on_cluster
from cosim_calibration.simulation import Answer, Job, Outputs, Point, keeps_at, outputs_at, prepare, slopes_at
from cosim_calibration.store import Store

TIMEOUT = 60.0
"""Seconds that the first simulation may take, or one call of it where more are done."""
PATIENCE, LEAST = 20.0, 5.0
"""A later simulation may take that many times as long as the first, and at least these seconds."""


class Processes:
    """Processes that simulate points of a job; use it in a `with` statement.

    Args:
        job: what is simulated.
        workers: processes at a time; None is one a core.
        timeout: seconds that the first simulation may take.
        cluster: address of a Dask scheduler whose workers simulate all points but the first.
        store: of what was simulated before; None keeps nothing.
    """

    def __init__(
        self,
        job: Job,
        workers: int | None = None,
        timeout: float = TIMEOUT,
        cluster: str = "",
        store: Store | None = None,
    ) -> None:
        self.job, self._key, self._timeout, self._store = job, uuid4().hex, timeout, store
        self._count = 1 if cluster else most_workers(workers, MOST)
        self._address = cluster
        self._submit: Callable[..., Future[Answer]] = self._here
        self.evaluations = self.lost = 0
        self.reasons: list[str] = []

    def __enter__(self) -> Self:
        self._stack = ExitStack()
        with ExitStack() as stack:
            if self._address:
                there = stack.enter_context(on_cluster(self.job, self._address, close_cells))
                self._submit = partial(there.submit, _remote)
            self._free: SimpleQueue[Cell] = SimpleQueue()
            self._cells = [Cell() for _ in range(self._count)]
            self._threads = ThreadPoolExecutor(self._count, "calibration")
            stack.callback(self._close)
            for cell in self._cells:
                cell.begin()  # they get ready together
                self._free.put(cell)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._stack.close()

    def _close(self) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        for cell in self._cells:
            cell.close()
        self._threads.shutdown()

    def first(self, point: Point, part: slice) -> Outputs:
        """Simulate the point that everything starts from, on this machine, and learn how long that takes.

        Raises:
            InputError: the model cannot be simulated with these numbers; says why.
        """
        self.evaluations += 1
        begun, cell = perf_counter(), self._cells[0]
        try:
            found = _outputs(cell, self._key, lambda: self.job, point, part, self._timeout)
            self.job = replace(self.job, keeps=cell.call(keeps_at, self._key, timeout=self._timeout))
        except LostError as loss:
            raise InputError(self._sentence(loss), culprit=str(self.job.subject.source)) from loss
        except CosimError as error:
            text = f"{self.job.subject.source} cannot be simulated with the numbers it starts from: {error}"
            raise InputError(text, culprit=str(self.job.subject.source)) from error
        self._timeout = max(LEAST, PATIENCE * (perf_counter() - begun))
        return found

    def at(self, points: Sequence[Point], part: slice) -> list[Outputs | None]:
        """Simulate points, as many at a time as there are processes; None for each that cannot be."""
        self.evaluations += len(points)
        answers = {k: self._store.get(point, part) if self._store else None for k, point in enumerate(points)}
        pending = {
            self._submit(self._key, dict(points[k]), part, self._timeout): k
            for k, answer in answers.items()
            if answer is None
        }
        for future in as_completed(pending):
            k = pending[future]
            answers[k] = answer = future.result()
            if self._store:
                self._store.put(points[k], part, answer)
        ended = [one for one in answers.values() if one is not None]
        self.reasons += [one.reason for one in ended if one.outputs is None]
        self.lost = len(self.reasons)
        return [one.outputs for one in ended]

    def slopes(self, point: Point, part: slice, names: Sequence[str]) -> Outputs | None:
        """Derivatives of the outputs by some numbers, by the FMU itself; None where it gives none."""
        cell = self._free.get()
        try:
            found: Outputs | None = cell.call(
                slopes_at, self._key, self.job, dict(point), part, list(names), timeout=PATIENCE * self._timeout
            )
        except (CosimError, LostError):
            return None
        finally:
            self._free.put(cell)
        return found

    def _here(self, key: str, point: Point, part: slice, timeout: float) -> Future[Answer]:
        return self._threads.submit(self._one, key, point, part, timeout)

    def _one(self, key: str, point: Point, part: slice, timeout: float) -> Answer:
        cell = self._free.get()
        try:
            return _answer(cell, key, lambda: self.job, point, part, timeout)
        finally:
            self._free.put(cell)

    def _sentence(self, loss: LostError) -> str:
        source, rule = self.job.subject.source, "with the numbers it starts from; nothing can be identified."
        if loss.status == "timeout":
            return f"{source} did not end its simulation within {self._timeout:g} s {rule}"
        return f"{source} crashed ({ending(loss.code)}) {rule}"


def _remote(portable: PortableJob[Job], key: str, point: Point, part: slice, timeout: float) -> Answer:
    """Simulate a point in the process of this thread of a worker."""
    return _answer(own_cell(), key, portable.job_here, point, part, timeout)


def _answer(cell: Cell, key: str, job: Callable[[], Job], point: Point, part: slice, timeout: float) -> Answer:
    try:
        return Answer(_outputs(cell, key, job, point, part, timeout))
    except (CosimError, LostError) as error:
        return Answer(None, str(error))


def _outputs(cell: Cell, key: str, job: Callable[[], Job], point: Point, part: slice, timeout: float) -> Outputs:
    """Simulate a point in a process, which is given the job where it does not have it."""
    found: Any = cell.call(outputs_at, key, dict(point), part, timeout=timeout)
    if found is None:
        cell.call(prepare, key, job(), timeout=timeout)
        found = cell.call(outputs_at, key, dict(point), part, timeout=timeout)
    outputs: Outputs = found
    return outputs
