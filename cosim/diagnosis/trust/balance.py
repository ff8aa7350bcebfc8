"""The torque balance of recordings: the inertia and the friction that torque and motion imply, whatever a card says.

    tau = J a + F dir(v) (1 + drift) + B v + c + springs(q) + g1 sin(n q) + g2 cos(n q)

in a narrow band, by least squares. The noise of differentiated readings would make J too small, so its expected energy
is taken off the normal equations. The error of a number is what blocks of time disagree about, and what the balance
does not explain: as much as is left may as well hide in any term. `order` n is how often gravity comes back in one
radian of the reading: 1 where q is the axis' own angle in rad.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.estimation.filters import gain, noise_of
from cosim.estimation.least_squares import squares_left
from cosim.estimation.prepare import Array, Piece, Prepared, prepare
from cosim.support.statistics import rms

BAND = 10.0
"""Hz: inertia and friction are slow, and what is faster is drive, encoder and noise."""
RIDGE = 1e-8
"""Share of a column's energy that is added to keep columns that say the same apart."""
LEAST_BAND, NARROWER = 2.0, 0.7
"""The band is narrowed by this factor, down to so many Hz, while ..."""
NOISY = 0.1
"""... noise is more than this share of the acceleration (RMS)."""
MOST_TAKEN = 0.6
"""Noise explains at most this share of what is peculiar to the acceleration: its spectrum is
only assumed to be flat."""
LEAST_ROWS = 30
"""Rows that a balance of a dozen terms needs."""
ROWS_A_COLUMN = 10
"""Rows for each column below which the other rooms' fits of a recording say nothing."""
DRIFTS = 2
"""Slow waves of the friction level in each recording: half a period and more of them."""
MOST_DRIFTING = 4
"""Recordings that drift each on its own; more of them share what they have."""
BLOCK = 0.5
"""Seconds of a block in which what is left may be alike."""
HIDDEN, OVERLOOKED = 0.3, 0.03
"""A term may hide this share of what is left, more where more of the torque is left, and this share of the whole torque
(RMS): physics that the balance lacks."""
OFFSET = 0.7
"""Where the axis goes one way only, offset and friction are one number, of which this share may be the offset."""
TURNS = 2.0
"""Turns of the reading from which the axis goes round."""
CREEP = 0.03
"""Share of the top speed over which the direction of friction turns."""


@dataclass(frozen=True)
class Estimate:
    """A number and its standard error."""

    value: float
    error: float


@dataclass(frozen=True)
class Solution:
    """What the balance says with gravity of one order."""

    inertia: Estimate
    coulomb: Estimate
    left: float
    """Sum of squares that is left [N2 m2]."""
    independent: float
    """Rows of it that are independent of each other."""
    sign: float
    """Log-likelihood of the torque's sign as recorded over the other: inertia and friction are not negative."""
    explained: float
    """Share of the torque's energy that is explained: a balance that explains little proves little."""


