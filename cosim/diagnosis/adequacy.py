"""Is the rest noise? If not, what does it depend on?

A smooth, general model of each recorded quantity is offered to what the chosen structure leaves; the share of
cross-validated energy it would remove says how much physics is still missing, and on what it depends. No name is
attached.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from cosim.diagnosis.fit import Fit
from cosim.diagnosis.prepare import Array, Piece, Prepared
from cosim.diagnosis.structure import Bench

UNEXPLAINED = 0.15
"""Share of the cross-validated energy above which the rest is called unexplained."""
LEAST_T = 2.0
LEAST_PLAIN = 0.10
"""... if a plain fit agrees that at least this share of the residual energy follows the quantity."""


@dataclass(frozen=True)
class Rest:
    """How much of the rest follows each quantity: gain, and t over blocks."""

    gain: dict[str, float]
    t: dict[str, float]

    @property
    def depends_on(self) -> tuple[str, ...]:
        """Quantities that explain a substantial share of the rest, strongest first."""
        named = [name for name, gain in self.gain.items() if gain > UNEXPLAINED and self.t[name] > LEAST_T]
        return tuple(sorted(named, key=lambda name: -self.gain[name]))


def rest_of(chosen: Fit, prepared: Prepared, bench: Bench) -> Rest:
    """Measure on what the residual of a structure depends."""
    shapes = _dictionary(prepared)
    scores = bench.screen(chosen, list(shapes.values()), [""] * len(shapes))
    plain = {name: _share(chosen.residual, columns) for name, columns in shapes.items()}
    gains = {
        name: score.gain if plain[name] > LEAST_PLAIN else min(score.gain, plain[name])
        for name, (score, _) in zip(shapes, scores, strict=True)
    }
    return Rest(gains, {name: score.t for name, (score, _) in zip(shapes, scores, strict=True)})


def _share(target: Array, columns: Array) -> float:
    scaled = columns / (np.sqrt((columns**2).sum(0)) + 1e-300)
    beta = np.linalg.lstsq(scaled, target, rcond=1e-6)[0]
    return float(1 - np.sum((target - scaled @ beta) ** 2) / np.sum(target**2))


def _dictionary(prepared: Prepared) -> dict[str, Array]:
    low, high = prepared.ranges["q"]
    top = max(abs(edge) for edge in prepared.ranges["v"])
    hard = max(float(np.abs(piece.a).max()) for piece in prepared.pieces)
    makers: dict[str, Callable[[Piece], list[Array]]] = {
        "q": lambda p: _waves((p.q - low) / (high - low)),
        "q, sign(v)": lambda p: [w * np.tanh(p.v / (0.003 * top)) for w in _waves((p.q - low) / (high - low))],
        "v": lambda p: [np.tanh(p.v / (s * top)) for s in (0.01, 0.05, 0.2, 1.0)] + [p.v * np.abs(p.v)],
        "|v|": lambda p: [np.abs(p.v) / top, (p.v / top) ** 2],
        "a": lambda p: [p.a * np.abs(p.a) / hard**2, np.abs(p.a) / hard, np.tanh(4 * p.a / hard)],
        "a, v": lambda p: [p.a * np.abs(p.v), p.a * p.v, p.v * np.abs(p.a)],
        "time": lambda p: _waves((p.t - p.t[0]) / (p.t[-1] - p.t[0]), 4),
        "time, sign(v)": lambda p: [
            w * np.tanh(p.v / (0.003 * top)) for w in _waves((p.t - p.t[0]) / (p.t[-1] - p.t[0]), 4)
        ],
        "rate of torque": lambda p: [np.gradient(p.tau, p.dt)],
    }
    if not prepared.has_position:
        makers = {name: make for name, make in makers.items() if not name.startswith("q")}
    return {name: _columns(prepared, make) for name, make in (makers | _others(prepared)).items()}


def _others(prepared: Prepared) -> dict[str, Callable[[Piece], list[Array]]]:
    """User columns, offered as causes: alone, with the direction, with the speed."""
    common = set.intersection(*(set(piece.extras) for piece in prepared.pieces)) - {"q_d", "v"}
    return {name: partial(_user_columns, name) for name in sorted(common)}


def _user_columns(name: str, piece: Piece) -> list[Array]:
    column = _centred(piece, name)
    return [column, column * np.sign(piece.v), column * piece.v]


def _centred(piece: Piece, name: str) -> Array:
    column = piece.extras[name]
    return np.asarray((column - column.mean()) / (column.std() + 1e-300))


def _waves(x: Array, count: int = 8) -> list[Array]:
    return [np.cos(np.pi * k * x) for k in range(1, count + 1)]


def _columns(prepared: Prepared, make: Callable[[Piece], list[Array]]) -> Array:
    parts = [piece.lowpass(np.column_stack(make(piece)))[piece.kept] for piece in prepared.pieces]
    columns = np.concatenate(parts)
    return np.asarray(columns / (columns.std(0) + 1e-300))
