"""Memory that a process has freed stays with it, for the next array of the same size."""

import ctypes
import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager

TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
"""Numbers of glibc's options (mallopt, malloc.h)."""
LARGEST, KEPT = 16 * 2**20, 2**27
"""Largest block taken from the heap, and free bytes that the heap may hold: what models are evaluated on is smaller,
the raw columns of long recordings are larger and go back at once."""


def keep_freed_memory() -> None:
    """Let glibc keep what is freed; elsewhere nothing is done.

    By default arrays above some 100 kB go back to the kernel, which clears each page anew: six of seven page faults of
    a diagnosis, and a twentieth of its time. It holds for the whole process, so commands call it and no library does.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt:
        mallopt(MMAP_THRESHOLD, LARGEST)
        mallopt(TRIM_THRESHOLD, KEPT)


@contextmanager
def many_objects() -> Iterator[None]:
    """Let a block make many objects that stay, without the search for cycles among them.

    Python looks through all objects again and again while their number grows: a third of the time in which the
    description of an FMU with 200,000 variables is read.
    """
    searched = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if searched:
            gc.enable()
