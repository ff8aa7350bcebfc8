"""Points of a calibration simulated in several processes; None where a model crashes, hangs or gives no number."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from queue import SimpleQueue
from time import perf_counter
from types import TracebackType
from typing import Self
from uuid import uuid4

from cosim.calibration.experiment import Array
from cosim.calibration.simulation import Job, Point, outputs_at, prepare
from cosim.support.cell import Cell, LostError, cores, ending
from cosim.support.errors import CosimError, InputError

TIMEOUT = 60.0
"""Seconds that the first simulation may take, or one call of it where more are done."""
PATIENCE, LEAST = 20.0, 5.0
"""A later simulation may take that many times as long as the first, and at least these seconds."""
Outputs = list[list[Array]]


class Processes:
    """Processes that simulate points of a job; use it in a `with` statement.

    Args:
        job: what is simulated.
        workers: processes at a time; None is one a core.
        timeout: seconds that the first simulation may take.
    """

    def __init__(self, job: Job, workers: int | None = None, timeout: float = TIMEOUT) -> None:
        self.job, self._key, self._timeout = job, uuid4().hex, timeout
        self._count = workers or cores()
        self._free: SimpleQueue[Cell] = SimpleQueue()
        self._cells = [Cell() for _ in range(self._count)]
        for cell in self._cells:
            cell.begin()  # they get ready together
            self._free.put(cell)
        self._threads = ThreadPoolExecutor(self._count, "calibration")
        self.evaluations = self.lost = 0
        self.reasons: list[str] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        for cell in self._cells:
            cell.close()
        self._threads.shutdown()

    def first(self, point: Point, part: slice) -> Outputs:
        """Simulate the point that everything starts from, and learn how long that takes.

        Raises:
            InputError: the model cannot be simulated with these numbers; says why.
        """
        begun = perf_counter()
        try:
            found = self._call(self._cells[0], point, part)
        except LostError as loss:
            raise InputError(self._sentence(loss), culprit=str(self.job.subject.source)) from loss
        except CosimError as error:
            text = f"{self.job.subject.source} cannot be simulated with the numbers it starts from: {error}"
            raise InputError(text, culprit=str(self.job.subject.source)) from error
        self._timeout = max(LEAST, PATIENCE * (perf_counter() - begun))
        return found

    def at(self, points: Sequence[Point], part: slice) -> list[Outputs | None]:
        """Simulate points, as many at a time as there are processes; None for each that cannot be."""
        return list(self._threads.map(lambda point: self._one(point, part), points))

    def _one(self, point: Point, part: slice) -> Outputs | None:
        cell = self._free.get()
        try:
            return self._call(cell, point, part)
        except (CosimError, LostError) as error:
            self.lost += 1
            self.reasons.append(str(error))
            return None
        finally:
            self._free.put(cell)

    def _call(self, cell: Cell, point: Point, part: slice) -> Outputs:
        self.evaluations += 1
        found = cell.call(outputs_at, self._key, dict(point), part, timeout=self._timeout)
        if found is None:
            cell.call(prepare, self._key, self.job, timeout=self._timeout)
            found = cell.call(outputs_at, self._key, dict(point), part, timeout=self._timeout)
        outputs: Outputs = found
        return outputs

    def _sentence(self, loss: LostError) -> str:
        source, rule = self.job.subject.source, "with the numbers it starts from; nothing can be identified."
        if loss.status == "timeout":
            return f"{source} did not end its simulation within {self._timeout:g} s {rule}"
        return f"{source} crashed ({ending(loss.code)}) {rule}"
