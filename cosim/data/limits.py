"""What reading a file may cost, whatever it claims to hold: one rule for all readers.

A file of up to 50 MB may unpack to 200 MB (25 million numbers) and keep a processor busy for 10 s; a larger one to
four times its size, in as much more time, and to 2 GB at most. Measured logs unpack to one to four times their size.
A reader checks what the file declares before it takes memory, and what it unpacked and used between two pieces of
work; `--layout limit=3` allows three times as much. A refusal names the number that would do.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import thread_time

from cosim.support.errors import RecordingError
from cosim.support.files import in_bytes
from cosim.support.numbers import whole

LIMIT = "limit"
"""Key of `--layout`: the factor by which every limit here is raised."""
RAISED = 1000
"""The largest such factor."""
ORDINARY = 50_000_000
"""Bytes of a file from which on limits grow with its size."""
UNPACKED = 200_000_000
"""Bytes to which an ordinary file may unpack: with what is made of them a command stays below 1 GB."""
MOST = 2_000_000_000
"""Bytes to which any file may unpack."""
SECONDS = 10.0
"""Seconds of a processor for an ordinary file; a log of 50 MB as text takes 2."""
COLUMNS = 10_000
"""Columns of a table. A servo log has some tens; a thousandfold of that is no log of an axis."""
NUMBER = 8
"""Bytes of a number in memory."""
TEXT = 1_000_000_000
"""Bytes of text, uncompressed: two hours of ten columns at 1 kHz. What is longer belongs into Parquet."""
NAME, LISTED = 60, 20
"""Characters of a name, and names of a list, that a message prints."""
LARGEST = 1e30
"""Largest magnitude of a sample: the square of what is larger than 1e154 is no number any more; no axis needs 1e30."""


@dataclass(frozen=True)
class Allowance:
    """What reading one file may cost.

    Args:
        size: bytes of the file.
        raised: the factor that `--layout limit` says.
        unpacked: bytes that it may unpack to.
        seconds: time of this thread's processor that it may take.
        began: that time when reading began [s].
    """

    size: int
    raised: int
    unpacked: float
    seconds: float
    began: float = field(default_factory=thread_time)

    @classmethod
    def of(cls, size: int, raised: int = 1) -> "Allowance":
        """Return what a file of a size may cost."""
        share = max(1.0, size / ORDINARY)
        return cls(size, raised, raised * min(UNPACKED * share, MOST), raised * SECONDS * share)


_CURRENT: ContextVar[Allowance | None] = ContextVar("allowance", default=None)


@contextmanager
def within(allowed: Allowance) -> Iterator[None]:
    """Let the checks below hold for a file that is read within the block, from now on."""
    token = _CURRENT.set(replace(allowed, began=thread_time()))
    try:
        yield
    finally:
        _CURRENT.reset(token)


def allowed_by(path: Path, raised: str = "") -> Allowance:
    """Return what a file may cost; `raised` is what `--layout limit` says.

    Raises:
        RecordingError: `raised` is no whole number from 1 to 1000.
    """
    factor = whole(raised or "1") or 0
    if not 1 <= factor <= RAISED:
        text = f"--layout {LIMIT}={short(raised)}: it is the factor by which limits are raised, from 1 to {RAISED:,}."
        raise RecordingError(text, culprit=LIMIT, value=raised)
    return Allowance.of(path.stat().st_size, factor)


def allowance(path: Path) -> Allowance:
    """Return what the file that is being read may cost; outside of `within`, what any file of its size may."""
    return _CURRENT.get() or Allowance.of(path.stat().st_size if path.exists() else 0)


def check_columns(path: Path, count: int) -> None:
    """Refuse a table of too many columns (RecordingError)."""
    most = COLUMNS * allowance(path).raised
    if count > most:
        text = f"{path} has {count:,} columns; a recording has at most {most:,}. Export the columns that are needed"
        raise _refusal(path, text, count, count / most)


def check_cells(path: Path, rows: int, columns: int) -> None:
    """Refuse a table that is too wide, or of more numbers than its file may unpack to (RecordingError)."""
    check_columns(path, columns)
    most, held = allowance(path).unpacked / NUMBER, rows * columns
    if held > most:
        what = f"{rows:,} rows of {columns:,} columns" if columns != 1 else f"{rows:,} numbers"
        text = f"{path} holds {what}; of a file of its size at most {most:,.0f} numbers are read. Cut it in pieces"
        raise _refusal(path, text, held, held / most)


def check_unpacked(path: Path, size: float, what: str = "") -> None:
    """Refuse what takes more bytes in memory than its file may unpack to; `what` is the part (RecordingError)."""
    most = allowance(path).unpacked
    if size > most:
        text = (
            f"{path}{f': {what}' if what else ''} unpacks to {in_bytes(size)} or more; a file of its size "
            f"({in_bytes(allowance(path).size)}) may unpack to {in_bytes(most)}: it is hardly a measurement. If it is, "
            "unpack it first"
        )
        raise _refusal(path, text, size, size / most)


def check_text(path: Path, size: int) -> None:
    """Refuse text that is too long (RecordingError)."""
    most = TEXT * allowance(path).raised
    if size > most:
        text = f"{path} holds more than {in_bytes(most)} of text; write it as Parquet, cut it in pieces"
        raise _refusal(path, text, size, size / most)


def check_time(path: Path) -> None:
    """Refuse a file that took too much of a processor so far; called between two pieces of work (RecordingError)."""
    if is_late(allowance(path)):
        raise over_time(path)


def over_time(path: Path) -> RecordingError:
    """The refusal of a file that takes too much of a processor."""
    most = allowance(path).seconds
    text = f"{path} took more than {most:.3g} s of a processor to read; none of its size needs that"
    return _refusal(path, text, most, 3)


def over_memory(path: Path) -> RecordingError:
    """The refusal of a file whose reader ran out of the memory that it may take."""
    most = allowance(path).unpacked
    text = f"{path} takes more memory to read than what unpacks to {in_bytes(most)} does; none of its size needs that"
    return _refusal(path, text, most, 2)


def is_late(allowed: Allowance) -> bool:
    """Whether this thread used up the processor time of an allowance."""
    return thread_time() - allowed.began > allowed.seconds


def _refusal(path: Path, text: str, value: float, times: float) -> RecordingError:
    """A refusal with the factor that would have allowed `times` as much."""
    factor = math.ceil(times * allowance(path).raised)
    way = f", or raise the limits: --layout {LIMIT}={factor}." if factor <= RAISED else "."
    return RecordingError(f"{text}{way}", culprit=str(path), value=value)


def listed(names: tuple[str, ...]) -> str:
    """Join names for a message, which stays short however many and long they are."""
    more = f" and {len(names) - LISTED:,} more" if len(names) > LISTED else ""
    return ", ".join(short(name) for name in names[:LISTED]) + more


def several(count: int, one: str, many: str) -> str:
    """Say how many there are, "one row was" or "1,000 rows were"; `one` and `many` stand behind the number."""
    return f"{count:,} {many}" if count != 1 else f"one {one}"


def short(name: str) -> str:
    """Cut a name to what a message can hold, on one line."""
    line = " ".join(name.split()) if name.strip() else name
    return line if len(line) <= NAME else line[: NAME - 3] + "..."
