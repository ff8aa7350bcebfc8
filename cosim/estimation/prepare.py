"""From a recording to what the tests work on: filtered, differentiated, in contiguous pieces.

The same zero-phase low-pass acts twice on both sides of J q'' + tau_f + ... = tau: once on the raw signals (position
and torque), once, after the nonlinear model has been evaluated on the filtered motion, on model and measured torque.
So linear terms match exactly; with the second pass on the model alone the residual of EMPS at 30 Hz was 3.1 N instead
of 1.8 N, all of it artefact.

The first pass may be wider (`Band.motion`): a turn of acceleration a is smeared by a / (2 pi f)^2, and friction is not
linear in the motion, so what a narrow filter smears is a misfit of every law. Then the second pass acts twice, so that
the band is the same.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.data.neighbours import KINDS, Neighbour, neighbours
from cosim.data.recording import GAP, Gap, Recording
from cosim.data.resolution import resolution
from cosim.estimation.filters import EDGE, derivative_at, gain, lowpass, lowpass_in_place, noise_of, passes_of
from cosim.estimation.neighbours import is_alone, key, motions, moving
from cosim.support.errors import RecordingError
from cosim.support.statistics import rms

Array = npt.NDArray[np.float64]
CUTOFFS = (100.0, 70.0, 50.0, 40.0, 30.0, 24.0, 19.0, 15.0, 12.0, 10.0, 8.0)
PROTOCOL_HZ = 30.0
"""Band in which held-out errors are given and recordings are compared with simulations, unless it is mostly noise."""
NOISE_SHARE = 0.003
JITTER = 1e-3
"""RMS jitter, relative to the sample time, above which samples are interpolated to an even grid."""
STEADY = 0.1
"""Without a set point, a speed that varies by less than this share is taken for constant: what a loop leaves of it."""
LEAST_ROWS = 100
"""Rows from which the noise of a reading can be judged."""
KEPT_RATE = 2.5
"""Kept rows a second, at least, relative to the cutoff: after two passes of the filter 2 % of what lies at half that
rate is left, so nothing folds into the band. With 1.4 a ripple of order 60 was found as one of order 65."""
LEAST_SECONDS, TURNED = 2.0, 2 * EDGE
"""A contiguous piece shorter than this is left out, as is one of so few rows that all of them would be turned about."""
BRIDGED = 0.25
"""A hole shorter than this share of the shortest period that the filter passes is bridged by a straight line."""
NARROWER = (*CUTOFFS, 6.0, 4.5, 3.0, 2.0, 1.0)
"""Bands that are tried where holes cut a recording to pieces: what is polled by a computer comes in uneven steps."""
COVERED = 0.5
"""Share of a recording's time that pieces must hold. Unit: 1."""


