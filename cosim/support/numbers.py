"""Bounds of numbers that a file may give: beyond them arithmetic, counting or memory would fail, not physics."""

from typing import Annotated

from pydantic import Field

COUNT = 2**53
"""The most ticks or rows: every whole number up to it is a double, so that time is counted exactly."""
SHORTEST, LONGEST = 1e-15, 1e12
"""Of a step and of a run in s: a femtosecond, and thirty thousand years."""
SHOWN = 60
"""Characters of a value that a message shows."""

Count = Annotated[int, Field(ge=1, le=COUNT)]
Seconds = Annotated[float, Field(gt=0, le=LONGEST)]
Step = Annotated[float, Field(ge=SHORTEST, le=LONGEST)]


def whole(text: str) -> int | None:
    """Return the number that a text of digits says; nothing where it says none, or one beyond `COUNT`."""
    said = text.isascii() and text.isdigit() and len(text) < len(str(COUNT))
    return int(text) if said else None


def shown(value: object) -> str:
    """Write a value as it stands in a file, cut short where it is long."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # more digits than Python writes, or nested too deeply
        text = f"a {type(value).__name__}"
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}... ({len(text):,} characters)"
