"""What a residual may follow: shapes of recorded quantities, by plain names, none of them an effect.

Smooth and general: waves over the position, speed, acceleration, time since the start and since the last reversal,
long hysteresis, user columns, and products of those with the position. Acceleration and way travelled no moment tells:
they are followed along the motion, as the plant's own states do (`learned_base.py`).

Columns of the axis' own loop are no causes: its torque, asked for or read elsewhere, and its set point. A set point of
the speed is a torque, too, where drag is all that an axis needs.

A cause acts beside the axis' own inertia, friction and load, which it still needs. Beside its own torque it needs none
of them: tau = k c + B b with B the motion (inertia, friction of either sign, drag, waves over the position), and what
B explains beside c is small against what it explains alone. Torque then follows torque, which foretells nothing.

A set point is what the axis follows: its motion (q, v, a) tells most of it. Such a column may still be a cause, as a
neighbour that moves along; but in a loop tau = k (c - q) - d v, so with the set point, the position and the speed, B
is needed half as much as with these two alone, and beside a cause as much as before. What is named for a set point
needs no such proof, and what is named for the motion of a neighbour is none.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cosim.data.roles import is_named
from cosim.diagnosis.decide.policy import POLICY
from cosim.estimation.discrepancy_basis import last_reversal, stop_operators
from cosim.estimation.prepare import Array, Piece, Prepared
from cosim.estimation.row_weights import CLEAR_MOTION
from cosim.estimation.rowwise import recurrence
from cosim.support.statistics import ROUNDING, column_rms
from pyfmi_models.effects.learned_base import SEEN_WITHIN

FEW = 4
"""Waves over a column beside position and speed, whose range is seldom filled, and over positions in its products."""
OF_LAW = ("speed", "rate of torque")
"""Terms that say nothing of the unknown: a friction law's own misfit, and time stamps a fraction of a sample off."""
LOAD_WAVES = 3
"""Waves of a load over the range of positions: a weight on half a turn, or a spring, is one and a half of them."""
TURN = 5e-4
"""Share of the range of positions by which a motion must come back to count as reversed."""

Column = Callable[[Piece], Array]
Maker = Callable[[Piece], list[Array]]


@dataclass(frozen=True)
class Term:
    """Shapes of one quantity, made from any piece, scaled as in training."""

    make: Maker
    scale: Array
    """RMS of each shape in training."""

    def columns(self, prepared: Prepared) -> Array:
        """Shapes at the kept rows, (rows, n)."""
        return made(prepared, self.make) / self.scale


def dictionary(prepared: Prepared) -> dict[str, Term]:
    """What was recorded, by plain names."""
    makers = {**_of_speed(prepared), **_waves_of("time since the start", _passed, prepared, 4), **_of_columns(prepared)}
    if prepared.has_position:
        of_place = _waves_of("position", _place(prepared), prepared, 8)
        makers |= {**of_place, **_of_reversals(prepared), **_products(prepared)}
    return {name: Term(make, column_rms(made(prepared, make))) for name, make in makers.items()}


def _waves_of(name: str, x: Column, prepared: Prepared, count: int) -> dict[str, Maker]:
    """Waves over a quantity from 0 to 1, as a torque and as a friction level."""
    sign = _sign(prepared)
    by_level = {f"friction level over {name}": lambda p: [wave * sign(p) for wave in _waves(x(p), count)]}
    return {name: lambda p: _waves(x(p), count), **by_level}


def _passed(p: Piece) -> Array:
    return np.asarray((p.t - p.t[0]) / (p.t[-1] - p.t[0]))


def _of_speed(prepared: Prepared) -> dict[str, Maker]:
    top = max(abs(edge) for edge in prepared.ranges["v"])
    needed = _needed(prepared)
    most = max(float(np.abs(needed(piece)).max()) for piece in prepared.pieces) + 1e-300
    hard = max(float(np.abs(piece.a).max()) for piece in prepared.pieces)
    return {
        "speed": lambda p: [np.tanh(p.v / (s * top)) for s in (0.01, 0.05, 0.2, 1.0)] + [p.v * np.abs(p.v)],
        "speed whatever its direction": lambda p: [np.abs(p.v) / top, (p.v / top) ** 2],
        "acceleration": lambda p: [p.a * np.abs(p.a) / hard**2, np.abs(p.a) / hard, np.tanh(4 * p.a / hard)],
        "acceleration and speed": lambda p: [p.a * np.abs(p.v), p.a * p.v, p.v * np.abs(p.a)],
        "rate of torque": lambda p: [np.gradient(p.tau, p.dt)],
        "torque": lambda p: [np.tanh(needed(p) / (s * most)) for s in (0.02, 0.05, 0.1, 0.2)],
    }