class Band(NamedTuple):
    """Cutoffs [Hz] of an analysis: of the torque that is compared, and of the motion that goes into the models."""

    cutoff: float
    motion: float = 0.0
    """Not below `cutoff`, which it is where it is 0."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A contiguous piece of a recording at the rate where the model is evaluated.

    All arrays have one value a row: time, filtered position, speed, acceleration; `tau` is filtered twice. `inside`
    marks rows away from the edges, where filters and initial states have settled. `motion` is the cutoff of the first
    pass [Hz], 0 where it is that of the second.
    """

    recording: int
    t: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    inside: npt.NDArray[np.bool_]
    dt: float
    cutoff: float
    stride: int
    extras: dict[str, Array] = field(default_factory=dict)
    reading_noise: float = 0.0
    """Amplitude density of the reading's white noise [rad s^1/2, m s^1/2]; of a speed's where only that was read."""
    torque_noise: float = 0.0
    """The same of the torque [N m s^1/2, N s^1/2]."""
    step: float = 0.0
    """Step of the encoder [rad, m]; 0 where it is too fine to be seen."""
    motion: float = 0.0
    neighbours: Mapping[str, Array] = field(default_factory=dict)
    """Filtered motion of neighbouring axes, see `neighbours.py`."""
    moving: frozenset[str] = frozenset()
    """Neighbours that do not stand still here."""

    def lowpass(self, columns: Array) -> Array:
        """Second pass of the filter, along the first axis."""
        return lowpass(columns, self.dt, self.cutoff, passes_of(self.cutoff, self.motion))

    def lowpass_in_place(self, signals: Array) -> None:
        """The same of signals (signals, rows) that may be overwritten."""
        lowpass_in_place(signals, self.dt, self.cutoff, passes_of(self.cutoff, self.motion))

    @cached_property
    def _given(self) -> dict[tuple[tuple[str, float], ...], tuple[Array, tuple[Array, ...]]]:
        return {}

    def given(self, inputs: tuple[tuple[str, float], ...]) -> tuple[Array, tuple[Array, ...]]:
        """What models are given at each row (time, reading, speed, acceleration, inputs), and in each step from there.

        A step is given these in its middle, then at its end, then its length. `inputs` are names, each with the value
        of an input that was not recorded. Nothing that is returned may be changed.
        """
        if inputs not in self._given:
            columns = [
                self.neighbours[name] if name in self.neighbours else self.extras.get(name, np.full(len(self.t), start))
                for name, start in inputs
            ]
            rows = np.vstack([self.t, self.q, self.v, self.a, *columns])
            middle, end = (rows[:, 1:] + rows[:, :-1]) / 2, rows[:, 1:]
            self._given[inputs] = rows, (*middle, *end, np.full(len(self.t) - 1, self.dt))
        return self._given[inputs]

    def gain(self, hertz: float) -> float:
        """What all passes together leave of a tone."""
        own = gain(hertz, self.dt, self.cutoff)
        return own**2 * (gain(hertz, self.dt, self.motion) if self.motion > self.cutoff else 1.0)

    @cached_property
    def is_asked(self) -> bool:
        """Whether its motion was asked for: a set point tells, else a speed that is not constant."""
        return "q_d" in self.extras or not self.is_steady

    @cached_property
    def is_steady(self) -> bool:
        """Whether its speed is constant, but for what a loop leaves of it."""
        return bool(np.std(self.v) <= STEADY * rms(self.v))

    @cached_property
    def kept(self) -> npt.NDArray[np.int64]:
        """Rows used for statistics: inside, and thinned so that their band is filled."""
        index = np.arange(0, len(self.t), self.stride)
        return index[self.inside[index]]


