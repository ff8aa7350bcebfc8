"""Pushes against an end stop: rows that no equation of a moving axis describes.

At an end of the travel the axis hardly moves while the torque pushes outward by more than it usually is:

    s (tau - model) > `STRONG` median |tau|,   |v| small,   s q within `DEPTH` of the end,   s = 1 or -1

and a little further in it does not. What grows with the position (a load, a cable) does so all the way.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cosim.data.recording import Recording
from cosim.estimation.prepare import Array, Prepared, choose_cutoff, prepare
from cosim.estimation.problem import Problem
from cosim.estimation.row_weights import CLEAR_MOTION, weights
from pyfmi_models.mount import Mount

STRONG = 1.5
"""Torque of a push, relative to the usual one: at rest friction holds no more than in motion by half. Unit: 1."""
DEPTH = 0.03
"""How far from the end of the travel a contact is looked for, relative to the travel. Unit: 1."""
SLOW = 5 * CLEAR_MOTION
"""Speed below which an axis hardly moves, relative to its highest one: a stop gives way a little. Unit: 1."""
STEEP = 3.0
"""How much more torque the contact must take than the model lacks between one and three `DEPTH` from the end: of what
goes with the square of the position that is 1.1. Unit: 1."""
HELD = 0.5
"""Share of a visit to the end in which it must push: an axis that works there moves. Unit: 1."""
CELL = 0.05
"""Seconds over which a first look averages. Unit: s."""
MOST = 0.9
"""Quantile of what the model lacks there: a load or a cable shows in it, a bounce off the stop does not. Unit: 1."""
LEAST_SECONDS = 0.1
"""Seconds of pushing below which it is an overshoot. Unit: s."""
ROUNDS = 4
"""Refits without the rows of the pushes: these spoil the fit by which they are found."""

Rows = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Push:
    """A contact at one end of the travel: position, torque [N m, N], spans of time by the number of the recording."""

    at: float
    torque: float
    spans: tuple[tuple[int, float, float], ...]

    @property
    def seconds(self) -> float:
        """How long it pushes in all."""
        return sum(end - start for _, start, end in self.spans)


def pushes(recordings: Sequence[Recording], mount: Mount) -> tuple[Push, ...]:
    """Contacts at the ends of the travel; the base is refitted without them until no further one is found."""
    if not _may_push(recordings):
        return ()
    prepared = prepare(recordings, choose_cutoff(recordings, float(mount.axis.inertia)))
    problem = Problem(mount, prepared, weights(mount.friction, prepared), max(one.sample_time for one in recordings))
    base, found = problem.fit(mount, 30), tuple[Push, ...]()
    for _ in range(ROUNDS):
        now = tuple(_contacts(prepared, base.residual))
        if now == found:
            break
        found = now
        base = replace(problem, weight=problem.weight * ~_touched(prepared, now)).fit(base.mount, 30)
    return found


def _may_push(recordings: Sequence[Recording]) -> bool:
    """Whether any recording holds at an end what could be a push, judged by means over `CELL` seconds: no fit."""
    if not all("q" in one for one in recordings):
        return False
    cells = [_cells(one) for one in recordings]
    q, v, tau = (np.concatenate(columns) for columns in zip(*cells, strict=True))
    return any(_outward(q, v, tau, tau, side).any() for side in (1, -1))


def _cells(recording: Recording) -> tuple[Array, Array, Array]:
    """Means of position, speed and torque over cells of time."""
    rows = max(1, round(CELL / recording.sample_time))
    count = len(recording) // rows
    q, tau = (recording[name][: count * rows].reshape(count, rows).mean(axis=1) for name in ("q", "tau"))
    return q, np.gradient(q, rows * recording.sample_time), tau


def without(recordings: Sequence[Recording], found: Sequence[Push]) -> list[Recording]:
    """The recordings, with nothing judged while they push against a stop."""
    spans = [[span[1:] for one in found for span in one.spans if span[0] == k] for k in range(len(recordings))]
    return [replace(one, masked=(*one.masked, *more)) for one, more in zip(recordings, spans, strict=True)]


def _outward(q: Array, v: Array, tau: Array, torque: Array, side: int) -> Rows:
    """Rows at one end where the axis hardly moves and a torque pushes outward by much more than is usual."""
    outward = side * np.where(side * torque < side * tau, torque, tau)  # at rest a law may have friction's wrong sign
    slow, strong = np.abs(v) < SLOW * np.abs(v).max(), outward > STRONG * np.median(np.abs(tau))
    return np.asarray((_inwards(q, side) < DEPTH) & slow & strong)


def _inwards(q: Array, side: int) -> Array:
    """How far each row is from the end of the travel, relative to the travel."""
    return np.asarray(((side * q).max() - side * q) / max(float(np.ptp(q)), 1e-300))


def _contacts(prepared: Prepared, residual: Array) -> Iterator[Push]:
    q, v, tau = (prepared.stacked(name) for name in ("q", "v", "tau"))
    for side in (1, -1):
        pushing, way = _outward(q, v, tau, residual, side), _inwards(q, side)
        inner = (way > DEPTH) & (way < 3 * DEPTH)
        spans = tuple(_spans(prepared, way < DEPTH, pushing))
        if not spans or not inner.any():
            continue
        torque = float(np.median(side * residual[pushing]))
        if torque > STEEP * float(np.quantile(side * residual[inner], MOST)):
            yield Push(float(q[pushing].mean()), torque, spans)


def _spans(prepared: Prepared, near: Rows, pushing: Rows) -> Iterator[tuple[int, float, float]]:
    """Visits to an end that push long enough: number of the recording, start, end."""
    first = 0
    for piece in prepared.pieces:
        rows = slice(first, first + len(piece.kept))
        first, t = rows.stop, piece.t[piece.kept]
        edges = np.flatnonzero(np.diff(np.concatenate([[0], near[rows].astype(np.int8), [0]])))
        for start, end in edges.reshape(-1, 2).tolist():
            held = pushing[rows][start:end]
            if held.mean() >= HELD and held.sum() * piece.dt * piece.stride >= LEAST_SECONDS:
                yield piece.recording, float(t[start]), float(t[end - 1])


def _touched(prepared: Prepared, found: Sequence[Push]) -> Rows:
    """Kept rows in a span, or less than half a period of the cutoff beside one."""
    t, number, margin = prepared.stacked("t"), prepared.recording_of, 0.5 / prepared.cutoff
    rows = np.zeros(len(t), bool)
    for recording, start, end in (span for one in found for span in one.spans):
        rows |= (number == recording) & (t > start - margin) & (t < end + margin)
    return rows
