"""How much a recording may hold: what is larger is refused in a sentence before it is read into memory.

A file from outside must cost bounded memory and time, whatever it claims to hold.
"""

from pathlib import Path

from cosim.support.errors import RecordingError
from cosim.support.files import in_bytes

COLUMNS = 10_000
"""Columns of a table. A servo log has some tens; a thousandfold of that is no log of an axis."""
TEXT = 1_000_000_000
"""Bytes of text, uncompressed: two hours of ten columns at 1 kHz. What is longer belongs into Parquet."""
CELLS = 250_000_000
"""Numbers of a table in memory: 2 GB as doubles."""
TRUSTED, RATIO = 100_000_000, 50
"""Beyond so many bytes, text that was packed more than so many times denser is no measurement: those pack 3 to 20
times."""
NAME, LISTED = 60, 20
"""Characters of a name, and names of a list, that a message prints."""
LARGEST = 1e30
"""Largest magnitude of a sample: the square of what is larger than 1e154 is no number any more; no axis needs 1e30."""


def check_columns(path: Path, count: int) -> None:
    """Refuse a table of too many columns (RecordingError)."""
    if count > COLUMNS:
        text = f"{path} has {count:,} columns; a recording has at most {COLUMNS:,}. Export the columns that are needed."
        raise RecordingError(text, culprit=str(path), value=count)


def check_cells(path: Path, rows: int, columns: int) -> None:
    """Refuse a table that is too wide, or of more numbers than memory is meant to hold (RecordingError)."""
    check_columns(path, columns)
    if rows * columns > CELLS:
        text = (
            f"{path} holds {rows:,} rows of {columns:,} columns; at most {CELLS:,} numbers are read. Cut it in pieces."
        )
        raise RecordingError(text, culprit=str(path), value=rows * columns)


def check_text(path: Path, size: int, packed: int = 0) -> None:
    """Refuse text that is too long, or that was packed denser than any measurement (RecordingError)."""
    if packed and size > TRUSTED and size > RATIO * packed:
        text = f"{path} unpacks to more than {RATIO} times its {in_bytes(packed)}: hardly a measurement;"
        raise RecordingError(f"{text} if it is one, unpack it first.", culprit=str(path), value=size)
    if size > TEXT:
        text = f"{path} holds more than {in_bytes(TEXT)} of text; write it as Parquet, or cut it in pieces."
        raise RecordingError(text, culprit=str(path), value=size)


def listed(names: tuple[str, ...]) -> str:
    """Join names for a message, which stays short however many and long they are."""
    more = f" and {len(names) - LISTED:,} more" if len(names) > LISTED else ""
    return ", ".join(short(name) for name in names[:LISTED]) + more


def short(name: str) -> str:
    """Cut a name to what a message can hold, on one line."""
    line = " ".join(name.split()) if name.strip() else name
    return line if len(line) <= NAME else line[: NAME - 3] + "..."
