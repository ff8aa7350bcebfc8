"""What friction laws cannot agree on: shapes that any real contact may add to a fitted law.

A real contact is neither LuGre nor Coulomb. Its misfit has these shapes: bristles that slip at other distances (stop
operators) and a level that varies with speed in another way. Offered to the fit as nuisances with every candidate,
they keep an imprecise friction law from being taken for a missing effect; so does how torque changes with the level.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Array, Piece, Prepared
from cosim.support.kept import kept_with
from pyfmi_models.effects import PeriodicFriction
from pyfmi_models.mount import Mount

Index = npt.NDArray[np.int64]


def stop_distances(prepared: Prepared) -> Array:
    """Eight slip distances from a few resolvable steps to a fifth of the motion, evenly in the logarithm."""
    low, high = prepared.ranges["q"]
    steps = np.concatenate([np.abs(np.diff(piece.q)) for piece in prepared.pieces])
    smallest = max(float(np.median(steps)), 1e-6 * (high - low))
    return np.geomspace(smallest / 3, (high - low) / 5, 8)


def stop_operators(piece: Piece, distances: Array) -> Array:
    """Elastic up to a distance, then sliding: s <- clip(s + dq / distance, -1, 1); shape (rows, distances)."""
    out = np.empty((len(piece.q), len(distances)))
    out[0] = np.sign(piece.v[0])
    for first, last in pairwise([0, *_turns(piece.q), len(piece.q) - 1]):  # one way all rows are clipped at once
        moved = (piece.q[first + 1 : last + 1, None] - piece.q[first]) / distances
        out[first + 1 : last + 1] = np.clip(out[first] + moved, -1.0, 1.0)
    return out


def _turns(q: Array) -> Index:
    """Rows at which positions go on the other way."""
    moves = np.sign(np.diff(q))
    moving = np.flatnonzero(moves)
    return np.asarray(moving[1:][np.diff(moves[moving]) != 0])


def last_reversal(q: Array, least: float) -> tuple[Index, Array]:
    """Row from which the motion goes the other way, and its direction (+-1), at each row of positions q.

    A turn counts once the motion came back by `least`: a way, not a speed, so noise at rest reverses nothing. Before
    the first turn the row is 0.
    """
    turned, direction = np.zeros(len(q), np.int64), np.ones(len(q))
    ahead, start, extreme = 1.0, 0, float(q[0])
    for row, place in enumerate(q.tolist()):
        if ahead * (extreme - place) > least:
            ahead, start, extreme = -ahead, row, place
        extreme = max(ahead * extreme, ahead * place) * ahead
        turned[row], direction[row] = start, ahead
    return turned, direction


def since_reversal(x: Array, v: Array) -> Array:
    """Change of x, a time or a place, since the speed last changed its sign, or since the start, at each row."""
    turned = np.flatnonzero(np.diff(np.sign(v), prepend=np.sign(v[:1])) != 0)
    last = np.concatenate([[0], turned])[np.searchsorted(turned, np.arange(len(x)), side="right")]
    return np.asarray(x - x[last])


def speed_shapes(piece: Piece, top: float) -> Array:
    """Friction that falls with speed at three scales, (rows, 3); the sign is smoothed over 1e-3 of the top speed."""
    scales = top * np.array([0.03, 0.1, 0.3])
    sign = np.tanh(piece.v / (1e-3 * top))
    return np.asarray(sign[:, None] * np.exp(-((piece.v[:, None] / scales) ** 2)))


@kept_with()
def friction_curve(prepared: Prepared) -> Array:
    """Any friction over speed, alike both ways: eight cosines, finer ones smaller, at the kept rows, (rows, 8)."""
    top = max(abs(edge) for edge in prepared.ranges["v"])

    def waves(piece: Piece) -> Array:
        share, sign = np.abs(piece.v) / top, np.tanh(piece.v / (1e-3 * top))
        return np.column_stack([sign * np.cos(np.pi * k * share) / k for k in range(1, 9)])

    return np.concatenate([piece.lowpass(waves(piece))[piece.kept] for piece in prepared.pieces])


@kept_with()
def discrepancy_basis(prepared: Prepared) -> tuple[Array, Array]:
    """Return the stop operators and the speed shapes at the kept rows, filtered: (rows, 8) and (rows, 3)."""
    distances = stop_distances(prepared)
    top = max(abs(edge) for edge in prepared.ranges["v"])
    stops = [piece.lowpass(stop_operators(piece, distances))[piece.kept] for piece in prepared.pieces]
    speeds = [piece.lowpass(speed_shapes(piece, top))[piece.kept] for piece in prepared.pieces]
    return np.concatenate(stops), np.concatenate(speeds)


def friction_level(mount: Mount, prepared: Prepared) -> Array:
    """Derivative of the needed torque by a relative change of the friction level, at the kept rows."""
    if mount.friction.key == "none":
        return np.zeros(len(prepared.recording_of))
    scaled = PeriodicFriction(cycles_per_rev=0.0, relative_amplitude=0.0, phase=0.0)
    extended = replace(mount, effects=(*mount.effects, scaled))
    name = f"{list(extended.components())[-1]}.relative_amplitude"
    return stacked(Inverse(extended, (name,)), prepared.pieces, np.zeros(1))[1][:, 0]