@dataclass(frozen=True, eq=False)
class Prepared:
    """All pieces of a set of recordings, and what is known about them as a whole."""

    names: tuple[str, ...]
    pieces: tuple[Piece, ...]
    cutoff: float
    has_position: bool
    motion: float = 0.0
    """Cutoff [Hz] in which the motion was read; 0 where it is `cutoff`."""
    neighbours_recorded: tuple[Neighbour, ...] = ()
    """Neighbouring axes of which all recordings have columns."""

    @cached_property
    def neighbours(self) -> tuple[Neighbour, ...]:
        """Those of them that move, and by themselves: of several that move in proportion the first."""
        return tuple(one for one in self.neighbours_recorded if self.followed.get(one.name) == one.name)

    @cached_property
    def followed(self) -> dict[str, str]:
        """By the name of each neighbour that moves, and not with the axis, the first one that moves as it does."""
        own, known = (self.stacked("q"), self.stacked("v"), self.stacked("a")), dict[str, str]()
        for one in self.neighbours_recorded:
            other = self._motion_of(one.name)
            if any(one.name in piece.moving for piece in self.pieces) and is_alone(own, other):
                first = dict.fromkeys(known.values())
                known[one.name] = next((n for n in first if not is_alone(self._motion_of(n), other)), one.name)
        return known

    def _motion_of(self, name: str) -> tuple[Array, Array, Array]:
        """Position, speed and acceleration of a neighbour."""
        q, v, a = (self.of_neighbour(key(name, kind)) for kind in KINDS)
        return q, v, a

    def of_neighbour(self, name: str) -> Array:
        """A signal of a neighbour of all pieces at the kept rows."""
        return np.concatenate([piece.neighbours[name][piece.kept] for piece in self.pieces])

    @property
    def band(self) -> Band:
        """Both cutoffs."""
        return Band(self.cutoff, self.motion)

    def stacked(self, name: str) -> Array:
        """One signal of all pieces at the kept rows, one after the other."""
        return np.concatenate([getattr(piece, name)[piece.kept] for piece in self.pieces])

    @cached_property
    def recording_of(self) -> npt.NDArray[np.int64]:
        """Number of the recording of each kept row."""
        return np.concatenate([np.full(len(piece.kept), piece.recording) for piece in self.pieces])

    @cached_property
    def reach(self) -> float:
        """Length of the positions visited [rad, m]."""
        low, high = self.ranges["q"]
        return high - low

    @cached_property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Smallest and largest position and speed visited."""
        return {name: (float(self.stacked(name).min()), float(self.stacked(name).max())) for name in ("q", "v")}


def prepare(recordings: Sequence[Recording], band: float | Band) -> Prepared:
    """Filter, differentiate and cut recordings.

    Cutoffs [Hz] are lowered to 0.3 of the slowest sample rate, the first on to where the lines that bridge short holes
    leave pieces that hold most of each recording.

    Raises:
        RecordingError: holes leave of a recording too little in any band.
    """
    slowest = max(recording.sample_time for recording in recordings)
    cutoff, motion = (min(edge, 0.3 / slowest) for edge in (band if isinstance(band, Band) else Band(band)))
    cutoff = min(_telling(one, cutoff) for one in recordings)
    read = Band(cutoff, motion if motion > cutoff else 0.0)
    others = _neighbours(recordings)
    pieces = [piece for index, one in enumerate(recordings) for piece in _pieces(one, index, read, others)]
    pieces = [piece for piece in pieces if len(piece.kept)]
    _check_left(recordings, pieces)
    has_position = all("q" in recording for recording in recordings)
    return Prepared(tuple(r.name for r in recordings), tuple(pieces), cutoff, has_position, read.motion, others)


def _check_left(recordings: Sequence[Recording], pieces: Sequence[Piece]) -> None:
    """Refuse a recording of which nothing may be judged (RecordingError)."""
    for index, one in enumerate(recordings):
        if not any(piece.recording == index for piece in pieces):
            text = f"Nothing of {one.name} may be judged: single readings, rests or end stops are all there is."
            raise RecordingError(text, culprit=one.name)


def _neighbours(recordings: Sequence[Recording]) -> tuple[Neighbour, ...]:
    """Neighbouring axes of which all recordings have columns, without gaps."""
    whole = [{name for name in one.columns if np.isfinite(one[name]).all()} for one in recordings]
    return neighbours(set.intersection(*whole), recordings[0].units)


def quality(recording: Recording, cutoff: float) -> tuple[str, ...]:
    """Say what is odd about a recording, and what was done about it here."""
    said = list(recording.quality())
    if recording.jitter > JITTER:
        steps = f"{recording.jitter:.2%} rms"
        said.append(f"{recording.name}: interpolated to an even grid, as its time steps vary by {steps}.")
    if bridged := len(recording.gaps) - len(_holes(recording, cutoff)):
        said.append(
            f"{recording.name}: {bridged} of its gaps are short beside what the filter passes; lines bridge them."
        )
    return tuple(said)


def _holes(recording: Recording, cutoff: float) -> list[Gap]:
    """Gaps that cut a recording in two at this cutoff [Hz]."""
    return [gap for gap in recording.gaps if gap.end - gap.start > BRIDGED / cutoff]


def _telling(recording: Recording, cutoff: float) -> float:
    """The widest band up to `cutoff` [Hz] in which pieces hold enough of a recording."""
    for band in (cutoff, *(one for one in NARROWER if one < cutoff)):
        spans = _spans(recording, band)
        held = sum(recording.t[span.stop - 1] - recording.t[span.start] for span in spans)
        if spans and held >= COVERED * recording.duration:
            return band
    least = f"{LEAST_SECONDS:g} s and {TURNED + 1} rows"
    if count := len(recording.gaps):
        text = (
            f"{recording.name} has {count} holes in time, and pieces without holes must be {least} long and hold half"
        )
        text += " of a recording; record it in even steps."
    else:
        text = f"{recording.name} is {recording.duration:.3g} s in {len(recording)} rows; {least} are needed at least."
    raise RecordingError(text, culprit=recording.name, value=count)


def _spans(recording: Recording, cutoff: float) -> list[slice]:
    """Rows between holes that are long enough."""
    dt, ends = recording.sample_time, [gap.row for gap in _holes(recording, cutoff)]
    spans = zip([0, *ends], [*ends, len(recording)], strict=True)
    return [slice(a, b) for a, b in spans if (b - a) * dt >= LEAST_SECONDS and b - a > TURNED]


def _pieces(recording: Recording, index: int, band: Band, others: Sequence[Neighbour]) -> list[Piece]:
    step = _once(recording, "step", lambda: resolution(recording["q"])) if "q" in recording else 0.0
    return [replace(_piece(recording, index, span, band, others), step=step) for span in _spans(recording, band.cutoff)]


def _piece(recording: Recording, index: int, span: slice, band: Band, others: Sequence[Neighbour]) -> Piece:
    grid, table = _on_grid(recording, span)
    dt = float(grid[-1] - grid[0]) / (len(grid) - 1)
    cutoff, first = band.cutoff, max(band)
    each = max(1, int(1 / (8 * first * dt)))
    tau = lowpass(table["tau"], dt, first)[::each].copy()  # copies: what is thinned must not keep all rows alive
    q, v, a = _motion(table, dt, first, each)
    reading = "q" if "q" in table else "v"
    noise = [_once(recording, (x, span.start, span.stop), partial(_density, table[x], dt)) for x in (reading, "tau")]
    coarse, t = dt * each, grid[::each].copy()
    return Piece(
        recording=index,
        t=t,
        q=q,
        v=v,
        a=a,
        tau=lowpass(tau, coarse, cutoff, passes_of(*band)),
        inside=_inside(t, float(grid[0]), float(grid[-1])) & ~recording.is_masked(t, 0.5 / cutoff),
        dt=coarse,
        cutoff=cutoff,
        motion=band.motion,
        stride=max(1, int(1 / (KEPT_RATE * cutoff * coarse))),
        extras={n: c[::each].copy() for n, c in table.items() if n not in ("t", "tau", "q", "v")},
        neighbours={name: one[::each].copy() for name, one in motions(others, table, dt, first).items()},
        moving=moving(others, table, dt, first) if len(grid) > LEAST_ROWS else frozenset(),
        reading_noise=noise[0],
        torque_noise=noise[1],
    )


def _once(recording: Recording, what: Hashable, find: Callable[[], float]) -> float:
    """A number that a recording has in any band: it takes all its rows, and a diagnosis reads it in some ten bands."""
    if what not in recording.known_numbers:
        recording.known_numbers[what] = find()
    return recording.known_numbers[what]


def _density(column: Array, dt: float) -> float:
    """Amplitude density of a column's white noise, in its unit times s^1/2."""
    return noise_of(column, dt) * sqrt(dt) if len(column) > LEAST_ROWS else 0.0


