"""Who does the runs: processes of this machine, or those of a Dask cluster; to the sweep both are the same."""

import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice

from cosim.support.cell import Cell, LostError, cores
from cosim.support.errors import SweepError
from cosim.sweeps.cluster import on_cluster
from cosim.sweeps.design import Point
from cosim.sweeps.job import Job, Row, work
from cosim.sweeps.portable_job import PortableJob

Numbered = tuple[int, Point]

MOST = 1024
"""Processes on this machine at most: more are a slip of the finger, and no machine's memory holds them."""
_OWN = threading.local()
_CELLS: list[Cell] = []
"""The cells of all threads, so that they can be closed from one."""
_FREE: list[Cell] = []
"""Cells that are up and belong to no thread."""


@dataclass(frozen=True)
class Pool:
    """`submit` gives a run away; `size` runs are done at a time, `ahead` more wait where they are done."""

    submit: Callable[[int, Point], "Future[Row]"]
    size: int
    ahead: int

    def rows(self, points: Iterable[Numbered]) -> Iterator[Row]:
        """Yield the rows as they come; no more points are taken than can soon be run."""
        rest = iter(points)
        pending = {self.submit(*one) for one in islice(rest, self.size + self.ahead)}
        try:
            while pending:
                done, pending = wait(pending, return_when=FIRST_COMPLETED)
                pending |= {self.submit(*one) for one in islice(rest, len(done))}
                for future in done:
                    yield future.result()
        finally:
            for future in pending:
                future.cancel()


def isolated(job: Job, number: int, point: Point) -> Row:
    """Do one run in the cell of this thread; a crash becomes a row."""
    try:
        row: Row = own_cell().call(work, job, number, point, timeout=job.timeout)
    except LostError as loss:
        return job.begun(number, point) | {"status": loss.status, "reason": str(loss)}
    return row


def own_cell() -> Cell:
    """Return the cell of this thread."""
    if not hasattr(_OWN, "cell") or _OWN.cell not in _CELLS:
        _OWN.cell = new_cell()
    cell: Cell = _OWN.cell
    return cell


def new_cell() -> Cell:
    """Return a cell that `close_cells` will close, one that is up already if there is one."""
    with suppress(IndexError):
        return _FREE.pop()
    cell = Cell()
    _CELLS.append(cell)
    return cell


def warm(count: int) -> None:
    """Begin processes that will be needed soon; they get ready while other things are done."""
    for cell in [new_cell() for _ in range(count)]:
        cell.begin()
        free(cell)


def free(cell: Cell) -> None:
    """Give a cell of `new_cell` back, for whoever needs one next."""
    _FREE.append(cell)


def close_cells() -> None:
    """End all processes that runs of this one happen in."""
    _FREE.clear()
    while _CELLS:
        _CELLS.pop().close()


def most_workers(workers: int | None, runs: int) -> int:
    """Return how many processes there shall be: those asked for, else one a core; never more than there are runs.

    Raises:
        SweepError: nobody can mean so few or so many.
    """
    if workers is not None and workers < 1:
        raise SweepError(f"--workers {workers}: there must be at least one.", culprit="workers", value=workers)
    if workers is not None and workers > MOST:
        raise SweepError(f"--workers {workers}: {MOST:,} are the most.", culprit="workers", value=workers)
    return min(workers or cores(), runs)


@contextmanager
def local(job: Job, workers: int) -> Iterator[Pool]:
    """Run in `workers` processes of this machine."""
    threads = ThreadPoolExecutor(workers, "sweep")
    try:
        yield Pool(lambda number, point: threads.submit(isolated, job, number, point), workers, workers)
    finally:
        threads.shutdown(wait=False, cancel_futures=True)
        close_cells()
        threads.shutdown()


@contextmanager
def cluster(job: Job, address: str) -> Iterator[Pool]:
    """Run on a Dask cluster; errors as of `on_cluster`."""
    with on_cluster(job, address, close_cells) as there:
        yield Pool(lambda number, point: there.submit(_remote, number, point), there.threads, 2 * there.threads)


def _remote(portable: PortableJob[Job], number: int, point: Point) -> Row:
    return isolated(portable.job_here(), number, point)
