"""Recordings on their way: each has a folder of its own, and its name and bytes are reserved before its first byte.

So two that come at once cannot take each other's place, and what all of them have together keeps to the limits.
"""

from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from pathlib import Path

from cosim.support.errors import InputError
from cosim_serve.folder import CLOSED
from cosim_serve.job import Job
from cosim_serve.store import ARRIVING
from cosim_serve.uploads import Limits, check_disk, check_size, safe_name

GROWTH = 1_000_000
"""Bytes that are reserved at least, where a sender does not state how many come."""


@dataclass
class Arrival:
    """A recording on its way: its job, name and path, bytes that are reserved for it, why it is not taken any more."""

    job: str
    path: Path
    reserved: int
    refused: str = ""

    @property
    def file(self) -> str:
        """The name of its file."""
        return self.path.name


class Arrivals:
    """What is on its way to all jobs; to be called by who holds the lock of the jobs."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._coming: list[Arrival] = []
        self._number = 0

    def begin(self, job: Job, folder: Path, given: str, stated: int) -> Arrival:
        """Reserve a name and bytes, and make the folder that is written to (InputError: that is too much).

        `stated` is the size that the sender promises, 0 if it does not.
        """
        file = safe_name(given, self._limits.name)
        self._check_name(job, file)
        if len(job.uploads) + len(self.of(job.id)) >= self._limits.files:
            raise InputError(f"A diagnosis takes at most {self._limits.files} recordings.", culprit=file)
        self._number += 1
        arrival = Arrival(job.id, folder / ARRIVING / str(self._number) / file, 0)
        self.grow(job, arrival, stated)
        check_disk(arrival.path, stated)
        for path in (folder / ARRIVING, arrival.path.parent):
            path.mkdir(CLOSED, exist_ok=True)
        self._coming.append(arrival)
        return arrival

    def grow(self, job: Job, arrival: Arrival, size: int) -> None:
        """Reserve more bytes for a recording, some in advance where there is room for them (InputError)."""
        others = sum(one.reserved for one in self.of(job.id) if one is not arrival)
        left = min(self._limits.file, self._limits.job - others - sum(one.size for one in job.uploads))
        check_size(arrival.file, size, left)
        ahead = max(2 * arrival.reserved, GROWTH) if arrival.reserved else size
        arrival.reserved = max(size, min(ahead, left))

    def end(self, arrival: Arrival) -> None:
        """Let go of name and bytes."""
        if arrival in self._coming:
            self._coming.remove(arrival)

    def of(self, job: str) -> list[Arrival]:
        """What is on its way to a job."""
        return [one for one in self._coming if one.job == job]

    def refuse(self, job: str, reason: str) -> None:
        """Take nothing more of what is on its way to a job."""
        for one in self.of(job):
            one.refused = reason

    def _check_name(self, job: Job, file: str) -> None:
        """Refuse a name that another one has; some systems do not tell a.csv from A.csv."""
        if any(one.file.casefold() == file.casefold() for one in job.uploads):
            raise InputError(f"There is a recording {file} already; remove it first, or rename this one.", culprit=file)
        if any(one.file.casefold() == file.casefold() for one in self.of(job.id)):
            text = f"A recording {file} is being uploaded already; wait until it is there, or rename this one."
            raise InputError(text, culprit=file)


async def receive(chunks: AsyncIterator[bytes], arrival: Arrival, grow: Callable[[Arrival, int], None]) -> int:
    """Write what comes and return its size (InputError: it is too much, or is not taken any more; OSError).

    `grow` reserves bytes before they are written.
    """
    size = 0
    with arrival.path.open("xb") as file:
        async for chunk in chunks:
            size += len(chunk)
            if size > arrival.reserved:
                grow(arrival, size)
            if arrival.refused:
                raise InputError(arrival.refused, culprit=arrival.file)
            file.write(chunk)
    return size
