"""Memory that a process has freed stays with it, for the next array of the same size."""

import ctypes
import sys

TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
"""Numbers of glibc's options (mallopt, malloc.h)."""
LARGEST, KEPT = 32 * 2**20, 2**30
"""Largest block taken from the heap, which is as large as glibc allows, and free bytes that the heap may hold."""


def keep_freed_memory() -> None:
    """Let glibc keep what is freed; elsewhere nothing is done.

    By default arrays above some 100 kB go back to the kernel, which clears each page anew: six of seven page faults of
    a diagnosis, and a twentieth of its time. It holds for the whole process, so commands call it and no library does.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt:
        mallopt(MMAP_THRESHOLD, LARGEST)
        mallopt(TRIM_THRESHOLD, KEPT)