def _needed(prepared: Prepared) -> Column:
    """Torque that the motion needs, by least squares on inertia, friction and a constant.

    Not the recorded torque: what is missing is in that one, and would seem to follow it.
    """
    sign = _sign(prepared)

    def columns(p: Piece) -> Array:
        return np.column_stack([p.a, sign(p), p.v, np.ones_like(p.v)])

    rows = np.concatenate([columns(piece)[piece.kept] for piece in prepared.pieces])
    beta = np.linalg.lstsq(rows, prepared.stacked("tau"), rcond=1e-9)[0]
    return lambda p: np.asarray(columns(p) @ beta)


def _of_reversals(prepared: Prepared) -> dict[str, Maker]:
    """Memory of the last reversal that fades with time, or with the way; elastic iron over long strokes."""
    reach = float(np.ptp(prepared.ranges["q"]))

    def by_time(p: Piece) -> list[Array]:
        turned, direction = last_reversal(p.q, TURN * reach)
        return [direction * np.exp(-(p.t - p.t[turned]) / fade) for fade in (0.1, 0.2, 0.4, 0.8, 1.6)]

    def by_distance(p: Piece) -> list[Array]:
        turned, direction = last_reversal(p.q, TURN * reach)
        way = np.abs(p.q - p.q[turned]) / reach
        return [direction * np.exp(-way / fade) for fade in (0.003, 0.01, 0.03, 0.1)]

    return {
        "time since reversal": by_time,
        "distance since reversal": by_distance,
        "hysteresis over a long stroke": lambda p: [*stop_operators(p, reach * np.array([0.1, 0.2, 0.4, 0.8])).T],
    }


def _of_columns(prepared: Prepared) -> dict[str, Maker]:
    """User columns, offered as causes: alone, as a friction level, and with the speed."""
    sign = _sign(prepared)

    def by(column: Column) -> Maker:
        return lambda p: [column(p), column(p) * sign(p), column(p) * p.v]

    return {name: by(column) for name, column in user_columns(prepared).items()}


def _products(prepared: Prepared) -> dict[str, Maker]:
    """Products of position and user columns, without what goes with either of the two alone."""
    sign, place = _sign(prepared), _place(prepared)

    def by(other: Column) -> Maker:
        def make(p: Piece) -> list[Array]:
            own = [wave * other(p) for wave in _waves(place(p), FEW)]
            return [*own, *(wave * sign(p) for wave in own)]

        return make

    return {f"position and {name}": by(column) for name, column in user_columns(prepared).items()}


class FurtherColumns(NamedTuple):
    """Names of further columns: possible causes, this axis' torque again, its set point again."""

    causes: tuple[str, ...]
    torque: tuple[str, ...]
    set_point: tuple[str, ...]


def further_columns(prepared: Prepared) -> FurtherColumns:
    """Part the columns that vary and are no plain copy of the motion."""
    common = set.intersection(*(set(piece.extras) for piece in prepared.pieces)) - {"q_d", "v"}
    useful: dict[str, Array] = {}
    for name in sorted(common):
        whole = np.concatenate([piece.extras[name] for piece in prepared.pieces])
        if np.ptp(whole) > ROUNDING * np.abs(whole).max():  # what only changes later foretells nothing
            column = np.concatenate([piece.lowpass(piece.extras[name])[piece.kept] for piece in prepared.pieces])
            useful |= {} if _repeats(prepared, column) else {name: column}
    torque = own_torque(prepared, useful)
    rest = {name: column for name, column in useful.items() if name not in torque}
    set_point = own_set_point(prepared, rest)
    return FurtherColumns(tuple(name for name in rest if name not in set_point), torque, set_point)


def user_columns(prepared: Prepared) -> dict[str, Column]:
    """Possible causes, centred, of unit size."""

    def centred(name: str) -> Column:
        whole = np.concatenate([piece.extras[name] for piece in prepared.pieces])
        mean, size = float(whole.mean()), float(whole.std()) + 1e-300
        return lambda p: np.asarray((p.extras[name] - mean) / size)

    return {name: centred(name) for name in further_columns(prepared).causes}


def _repeats(prepared: Prepared, column: Array) -> bool:
    """Whether a column is the torque, or the motion, under another name or in another unit: then it is no cause.

    These leave nothing that matters of it.
    """
    known = np.column_stack([*(prepared.stacked(one) for one in ("tau", "q", "v", "a")), np.ones(len(column))])
    own = column - column.mean()
    left = own - known @ np.linalg.lstsq(known, own, rcond=1e-9)[0]
    return bool(left @ left <= POLICY.negligible * (own @ own))


