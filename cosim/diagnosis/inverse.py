"""The torque that a recorded motion needs, and how it changes with every parameter.

    needed(t) = D^-1 [ J a + contact(bristle, v, level) + viscous(v) + loads ],

with the bristle state integrated along the measured speed by the law's own closed-form step, and D the drive effects
undone in the frequency domain. The equations are those of the plant: the same objects, with measured motion put in.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt
from scipy.linalg import solve_banded

from cosim.diagnosis.prepare import Array, Piece
from cosim.diagnosis.rowwise import Rowwise, Stepwise
from pyfmi_models.effects import DriveEffect
from pyfmi_models.model import structure_of, symbols_of, with_symbols
from pyfmi_models.mount import Mount


@dataclass(frozen=True)
class Inverse:
    """Torque needed by a mount for a measured motion; `free` names the parameters that may vary."""

    mount: Mount
    free: tuple[str, ...]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters of the mount, in its order."""
        return tuple(variable.name for variable in self.mount.parameters())

    @cached_property
    def start(self) -> Array:
        """Present values of all parameters."""
        return np.array([variable.start for variable in self.mount.parameters()])

    @cached_property
    def _equations(self) -> "Equations":
        parts = [(type(part), *structure_of(part).values()) for part in self.mount.components().values()]
        key = (self.mount.motion, self.names, self.free, *parts)
        if key not in _KNOWN:
            _KNOWN[key] = Equations(self.mount, self.free)
        return _KNOWN[key]

    def torque(self, piece: Piece, values: Array) -> tuple[Array, Array]:
        """Return needed torque (rows,) and its derivatives (rows, free) at all rows of a piece, filtered once more."""
        full = self._with(values)
        torque, slopes = self._undriven(piece, full)
        columns = piece.lowpass(np.column_stack([torque, slopes]))
        columns, drive = self._undo_drive(columns, full, piece.dt)
        columns[:, 1:] += drive
        return columns[:, 0], columns[:, 1:]

    def _with(self, values: Array) -> Array:
        full = self.start.copy()
        full[[self.names.index(name) for name in self.free]] = values
        return full

    def _undriven(self, piece: Piece, full: Array) -> tuple[Array, Array]:
        motion = np.vstack([piece.t, piece.q, piece.v, piece.a])
        state, slopes = self._bristles(piece, full)
        out = self._equations.torque(np.vstack([motion, state]), full)
        torque, by_state, by_free = out[0], out[1 : 1 + len(state)], out[1 + len(state) :]
        for row, slope in zip(by_state, slopes, strict=True):
            by_free = by_free + row * slope
        return torque, by_free.T

    def _bristles(self, piece: Piece, full: Array) -> tuple[Array, list[Array]]:
        """Integrate the friction states along the motion; return them (states, rows) and their derivatives."""
        rows, count = len(piece.t), len(self.mount.friction.states())
        if count == 0:
            return np.zeros((0, rows)), []
        middle = [(x[1:] + x[:-1]) / 2 for x in (piece.t, piece.q, piece.v)]
        steps = np.vstack([*middle, np.full(rows - 1, piece.dt)])
        state = self._equations.step(steps, full)
        out = self._equations.step_slopes(np.vstack([steps, state[:, :-1]]), full)
        own, by_free = out[:count], out[count:].reshape(count, len(self.free), rows - 1)
        slopes = [_recurrence(decay, drift.T).T for decay, drift in zip(own, by_free, strict=True)]
        return state, slopes

    def _undo_drive(self, columns: Array, full: Array, dt: float) -> tuple[Array, Array]:
        """Undo the drive effects on all columns; return them and the torque's derivatives by the drive parameters."""
        values = dict(zip(self.names, full, strict=True))
        drives = {n: part for n, part in self.mount.components().items() if isinstance(part, DriveEffect)}
        slopes = np.zeros((len(columns), len(self.free)))
        if not drives:
            return columns, slopes
        spectrum = Spectrum(columns, dt)
        inverse = 1 / np.prod([_set(part, values, n).response(spectrum.omega) for n, part in drives.items()], axis=0)
        for column, name in enumerate(self.free):
            prefix = name.split(".")[0]
            if prefix in drives:
                bumped = values | {name: values[name] * 1.001}
                ratio = _set(drives[prefix], values, prefix).response(spectrum.omega)
                ratio = ratio / _set(drives[prefix], bumped, prefix).response(spectrum.omega)
                slopes[:, column] = spectrum.times(inverse * (ratio - 1) / (1e-3 * values[name]))[:, 0]
        return spectrum.times(inverse), slopes


