"""The torque that a recorded motion needs, and how it changes with every parameter.

    needed(t) = D^-1 [ J(q) q'' + J'(q) q'^2 / 2 + contact + viscous + loads + coupled ] + tones

with the true motion recovered from the reading, the states of friction and effects integrated along it, what hangs on
a spring (`coupled`) answered in the frequency domain, what is behind a play simulated (`play.py`), and D the drive
effects undone, a motor in front of a spring first; then two clocks are brought together. Last come tonal disturbances:
their phase is another in each piece, found in the torque recorded there (`tonal_disturbance.py`). The equations are
those of the plant: the same objects, with measured motion put in (`equations.py`).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
from scipy.fft import irfft, next_fast_len, rfft

from cosim.estimation.equations import Equations, equations_of
from cosim.estimation.play import stepped_torque
from cosim.estimation.prepare import Array, Piece
from cosim.estimation.row_weights import described_rows
from cosim.estimation.tonal_disturbance import Tone, in_phase, phases_of
from pyfmi_models.effects import ClockEffect, DriveEffect, Effect
from pyfmi_models.effects.base import TonalEffect, Transmission
from pyfmi_models.model import Variable, with_symbols
from pyfmi_models.mount import Mount

BUMP = 1e-6
"""Relative change of a parameter by which a frequency response is differentiated."""


class Spectrum:
    """Columns in the frequency domain, mirrored at both ends so that a shift does not wrap around.

    What is mirrored fades to zero: a jump from the last row to the first would ring through all of them.
    """

    def __init__(self, columns: Array, dt: float) -> None:
        self.rows, signals = len(columns), columns.T
        pad = self.pad = min(self.rows - 1, int(0.5 / dt) + 8)
        # Zeros behind what has faded: a length without large prime factors is transformed several times faster.
        self.length = next_fast_len(self.rows + 2 * pad, real=True)
        extended = np.zeros((len(signals), self.length))
        fade = np.sin(np.pi / 2 * np.arange(pad) / pad) ** 2
        extended[:, :pad] = (2 * signals[:, :1] - signals[:, pad:0:-1]) * fade
        extended[:, pad : pad + self.rows] = signals
        after = extended[:, pad + self.rows : 2 * pad + self.rows]
        after[:] = (2 * signals[:, -1:] - signals[:, -2 : -pad - 2 : -1]) * fade[::-1]
        self.omega = 2 * np.pi * np.fft.rfftfreq(self.length, dt)
        self.values = rfft(extended)

    def times(self, response: npt.NDArray[np.complex128], columns: slice = slice(None)) -> Array:
        """Some of the columns after a frequency response."""
        whole = irfft(self.values[columns] * response, self.length)
        return np.asarray(whole[:, self.pad : self.pad + self.rows].T)


_SPECTRA: WeakKeyDictionary[Piece, Spectrum] = WeakKeyDictionary()


@dataclass(frozen=True)
class Inverse:
    """Torque needed by a mount for a measured motion; `free` names the parameters that may vary."""

    mount: Mount
    free: tuple[str, ...]
    alone: bool = False
    """Whether torque comes without its derivatives."""

    @property
    def by(self) -> tuple[str, ...]:
        """Names of the parameters by which torque is differentiated."""
        return () if self.alone else self.free

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters of the mount, in its order."""
        return tuple(variable.name for variable in self._parameters)

    @cached_property
    def _parameters(self) -> tuple[Variable, ...]:
        return self.mount.parameters()

    @cached_property
    def start(self) -> Array:
        """Present values of all parameters."""
        return np.array([variable.start for variable in self._parameters])

    @cached_property
    def present(self) -> Array:
        """Present values of the free parameters, in the order of `free`."""
        return np.asarray(self.start[self._places], float)

    @cached_property
    def _equations(self) -> Equations:
        return equations_of(self.mount, self.names, self.by)

    def torque(self, piece: Piece, values: Array) -> tuple[Array, Array]:
        """Return needed torque (rows,) and its derivatives (rows, free) at all rows of a piece, filtered once more."""
        columns = self.columns(piece, values)
        return columns[:, 0], columns[:, 1:]

    def columns(self, piece: Piece, values: Array) -> Array:
        """Both, (rows, 1 + free)."""
        return self.behind(piece, self.momentary(piece, values), values)

    def momentary(self, piece: Piece, values: Array) -> Array:
        """Torque that the motion and the states need, and its derivatives: (rows, 1 + free), filtered once more."""
        signals = self._momentary(piece, self._with(values))
        # A spring, a drive, a clock act on a torque as a whole, later.
        acts = signals.any(axis=1)
        if acts.all():
            piece.lowpass_in_place(signals)
        else:
            some = signals[acts]
            piece.lowpass_in_place(some)
            signals[acts] = some
        return signals.T

    def behind(self, piece: Piece, columns: Array, values: Array) -> Array:
        """The same after springs, drive and clocks, which act on a torque as a whole, and with what shakes the axis."""
        full = self._with(values)
        return self._with_tones(piece, self._without_tones(piece, columns, full), full)

    def phases(self, piece: Piece, values: Array) -> dict[str, float]:
        """Phase [rad] at time zero of what shakes the axis in a piece, by the name of the parameter."""
        names = phases_of(self.mount)
        if not names:
            return {}
        full = self._with(values)
        residual = piece.tau - self._without_tones(piece, self.momentary(piece, values), full)[:, 0]
        tones = self._tones(full)
        late = [float(np.angle(self._drive(full, tone.hertz))) for tone in tones]
        found = in_phase(piece, residual, tones, self._telling(piece))
        return {name: phase + lag for name, (phase, _), lag in zip(names, found, late, strict=True)}

    def _without_tones(self, piece: Piece, columns: Array, full: Array) -> Array:
        columns = self._with_coupled(piece, columns, full)
        columns = self._with_motors(piece, columns, full)
        columns = self._undone_drive(columns, full, piece.dt)
        return self._on_one_clock(piece, columns, full)

    def _with(self, values: Array) -> Array:
        full = self.start.copy()
        full[self._places] = values
        return full

    @cached_property
    def _places(self) -> list[int]:
        """Where the free parameters are among all."""
        return [self.names.index(name) for name in self.free]

    def _momentary(self, piece: Piece, full: Array) -> Array:
        """Torque that the motion of each moment and the states need, and its derivatives: (1 + free, rows)."""
        rows, steps = self._equations.given(piece)
        state, slopes = self._equations.states(steps, full) if self._equations.count else ((), ())
        return self._equations.torque([*rows, *state, *(one for by in slopes for one in by.values)], full)

    @cached_property
    def _components(self) -> dict[str, Any]:
        return self.mount.components()

    def _parts(self, kind: type[Effect]) -> list[str]:
        """Prefixes of the effects that act in one place: asked in each evaluation, answered once."""
        if kind not in self._places_of:
            self._places_of[kind] = [name for name, part in self._components.items() if isinstance(part, kind)]
        return self._places_of[kind]

    @cached_property
    def _places_of(self) -> dict[type[Effect], list[str]]:
        return {}

    @cached_property
    def _trailing(self) -> list[str]:
        return [name for name, _ in self.mount.trailing()]

    def _set(self, prefix: str, full: Array) -> Any:
        if prefix not in self._numbered:
            dotted = prefix + "."
            own = {n: k for k, n in enumerate(self.names) if n.startswith(dotted)}
            self._numbered[prefix] = list(own.values()), list(own)
        places, names = self._numbered[prefix]
        return with_symbols(self._components[prefix], dict(zip(names, full[places], strict=True)), 0.0, prefix)

    @cached_property
    def _numbered(self) -> dict[str, tuple[list[int], list[str]]]:
        """Where the numbers of a part are among all, and their names."""
        return {}

    def _bumped(self, full: Array, name: str) -> tuple[Array, float]:
        """All parameters with one of them changed a little, and by how much."""
        index = self.names.index(name)
        change = BUMP * (abs(full[index]) or 1.0)
        other = full.copy()
        other[index] += change
        return other, change

    def _with_coupled(self, piece: Piece, columns: Array, full: Array) -> Array:
        """Add what masses behind a spring or a play need beyond being carried rigidly.

        Where several stand in a row, each is taken to follow the axis itself: what one of them does to the motion that
        the next one sees is left out.
        """
        couplings, motors = self._trailing, self._parts(Transmission)
        if not couplings:
            return columns
        v, a = self._equations.motion(piece, full)
        spectrum = self._spectrum(piece, a)

        def added(sets: Sequence[Array]) -> Array:
            total = np.zeros((len(sets), len(a)))
            for several in zip(*map(self._far, sets), strict=True):
                far, parts = zip(*several, strict=True)
                carried = [one.carried(spectrum.omega) for one in parts]
                if carried[0] is None:
                    total += piece.lowpass(stepped_torque(parts, far, v, a, piece.dt).T).T
                else:
                    total += [spectrum.times(f * (c - 1))[:, 0] for f, c in zip(far, carried, strict=True)]
            return total

        return self._with_changes(columns, full, added, ("axis.inertia", *motors, *couplings))

    def _spectrum(self, piece: Piece, a: Array) -> Spectrum:
        """Of the filtered acceleration; where that is the recorded one, the same each time."""
        if a is not piece.a:
            return Spectrum(piece.lowpass(a)[:, None], piece.dt)
        if piece not in _SPECTRA:
            _SPECTRA[piece] = Spectrum(piece.lowpass(a)[:, None], piece.dt)
        return _SPECTRA[piece]

    def _far(self, full: Array) -> Iterator[tuple[float, Any]]:
        """Couplings, the nearest first, each with the inertia behind it."""
        far = self._behind_motors(full)
        for prefix in self._trailing:
            coupling = self._set(prefix, full)
            far = far * coupling.share()
            yield far, coupling

    def _behind_motors(self, full: Array) -> float:
        """Inertia that the transmissions leave for the axis."""
        shares = [self._set(name, full).share() for name in self._parts(Transmission)]
        return float(full[self.names.index("axis.inertia")] * np.prod(shares))

    def _with_motors(self, piece: Piece, columns: Array, full: Array) -> Array:
        """Turn what the axis needs into what a motor in front of its spring needs: exact, as the axis is what is read.

            needed = J_motor q'' + (1 + J_motor s^2 / (k + d s)) (columns - J_motor q'')

        The factor grows with frequency, the filter behind the columns falls faster. Of several motors in a row each is
        taken to follow the axis itself.
        """
        motors = self._parts(Transmission)
        if not motors:
            return columns
        a = piece.lowpass(self._equations.motion(piece, full)[1])
        spectrum = Spectrum(np.column_stack([a, columns]), piece.dt)

        def added(numbers: Array) -> Array:
            both = spectrum.times(self._demand(numbers, spectrum.omega) - 1, slice(2))
            motor = numbers[self.names.index("axis.inertia")] - self._behind_motors(numbers)
            return np.asarray(both[:, 1] - motor * both[:, 0])

        out = self._with_changes(columns, full, _each(added), ("axis.inertia", *motors))
        out[:, 1:] += spectrum.times(self._demand(full, spectrum.omega) - 1, slice(2, None))
        return out

    def _demand(self, full: Array, omega: npt.NDArray[Any]) -> npt.NDArray[np.complex128]:
        """Torque on the first motor per torque on the axis."""
        parts = [self._set(name, full).demand(omega) for name in self._parts(Transmission)]
        return np.asarray(np.prod([np.ones_like(omega, dtype=np.complex128), *parts], axis=0))

    def _with_changes(
        self, columns: Array, full: Array, added: Callable[[Sequence[Array]], Array], prefixes: Sequence[str]
    ) -> Array:
        """Add a torque that depends on some parts, and its derivatives, by differences.

        `added` gives the torque (sets, rows) for several sets of numbers.
        """
        bumped = {1 + k: self._bumped(full, name) for k, name in enumerate(self.by) if name.startswith(tuple(prefixes))}
        now, *others = added([full, *(other for other, _ in bumped.values())])
        out = columns.copy("K")
        out[:, 0] += now
        for (column, (_, change)), other in zip(bumped.items(), others, strict=True):
            out[:, column] += (other - now) / change
        return out

    def _undone_drive(self, columns: Array, full: Array, dt: float) -> Array:
        """Undo the linear drive effects on all columns, and add the derivatives by their parameters."""
        drives = self._parts(DriveEffect)
        if not any(self._components[name].states() for name in drives):
            return columns
        spectrum = Spectrum(columns, dt)

        def inverse(numbers: Array) -> npt.NDArray[np.complex128]:
            return np.asarray(1 / np.prod([self._set(n, numbers).response(spectrum.omega) for n in drives], axis=0))

        now = inverse(full)
        out = spectrum.times(now)
        for column, name in enumerate(self.by):
            if name.split(".")[0] in drives:
                other, change = self._bumped(full, name)
                out[:, 1 + column] += spectrum.times((inverse(other) - now) / change, slice(1))[:, 0]
        return out

    def _on_one_clock(self, piece: Piece, columns: Array, full: Array) -> Array:
        """Bring the torque needed at a reading's time to the time of the torque recorded beside it."""
        clocks = self._parts(ClockEffect)
        if not clocks:
            return columns
        from scipy.interpolate import CubicSpline  # a tenth of a second that machines of one clock do not need

        spline = CubicSpline(piece.t, columns, axis=0)

        def later(numbers: Array) -> Array:
            parts = [self._set(name, numbers) for name in clocks]
            return np.asarray(sum(part.ahead(self.mount.at(piece.t, piece.q, piece.v)) for part in parts))

        at = np.clip(piece.t - later(full), piece.t[0], piece.t[-1])
        out, slope = spline(at), spline(at, 1)[:, 0]
        for column, name in enumerate(self.by):
            if name.split(".")[0] in clocks:
                other, change = self._bumped(full, name)
                out[:, 1 + column] -= slope * (later(other) - later(full)) / change
        return np.asarray(out)

    def _with_tones(self, piece: Piece, columns: Array, full: Array) -> Array:
        """Add what shakes the axis, in the phase that the torque recorded in this piece tells, and its derivatives."""
        prefixes = self._parts(TonalEffect)
        if not prefixes:
            return columns
        residual, rows = piece.tau - columns[:, 0], self._telling(piece)

        def added(numbers: Array) -> Array:
            return np.asarray(sum(torque for _, torque in in_phase(piece, residual, self._tones(numbers), rows)))

        return self._with_changes(columns, full, _each(added), prefixes)

    def _tones(self, full: Array) -> list[Tone]:
        """What shakes the axis, as the torque in front of the drive shows it."""
        waves = [self._set(prefix, full).wave() for prefix in self._parts(TonalEffect)]
        return [Tone(hertz, amplitude / abs(self._drive(full, hertz))) for hertz, amplitude in waves]

    def _drive(self, full: Array, hertz: float) -> complex:
        """Response of the drive, from command to the torque on the axis, at one frequency."""
        omega, names = np.array([2 * np.pi * hertz]), self._parts(DriveEffect)
        followed = np.prod([self._set(name, full).response(omega)[0] for name in names])
        return complex(followed / self._demand(full, omega)[0])

    def _telling(self, piece: Piece) -> npt.NDArray[np.bool_]:
        """Rows whose rest tells a phase."""
        return np.asarray(piece.inside & described_rows(self.mount.friction, piece.v))


def _each(added: Callable[[Array], Array]) -> Callable[[Sequence[Array]], Array]:
    """The same for several sets of numbers, one after the other."""
    return lambda sets: np.vstack([added(numbers) for numbers in sets])


def stacked(inverse: Inverse, pieces: Sequence[Piece], values: Array) -> tuple[Array, Array]:
    """Return torque and derivatives at the kept rows of all pieces; each derivative lies in one stretch of memory."""
    ends = np.cumsum([0, *(len(piece.kept) for piece in pieces)])
    columns = np.empty((1 + len(inverse.by), ends[-1]))
    for piece, first, last in zip(pieces, ends, ends[1:], strict=False):
        columns[:, first:last] = np.take(inverse.columns(piece, values).T, piece.kept, axis=1)
    return columns[0], columns[1:].T
