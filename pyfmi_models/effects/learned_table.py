"""What a learned term tells a reader of itself: plain numbers, and the unit of its values."""

from typing import TypedDict


class LearnedTable(TypedDict, total=False):
    """A table over one or two quantities, a drive's curve, or the elements of a memory; `kind` says which.

    `value` is (at,) or (at, by_at), in `unit`; `missing` is what a drive does not give of `command` [N m or N].
    `strokes` and `ways` [rad or m] and `times` [s] are those of the elements of a memory.
    """

    kind: str
    unit: str
    over: str
    at: list[float]
    value: list[float] | list[list[float]]
    by: str
    by_at: list[float]
    command: list[float]
    missing: list[float]
    strokes: list[float]
    torque: list[float]
    ways: list[float]
    times: list[float]
    level_change: list[float]


__all__ = ["LearnedTable"]