def _sign(prepared: Prepared) -> Column:
    top = max(abs(edge) for edge in prepared.ranges["v"])
    return lambda p: np.tanh(p.v / (0.003 * top))


def _place(prepared: Prepared) -> Column:
    """Position, 0 to 1."""
    low, high = prepared.ranges["q"]
    return lambda p: np.asarray((p.q - low) / (high - low))


def _waves(x: Array, count: int) -> list[Array]:
    return [np.cos(np.pi * k * x) for k in range(1, count + 1)]


def made(prepared: Prepared, make: Maker) -> Array:
    """What a maker makes at the kept rows of all pieces, filtered."""
    parts = []
    for piece in prepared.pieces:
        shapes = make(piece)
        rows = piece.lowpass(np.column_stack(shapes))[piece.kept] if shapes else np.empty((len(piece.kept), 0))
        parts.append(rows)
    return np.concatenate(parts)


def followed(name: str, piece: Piece) -> Array:
    """The acceleration or the way travelled at all rows of a piece."""
    if name == "way":
        return np.concatenate([[0.0], np.cumsum(np.abs(piece.v[1:] + piece.v[:-1]) / 2 * piece.dt)])
    keep = np.exp(-piece.dt / SEEN_WITHIN)
    middle = np.concatenate([[0.0], (piece.v[1:] + piece.v[:-1]) / 2])
    past = recurrence(np.full(len(middle), keep), (1 - keep) * middle[None])[0, 1:]
    return np.asarray((piece.v - past) / SEEN_WITHIN)


def own_torque(prepared: Prepared, columns: Mapping[str, Array]) -> tuple[str, ...]:
    """Return the names of the columns that are the torque of this axis again, though not in every sample.

    `columns` are values of each at the kept rows, (rows,), low-passed as the torque is. No name where motion explains
    hardly anything of the torque: then nothing tells them.
    """
    tau, motion = prepared.stacked("tau"), _motion(prepared)
    level = np.ones((len(tau), 1))
    alone, moved = _energy_left(level, tau), _energy_left(np.column_stack([level, motion]), tau)
    if alone - moved <= POLICY.small * alone:
        return ()

    def is_torque(column: Array) -> bool:
        beside = np.column_stack([level, column])
        needed = _energy_left(beside, tau) - _energy_left(np.column_stack([beside, motion]), tau)
        return needed < POLICY.small * (alone - moved)

    return tuple(name for name, column in columns.items() if is_torque(column))


def own_set_point(prepared: Prepared, columns: Mapping[str, Array]) -> tuple[str, ...]:
    """Return the names of the columns that are the set point of this axis under another name; arguments as above."""
    tau, motion = prepared.stacked("tau"), _motion(prepared)
    state = np.column_stack([np.ones_like(tau), *(prepared.stacked(name) for name in "qv")])
    moved = np.column_stack([state, prepared.stacked("a")])

    def needed(beside: Array) -> float:
        return _energy_left(beside, tau) - _energy_left(np.column_stack([beside, motion]), tau)

    alone = needed(state)

    def is_followed(column: Array) -> bool:
        return _energy_left(moved, column) <= POLICY.half * _energy_left(state[:, :1], column)

    def closes_loop(column: Array) -> bool:
        return needed(np.column_stack([state, column])) <= POLICY.half * alone

    theirs = {name for one in prepared.neighbours_recorded for name in (one.position, one.speed, one.acceleration)}
    alike = {name: one for name, one in columns.items() if name not in theirs and is_followed(one)}
    asks = {name for name in alike if is_named(name, "asked") and is_named(name, "position", "speed")}
    return tuple(name for name, one in alike.items() if name in asks or closes_loop(one))


def _motion(prepared: Prepared) -> Array:
    """What an axis' own motion may ask of its torque, (rows, n)."""
    v = prepared.stacked("v")
    sign = np.tanh(v / (CLEAR_MOTION * np.abs(v).max() + 1e-300))
    shapes = [prepared.stacked("a"), sign, v]
    if prepared.has_position:
        low, high = prepared.ranges["q"]
        place = (prepared.stacked("q") - low) / (high - low)
        shapes += [np.cos(np.pi * k * place) for k in range(1, LOAD_WAVES + 1)]
    return np.column_stack(shapes)


def _energy_left(columns: Array, tau: Array) -> float:
    scaled = columns / (column_rms(columns) + 1e-300)
    rest = tau - scaled @ np.linalg.lstsq(scaled, tau, rcond=1e-9)[0]
    return float(rest @ rest)
