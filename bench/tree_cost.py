"""What a process and all that it starts take of memory, on Linux."""

import os
from collections.abc import Iterator
from contextlib import suppress


def family(process: int) -> Iterator[int]:
    """Yield a process and those that it started, as far as they still run."""
    yield process
    with suppress(OSError):
        for thread in os.listdir(f"/proc/{process}/task"):
            with open(f"/proc/{process}/task/{thread}/children", encoding="ascii") as file:
                for one in file.read().split():
                    yield from family(int(one))


def megabytes(process: int) -> float:
    """Return the memory that a process and those it started hold for themselves now [MB].

    What a fork still shares with the process that forked it is not its own.
    """
    total = 0.0
    for one in family(process):
        with suppress(OSError), open(f"/proc/{one}/smaps_rollup", encoding="ascii") as file:
            total += sum(int(line.split()[1]) for line in file if line.startswith("Private_")) * 1.024e-3
    return total