class Balance:
    """The balance of some recordings whose time stamps count `time` to a second."""

    def __init__(self, recordings: Sequence[Recording], linear: bool = False, time: float = 1.0) -> None:
        self.linear, self.own_order = linear, 0.0 if linear else 1.0
        self.recordings = tuple(_timed(one, time) for one in recordings)
        self.prepared, self._noise = _clean_band(self.recordings)
        self._solutions: dict[float, Solution] = {}

    @property
    def is_told(self) -> bool:
        """Whether the recordings have rows to balance."""
        return sum(len(piece.kept) for piece in self.prepared.pieces) > LEAST_ROWS

    @cached_property
    def reach(self) -> float:
        """Range of the reading."""
        return float(np.ptp(self._rows("q")))

    @cached_property
    def torque(self) -> float:
        """RMS of the torque."""
        return rms(self._rows("tau"))

    @cached_property
    def acceleration(self) -> float:
        """RMS of the acceleration of the reading."""
        return rms(self._rows("a"))

    @cached_property
    def overlooked(self) -> float:
        """Sum of squares of what physics may leave that the balance lacks."""
        return len(self._rows("tau")) * (OVERLOOKED * self.torque) ** 2

    def solution(self, order: float) -> Solution:
        """Solve with gravity that comes back `order` times in a radian of the reading; 0: without gravity."""
        if order not in self._solutions:
            self._solutions[order] = self._solved(order)
        return self._solutions[order]

    def columns(self, order: float) -> Array:
        """Columns of the balance at the kept rows: acceleration, direction, speed, and what takes no part in either."""
        return np.column_stack([self._terms, self._gravity(order)]) if order else self._terms

    def _rows(self, name: str) -> Array:
        return self.prepared.stacked(name)

    @cached_property
    def _top(self) -> float:
        return float(np.quantile(np.abs(self._rows("v")), 0.99)) + 1e-300

    @cached_property
    def one_way(self) -> bool:
        """Whether the axis moves in one direction only, but for rows that do not matter."""
        v = self._rows("v")
        return bool(min(np.mean(v > CREEP * self._top), np.mean(v < -CREEP * self._top)) < POLICY.negligible)

    @property
    def _turns(self) -> bool:
        """Whether the axis goes round: then no load drives it for long, and no spring holds it."""
        return bool(self.reach > TURNS * 2 * np.pi) and not self.linear

    @cached_property
    def _terms(self) -> Array:
        """Columns of acceleration, direction, speed, springs, and what each recording has of its own."""
        q = self._rows("q")
        middle, half = 0.5 * (q.min() + q.max()), max(0.5 * self.reach, 1e-300)
        parts = []
        for piece in self.prepared.pieces:
            x = (piece.q - middle) / half
            direction = np.tanh(piece.v / (CREEP * self._top))
            columns = [piece.a, direction, piece.v, *([] if self._turns else [x, x**2])]
            columns += self._own(piece, direction)
            parts.append(piece.lowpass(np.column_stack(columns))[piece.kept])
        return np.concatenate(parts)

    def _own(self, piece: Piece, direction: Array) -> list[Array]:
        """Drifts of the friction level in each recording and, where both directions are there, its offset.

        Many recordings are short beside a drift: they share one offset.
        """
        if len(self.recordings) > MOST_DRIFTING:
            return [] if self.one_way else [np.ones_like(piece.t)]
        span = self.recordings[piece.recording]
        phase = np.pi * (piece.t - span.t[0]) / span.duration
        waves = [direction * np.cos(k * phase) for k in range(1, DRIFTS + 1)]
        waves += [] if self.one_way else [np.ones_like(phase)]
        zero = np.zeros_like(phase)
        return [wave if piece.recording == k else zero for k in range(len(self.recordings)) for wave in waves]

    def _gravity(self, order: float) -> Array:
        waves = [
            piece.lowpass(np.column_stack([np.sin(order * piece.q), np.cos(order * piece.q)]))[piece.kept]
            for piece in self.prepared.pieces
        ]
        return np.concatenate(waves)

    @cached_property
    def _starts(self) -> npt.NDArray[np.int64]:
        pieces = self.prepared.pieces
        number = np.repeat(np.arange(len(pieces)), [len(piece.kept) for piece in pieces])
        block = np.floor(self._rows("t") / BLOCK)
        return np.flatnonzero(np.concatenate([[True], (np.diff(number) != 0) | (np.diff(block) != 0)]))

    def _solved(self, order: float) -> Solution:
        columns = self.columns(order)
        tau, count = self._rows("tau"), len(columns)
        size = np.sqrt((columns**2).mean(0)) + 1e-300
        columns = columns / size
        gram = columns.T @ columns + RIDGE * count * np.eye(len(size))
        own = 1 / np.diag(np.linalg.inv(gram))
        inverse = np.linalg.inv(gram - np.diag(self._taken(own, size, count)))
        found = inverse @ (columns.T @ tau)
        residual = tau - columns @ found
        sums = inverse @ np.add.reduceat(columns * residual[:, None], self._starts).T
        left = rms(residual)
        share = HIDDEN + left / self.torque
        hidden = (share * left + OVERLOOKED * self.torque) * np.sqrt(count / own)
        error = np.hypot(np.sqrt((sums**2).sum(1)), hidden) / size
        number = found / size
        error[1] = np.hypot(error[1], OFFSET * number[1]) if self.one_way else error[1]
        inertia, coulomb = (Estimate(float(number[k]), float(error[k])) for k in (0, 1))
        rows, explained = independent(residual), max(0.0, 1 - float(residual @ residual) / float(tau @ tau))
        # Of numbers that are nowhere near told no residual tells the sign.
        told = 0.5 * float(np.sum((number[:3] / error[:3]) ** 2))
        sign = float(np.clip(0.5 * rows * explained * self._sign(columns, tau), -told, told))
        return Solution(inertia, coulomb, float(residual @ residual), rows, sign, explained)

    def _sign(self, columns: Array, tau: Array) -> float:
        """Log of the squares that are left with the torque's sign turned, over those with the recorded one."""
        _, triangle = np.linalg.qr(np.column_stack([columns, tau]))
        positive = [0, 2] if self.one_way and not self._turns else [0, 1, 2]
        left = squares_left(triangle[:, :-1], triangle[:, -1:] * [1, -1], positive) + self.overlooked
        return float(np.log(left[1] / left[0]))

    def _taken(self, own: Array, size: Array, count: int) -> Array:
        """What noise adds to the energy of acceleration and speed, and to no other column."""
        taken = np.zeros(len(size))
        for column, noise in zip((0, 2), self._noise, strict=True):
            taken[column] = min(count * noise / size[column] ** 2, MOST_TAKEN * own[column])
        return taken


