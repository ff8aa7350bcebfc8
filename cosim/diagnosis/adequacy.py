"""Is the rest noise? If not, what does it depend on? No name is attached.

Two questions, two measures of what the chosen structure leaves in clear motion:

- Is it large? Its slow part (means over `CELL` seconds), relative to the friction torque. Friction that is not quite
  the law's, a level that wanders, coloured noise: all that stays small. Nothing is compared between recordings, so a
  push that comes once is seen as well as one that always comes.
- What does it follow? A dictionary of recorded quantities predicts it on recordings that were not used for the fit.
  What follows none of them comes and goes with time, as a push or as a friction level.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cosim.diagnosis.bank import last_reversal, stop_operators
from cosim.diagnosis.fit import Fit
from cosim.diagnosis.prepare import Array, Piece, Prepared
from cosim.diagnosis.protocol import CLEAR_MOTION
from cosim.diagnosis.structure import Bench, projected

LARGE = 0.07
"""Share of the friction torque above which the rest is unexplained.

On generated nulls it was at most LIMITS; effects outside the list at full size leave LIMITS and more.
"""
CELL = 0.25
"""Seconds over which the rest is averaged: noise and presliding go, what lasts stays."""
LEAST_FRICTION = 0.1
"""Where friction is less than this share of the torque, that share of the torque stands for it."""
FOLLOWS = 0.15
"""Share of the rest that a quantity must predict on recordings it was not fitted to ..."""
BESIDE = 0.7
"""... and beside the best one: this share of what that predicts."""
KNOT = 1.0
"""Seconds between the knots of a torque, or a friction level, that is free over time."""
TURN = 5e-4
"""Share of the range of positions by which a motion must come back to count as reversed."""

Column = Callable[[Piece], Array]
Maker = Callable[[Piece], list[Array]]


@dataclass(frozen=True)
class Rest:
    """What a structure leaves: its size, how much of it follows each quantity, and how it goes over time."""

    share: float
    """Slow part of the rest in clear motion, relative to the friction torque (RMS)."""
    follows: dict[str, float]
    """Share of the rest that each quantity predicts on recordings it was not fitted to."""
    over_time: str
    """"time" (a push) or "friction level over time": what explains it better where nothing else does."""

    @property
    def unexplained(self) -> bool:
        """Whether something is missing."""
        return self.share > LARGE

    @property
    def depends_on(self) -> tuple[str, ...]:
        """What an unexplained rest goes with, strongest first; () if there is nothing to explain."""
        if not self.unexplained:
            return ()
        least = max(FOLLOWS, BESIDE * max(self.follows.values(), default=0.0))
        named = [name for name, share in self.follows.items() if share > least]
        return tuple(sorted(named, key=lambda name: -self.follows[name])) or (self.over_time,)


def rest_of(chosen: Fit, prepared: Prepared, bench: Bench) -> Rest:
    """Measure the residual of a structure, and on what it depends."""
    clear = bench.weight * _clear(prepared)
    share = _slow(chosen.residual, clear, prepared) / _friction(bench, clear, prepared)
    if not share > LARGE:
        return Rest(share, {}, "time")
    fold = np.empty(len(clear), int)
    for rows, number in zip(bench.blocks.rows, bench.blocks.fold, strict=True):
        fold[rows] = number
    follows = {name: _predicted(chosen, *columns, clear, fold) for name, columns in _dictionary(prepared).items()}
    return Rest(share, follows, _over_time(chosen.residual * clear, bench.nuisances.level * clear, prepared))


def _clear(prepared: Prepared) -> Array:
    v = np.abs(prepared.stacked("v"))
    return np.asarray(v > CLEAR_MOTION * v.max(), float)


def _friction(bench: Bench, clear: Array, prepared: Prepared) -> float:
    """RMS of the friction torque in clear motion."""
    level, torque = (_rms(one, clear) for one in (bench.nuisances.level, prepared.stacked("tau")))
    return max(level, LEAST_FRICTION * torque, 1e-300)


def _rms(values: Array, weight: Array) -> float:
    return float(np.sqrt((weight @ values**2) / max(weight.sum(), 1e-300)))


def _slow(values: Array, weight: Array, prepared: Prepared) -> float:
    """RMS of the means over cells of `CELL` seconds."""
    number = np.concatenate([np.full(len(piece.kept), k) for k, piece in enumerate(prepared.pieces)])
    time = np.floor(prepared.stacked("t") / CELL)
    _, cell = np.unique(np.column_stack([number, time]), axis=0, return_inverse=True)
    count, total = (np.bincount(cell.ravel(), one) for one in (weight, weight * values))
    return _rms(total / np.maximum(count, 1e-300), count)


def _predicted(chosen: Fit, alone: Array, columns: Array, weight: Array, fold: Array) -> float:
    """Share of the rest of each fold that columns fitted to the others predict.

    The structure's own parameters, and columns that count `alone`, are free in each fold.
    """
    known = np.column_stack([chosen.slopes, alone])
    base, added, rest = (one * weight[:, None] for one in (known, columns, chosen.residual[:, None]))
    before = after = 0.0
    for number in np.unique(fold):
        own, others = fold == number, fold != number
        free = projected(np.column_stack([rest, added])[others], base[others])
        beta = np.linalg.lstsq(free[:, 1:], free[:, 0], rcond=1e-6)[0]
        left = projected(np.column_stack([rest[own, 0], rest[own, 0] - added[own] @ beta]), base[own])
        before, after = before + float(left[:, 0] @ left[:, 0]), after + float(left[:, 1] @ left[:, 1])
    return 1 - after / max(before, 1e-300)


def _over_time(rest: Array, level: Array, prepared: Prepared) -> str:
    """Which explains more: a torque that is free over time, or a friction level that is."""
    left = {"time": 0.0, "friction level over time": 0.0}
    first = 0
    for piece in prepared.pieces:
        rows = slice(first, first + len(piece.kept))
        hats, first = _hats(piece.t[piece.kept]), rows.stop
        for name, factor in zip(left, (np.abs(level), level), strict=True):
            left[name] += float(np.sum(projected(rest[rows], hats * factor[rows, None]) ** 2))
    return min(left, key=lambda name: left[name])


def _hats(t: Array) -> Array:
    """Straight lines between knots every `KNOT` seconds: (rows, knots)."""
    count = max(2, round(float(t[-1] - t[0]) / KNOT))
    place = (t - t[0]) / (t[-1] - t[0]) * count
    return np.maximum(0.0, 1 - np.abs(place[:, None] - np.arange(count + 1)))


def _dictionary(prepared: Prepared) -> dict[str, tuple[Array, Array]]:
    """What was recorded, by plain names: columns (rows, n) that it must go beyond, and its own."""
    makers = {**_of_speed(prepared), **_of_time(prepared), **_of_columns(prepared)}
    if prepared.has_position:
        makers |= {**_of_position(prepared), **_of_reversals(prepared)}
    pairs = {name: ((lambda p: []), make) for name, make in makers.items()} | _products(prepared)
    return {name: (_columns(prepared, alone), _columns(prepared, make)) for name, (alone, make) in pairs.items()}


def _of_position(prepared: Prepared) -> dict[str, Maker]:
    sign, place = _sign(prepared), _place(prepared)
    return {
        "position": lambda p: _waves(place(p)),
        "friction level over position": lambda p: [wave * sign(p) for wave in _waves(place(p))],
    }


def _of_speed(prepared: Prepared) -> dict[str, Maker]:
    top = max(abs(edge) for edge in prepared.ranges["v"])
    hard = max(float(np.abs(piece.a).max()) for piece in prepared.pieces)
    return {
        "speed": lambda p: [np.tanh(p.v / (s * top)) for s in (0.01, 0.05, 0.2, 1.0)] + [p.v * np.abs(p.v)],
        "speed whatever its direction": lambda p: [np.abs(p.v) / top, (p.v / top) ** 2],
        "acceleration": lambda p: [p.a * np.abs(p.a) / hard**2, np.abs(p.a) / hard, np.tanh(4 * p.a / hard)],
        "acceleration and speed": lambda p: [p.a * np.abs(p.v), p.a * p.v, p.v * np.abs(p.a)],
        "rate of torque": lambda p: [np.gradient(p.tau, p.dt)],
    }


def _of_time(prepared: Prepared) -> dict[str, Maker]:
    sign = _sign(prepared)
    return {
        "time since the start": lambda p: _waves((p.t - p.t[0]) / (p.t[-1] - p.t[0]), 4),
        "friction level over time since the start": lambda p: [
            wave * sign(p) for wave in _waves((p.t - p.t[0]) / (p.t[-1] - p.t[0]), 4)
        ],
    }


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
    return {
        name: lambda p, own=column: [own(p), own(p) * sign(p), own(p) * p.v]  # type: ignore[misc]
        for name, column in _user_columns(prepared).items()
    }


def _products(prepared: Prepared) -> dict[str, tuple[Maker, Maker]]:
    """Products of position and user columns, and what they must go beyond: either of the two alone."""
    sign, place, found = _sign(prepared), _place(prepared), {}
    for name, column in _user_columns(prepared).items() if prepared.has_position else ():

        def alone(p: Piece, own: Column = column) -> list[Array]:
            return [shape * factor for shape in (place(p), own(p)) for factor in (1.0, sign(p))]

        def product(p: Piece, own: Column = column) -> list[Array]:
            return [own(p) * place(p), own(p) * place(p) * sign(p)]

        found[f"position and {name}"] = alone, product
    return found


def _user_columns(prepared: Prepared) -> dict[str, Column]:
    common = set.intersection(*(set(piece.extras) for piece in prepared.pieces)) - {"q_d", "v"}
    return {name: _centred(prepared, name) for name in sorted(common)}


def _centred(prepared: Prepared, name: str) -> Column:
    whole = np.concatenate([piece.extras[name] for piece in prepared.pieces])
    mean, size = float(whole.mean()), float(whole.std()) + 1e-300
    return lambda p: np.asarray((p.extras[name] - mean) / size)


def _sign(prepared: Prepared) -> Column:
    top = max(abs(edge) for edge in prepared.ranges["v"])
    return lambda p: np.tanh(p.v / (0.003 * top))


def _place(prepared: Prepared) -> Column:
    """Position, 0 to 1."""
    low, high = prepared.ranges["q"]
    return lambda p: np.asarray((p.q - low) / (high - low))


def _waves(x: Array, count: int = 8) -> list[Array]:
    return [np.cos(np.pi * k * x) for k in range(1, count + 1)]


def _columns(prepared: Prepared, make: Maker) -> Array:
    parts = []
    for piece in prepared.pieces:
        made = make(piece)
        rows = piece.lowpass(np.column_stack(made))[piece.kept] if made else np.empty((len(piece.kept), 0))
        parts.append(rows)
    columns = np.concatenate(parts)
    return np.asarray(columns / (columns.std(0) + 1e-300))
