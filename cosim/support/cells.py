"""Many pieces of work at a time: a cell for each thread that hands work out, and all cells ended from one place."""

import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from itertools import islice
from typing import TypeVar

from cosim.support.cell import Cell, cores
from cosim.support.errors import SweepError

MOST = 1024
"""Processes on this machine at most: more are a slip of the finger, and no machine's memory holds them."""
_OWN = threading.local()
_CELLS: list[Cell] = []
"""The cells of all threads, so that they can be closed from one."""
_FREE: list[Cell] = []
"""Cells that are up and belong to no thread."""
Work = TypeVar("Work")
Result = TypeVar("Result")


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
    """End all processes that work of this one happens in."""
    _FREE.clear()
    while _CELLS:
        _CELLS.pop().close()


@contextmanager
def threads(count: int, name: str) -> Iterator[ThreadPoolExecutor]:
    """Yield threads that each work in their own cell; at the end what waits is dropped, what runs is ended."""
    executor = ThreadPoolExecutor(count, name)
    try:
        yield executor
    finally:
        executor.shutdown(wait=False, cancel_futures=True)
        close_cells()
        executor.shutdown()


def as_they_come(work: Iterable[Work], submit: Callable[[Work], "Future[Result]"], most: int) -> Iterator[Result]:
    """Yield results as they come; at most `most` pieces of work are taken and given away at a time."""
    rest = iter(work)
    pending = {submit(one) for one in islice(rest, most)}
    try:
        while pending:
            done, pending = wait(pending, return_when=FIRST_COMPLETED)
            pending |= {submit(one) for one in islice(rest, len(done))}
            yield from (future.result() for future in done)
    finally:
        for future in pending:
            future.cancel()