def _clean_band(recordings: Sequence[Recording]) -> tuple[Prepared, tuple[float, float]]:
    """Recordings in the widest band in which noise is small, and the mean squares of noise in acceleration, speed."""
    band = min(BAND, 0.2 / max(one.sample_time for one in recordings))
    least = LEAST_BAND / BAND * band
    while True:
        prepared = prepare(recordings, band)
        if not any(len(piece.kept) for piece in prepared.pieces):
            return prepared, (0.0, 0.0)
        found = [_noise_of(one, band) for one in recordings]
        noise = max(one[0] for one in found), max(one[1] for one in found)
        if band <= least or noise[0] <= (NOISY * np.std(prepared.stacked("a"))) ** 2:
            return prepared, noise
        band *= NARROWER


def independent(residual: Array) -> float:
    """How many rows of a residual are independent, if it is autoregressive of first order."""
    energy = float(residual @ residual) + 1e-300
    alike = float(residual[1:] @ residual[:-1]) / energy
    return len(residual) * (1 - max(alike, 0.0)) / (1 + max(alike, 0.0))


def _timed(recording: Recording, time: float) -> Recording:
    if time == 1.0:
        return recording
    spans = tuple((start / time, end / time) for start, end in recording.masked)
    return replace(recording, table=recording.table | {"t": recording.t / time}, masked=spans)


def _noise_of(recording: Recording, band: float) -> tuple[float, float]:
    dt = recording.sample_time
    name, powers = ("q", (4, 2)) if "q" in recording else ("v", (2, 0))
    hertz = np.linspace(0, min(3 * band, 0.5 / dt), 400)
    passed = np.array([gain(one, dt, band) for one in hertz.tolist()]) ** 4
    white = 2 * dt * noise_of(recording[name], dt) ** 2
    first, second = (white * float(np.trapezoid((2 * np.pi * hertz) ** power * passed, hertz)) for power in powers)
    return first, second