class Equations:
    """Compiled expressions of a structure; numbers are parameters, so one serves all fits of the structure."""

    def __init__(self, mount: Mount, free: tuple[str, ...]) -> None:
        self._mount, self._free = mount, free

    @cached_property
    def _symbolic(self) -> tuple[Any, ...]:
        t, q, v, a, dt = (ca.SX.sym(name) for name in ("t", "q", "v", "a", "dt"))
        p, symbols = symbols_of(self._mount.parameters())
        this = self._mount.with_symbols(symbols, v)
        free = ca.vertcat(*[symbols[name] for name in self._free])
        return t, q, v, a, dt, p, free, this, this.at(t, q, v)

    @cached_property
    def torque(self) -> Rowwise:
        """Torque and its derivatives by state and free parameters, from (t, q, v, a, state)."""
        t, q, v, a, _, p, free, this, motion = self._symbolic
        state = ca.SX.sym("state", len(self._mount.friction.states()))
        contact = this.friction.contact(state, v, this.level(motion))
        torque = this.axis.inertia * a + contact + this.viscous(motion) + this.loads(motion)
        rows = ca.vertcat(torque, ca.jacobian(torque, state).T, ca.jacobian(torque, free).T)
        return Rowwise(ca.vertcat(t, q, v, a, state), p, rows)

    @cached_property
    def _step(self) -> tuple[Any, ...]:
        t, q, v, _, dt, p, free, this, motion = self._symbolic
        state = ca.SX.sym("state", len(self._mount.friction.states()))
        following = this.friction.advance(state, v, this.level(motion), dt)
        return ca.vertcat(t, q, v, dt), state, p, free, following

    @cached_property
    def step(self) -> Stepwise:
        """Friction states along the rows, from (t, q, v, dt), by the law's own closed form."""
        column, state, p, _, following = self._step
        return Stepwise(state, column, p, following)

    @cached_property
    def step_slopes(self) -> Rowwise:
        """Derivatives of each friction state's step by itself and by the free parameters, from (t, q, v, dt, state)."""
        column, state, p, free, following = self._step
        own = ca.diag(ca.jacobian(following, state))
        by_free = ca.vec(ca.jacobian(following, free).T)
        return Rowwise(ca.vertcat(column, state), p, ca.vertcat(own, by_free))


_KNOWN: dict[tuple[Any, ...], Equations] = {}
"""Equations by structure: building them costs more than evaluating them."""


class Spectrum:
    """Columns in the frequency domain, mirrored at both ends so that a shift does not wrap around."""

    def __init__(self, columns: Array, dt: float) -> None:
        self.rows = len(columns)
        self.pad = min(self.rows - 1, int(0.5 / dt) + 8)
        extended = np.pad(columns, ((self.pad, self.pad), (0, 0)), mode="reflect", reflect_type="odd")
        self.omega = 2 * np.pi * np.fft.rfftfreq(len(extended), dt)
        self.length, self.values = len(extended), np.fft.rfft(extended, axis=0)

    def times(self, response: npt.NDArray[np.complex128]) -> Array:
        """Columns after a frequency response."""
        whole = np.fft.irfft(self.values * response[:, None], self.length, axis=0)
        return np.asarray(whole[self.pad : self.pad + self.rows])


def _set(part: Any, values: dict[str, float], prefix: str) -> Any:
    return with_symbols(part, values, 0.0, prefix)


def _recurrence(decay: Array, drift: Array) -> Array:
    """Solve y[k+1] = decay[k] y[k] + drift[k], y[0] = 0, for every column of drift."""
    rows = len(decay) + 1
    band = np.ones((2, rows))
    band[1, :-1] = -decay
    solution: Array = solve_banded((1, 0), band, np.concatenate([np.zeros((1, drift.shape[1])), drift]))
    return solution


def stacked(inverse: Inverse, pieces: Sequence[Piece], values: Array) -> tuple[Array, Array]:
    """Return torque and derivatives at the kept rows of all pieces."""
    parts = [(piece, *inverse.torque(piece, values)) for piece in pieces]
    return (
        np.concatenate([torque[piece.kept] for piece, torque, _ in parts]),
        np.concatenate([slopes[piece.kept] for piece, _, slopes in parts]),
    )