def _on_grid(recording: Recording, span: slice) -> tuple[Array, dict[str, Array]]:
    """Return the samples of a span; where time jitters or has short holes, on an even grid (see `quality`)."""
    t, dt = recording.t[span], recording.sample_time
    table = {name: recording[name][span] for name in recording.columns if name != "t"}
    if recording.jitter <= JITTER and np.diff(t).max() <= GAP * dt:
        return t, table
    grid = np.linspace(t[0], t[-1], round((t[-1] - t[0]) / dt) + 1)
    return grid, {name: np.interp(grid, t, column) for name, column in table.items()}


def _motion(table: dict[str, Array], dt: float, cutoff: float, each: int) -> tuple[Array, Array, Array]:
    """Position, speed and acceleration, filtered, of each so many rows; derivatives are found there alone."""
    if "q" in table:
        q = lowpass(table["q"], dt, cutoff)
        rows = np.arange(0, len(q), each)
        return q[rows], derivative_at(q, dt, rows), derivative_at(q, dt, rows, 2)
    v = lowpass(table["v"], dt, cutoff)
    rows = np.arange(0, len(v), each)
    return (np.cumsum(v) * dt)[rows], v[rows], derivative_at(v, dt, rows)


def _inside(t: Array, start: float, end: float) -> npt.NDArray[np.bool_]:
    """3 s .. end - 0.5 s, or 5 % off each end of a piece shorter than 15 s."""
    lead, tail = (3.0, 0.5) if end - start >= 15 else (0.05 * (end - start),) * 2
    return np.asarray((t >= start + lead) & (t <= end - tail))


def choose_cutoff(recordings: Sequence[Recording], inertia: float, noise_share: float = NOISE_SHARE) -> float:
    """Widest band in which encoder noise, differentiated twice, is a small torque [Hz].

    Differentiated noise in the model torque is not only error: the controller answers the same noise, and the two
    together look like a delay. So the band ends where inertia times the noise of the acceleration reaches
    `noise_share` of the torque.
    """
    return min(_cutoff(recording, inertia, noise_share) for recording in recordings)


def _cutoff(recording: Recording, inertia: float, noise_share: float) -> float:
    dt, size = recording.sample_time, float(np.std(recording["tau"]))
    name, power = ("q", 4) if "q" in recording else ("v", 2)
    noise = noise_of(recording[name], dt)
    for cutoff in CUTOFFS:
        if cutoff < 0.3 / dt:
            omega = 2 * np.pi * cutoff
            share = 2 * cutoff * dt / (power + 1)
            if inertia * noise * omega ** (power / 2) * np.sqrt(share) <= noise_share * size:
                return cutoff
    return CUTOFFS[-1]
