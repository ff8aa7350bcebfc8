"""What a motion visits that no recording did: places at speeds, rests, strokes between reversals, accelerations.

An effect shows where it acts: a break-away after a rest, a play over a reversal, a drag at a speed. What is in question
without two structures to compare is sought in classes of motion that are new, of each kind alike.
"""

from collections.abc import Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cosim.estimation.prepare import Piece, Prepared
from cosim_investigation.limits import Limits

CELLS = 12
"""Classes of position."""
SLOWEST = 1e-3
"""Share of a limit below which speeds, and accelerations, are alike. Unit: 1."""
STANDS = 0.01
"""Share of the speed limit below which an axis stands: above what a reading's noise makes of rest, below a creep."""
SHORTEST_REST = 0.1
"""Rests that are shorter are reversals [s]."""
SHORTEST_STROKE = 0.01
"""Strokes that are shorter, as shares of the room, are alike. Unit: 1."""

Cells = Mapping[str, frozenset[tuple[int, ...]]]
"""Classes that were visited, by their kind."""


class _Run(NamedTuple):
    """Rows from one to before another in which an axis goes one way (-1, 1), or stands (0)."""

    way: int
    first: int
    after: int


def visited(prepared: Prepared, limits: Limits) -> Cells:
    """Classes of motion that recordings visited."""
    found = [_cells(piece, limits) for piece in prepared.pieces]
    return {kind: frozenset().union(*(one[kind] for one in found)) for kind in found[0]}


def new_ground(piece: Piece, seen: Cells, limits: Limits) -> float:
    """Share of the classes that a motion visits and no recording did, relative to its own; the mean of all kinds."""
    own = _cells(piece, limits)
    shares = [len(own[kind] - seen[kind]) / max(len(own[kind]), 1) for kind in own]
    return float(np.mean(shares))


def _cells(piece: Piece, limits: Limits) -> Cells:
    runs = _runs(piece, limits)
    return {
        "place": _places(piece, limits),
        "rest": _rests(piece, runs),
        "stroke": _strokes(piece, runs, limits),
        "acceleration": _accelerations(piece, limits),
    }


def _places(piece: Piece, limits: Limits) -> frozenset[tuple[int, ...]]:
    """Position and speed, which counts by its logarithm and direction."""
    place = np.floor(CELLS * (piece.q - limits.low) / (limits.high - limits.low)).astype(int)
    speed = np.abs(piece.v) / (SLOWEST * limits.speed)
    pace = np.floor(np.log2(np.maximum(speed, 1.0))).astype(int) * np.sign(piece.v).astype(int)
    both = np.column_stack([place, pace])[piece.inside]
    return frozenset(map(tuple, np.unique(both, axis=0).tolist()))


def _runs(piece: Piece, limits: Limits) -> list[_Run]:
    way = np.where(np.abs(piece.v) < STANDS * limits.speed, 0, np.sign(piece.v)).astype(int)
    turns = [0, *(np.flatnonzero(np.diff(way)) + 1).tolist(), len(way)]
    return [_Run(int(way[a]), a, b) for a, b in pairwise(turns) if b > a]


def _rests(piece: Piece, runs: list[_Run]) -> frozenset[tuple[int, ...]]:
    """How long it stood before it went on, by the logarithm."""
    stood = [piece.dt * (one.after - one.first) for one in runs[1:-1] if one.way == 0]
    return frozenset((round(float(np.log2(one))),) for one in stood if one >= SHORTEST_REST)


def _strokes(piece: Piece, runs: list[_Run], limits: Limits) -> frozenset[tuple[int, ...]]:
    """Ways from a stop to the next, by their logarithm and direction."""
    room = limits.high - limits.low
    ways = [(one.way, abs(piece.q[one.after - 1] - piece.q[one.first]) / room) for one in runs if one.way]
    return frozenset((way, round(float(np.log2(max(share, SHORTEST_STROKE))))) for way, share in ways)


def _accelerations(piece: Piece, limits: Limits) -> frozenset[tuple[int, ...]]:
    """The highest acceleration, by its logarithm: all that are lower are passed on the way there."""
    most = float(np.abs(piece.a[piece.inside]).max(initial=0.0)) / limits.acceleration
    top = max(round(float(np.log2(max(most, SLOWEST)))), -CELLS)
    return frozenset((power,) for power in range(-CELLS, top + 1))


__all__: list[str] = ["Cells", "new_ground", "visited"]
