"""What shakes an axis: energy of what a structure leaves that lasts for seconds, far above the usual, or goes on.

    share = sum of max(l - ABOVE u, 0) / sum of e,    l = min(e, the larger neighbour's e),    u = median of e
    ln e = ln(variance of the rest) less a quadratic in ln(speed), ln(acceleration) and ln(jerk), RMS of each

in windows of a second of clear motion, the variance less what a level of friction of its own would take in each:
friction that changes is no shaking. Noise of any colour has the same e in each, and what a law lacks goes with the
motion; a single window that stands out is a jolt, and counts nothing.

A random disturbance shakes it all the time: what a structure leaves at any motion above the slow band, more than both
readings' noise. In each band [f1, f2] above the slow one, and in windows w of a second of motion away from turns,

    E_w = mean square of the rest in the band, less what comes again at the same position
    least^2, level^2 = decile, median of max(E_w - noise^2, 0), summed over the bands

What a law lacks goes with the motion, so that some windows have little of it; a floor that trembles, or wind, spares
none. Noise is that of the position, white and differentiated twice, and that of the torque: white as above the band, or
what it has in rest phases, whichever is more. What comes again in another passage is the machine's (teeth, a rough
ring).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement, pairwise

import numpy as np
import numpy.typing as npt
from scipy.fft import dct, idct

from cosim.diagnosis.evidence.bands import passed, reading_torque
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Array, Piece, Prepared
from cosim.estimation.row_weights import far_from_turns, least_speed

SECONDS = 1.0
"""Length of a window [s]."""
LEAST_ROWS = 8
"""Rows that a window must hold of those that count, and at least half of its own."""
PERIODS = 8.0
"""Periods of the cutoff that a window holds at least: an energy of fewer rows says little. Unit: 1."""
LEAST_WINDOWS = 20
"""Windows that tell what is usual in which motion."""
ABOVE = 3.0
"""Times the usual energy from which a window stands out; noise of 16 independent rows has 2.1 in one of a hundred."""
LEAST_WAYS = 1e-3
"""Variance of the direction below which a window goes one way, and its level is its mean. Unit: 1."""
NONE = 1e-6
"""Mean square of a speed, relative to the largest, of an acceleration, relative to reaching that within a window, and
of a jerk, relative to reaching that acceleration within one, below which it is none. Unit: 1."""
LEAST_MOVING = 10
"""Windows in motion of which the decile is one at least."""
OUTSIDE = 0.05
"""Share of the energy that may lie below, and above, the band that is stated. Unit: 1."""
SPARED = 0.1
"""Share of the windows that may have less than the level: noise of few periods is uneven. Unit: 1."""
UNMOVED = 4.0
"""Times its noise that the mean square of a position may have at rest: more is motion. Unit: 1."""
PLACES = 4.0
"""Places to a period of the band's upper edge at the RMS speed: what comes again is seen by its mean there."""

Rows = npt.NDArray[np.bool_]


def burst_share(comparison: Comparison, found: Fit) -> float:
    """Share of the energy of the training residual that comes in bursts; 0 where too little was recorded to tell."""
    prepared, parts = comparison.problem.prepared, []
    clear = (comparison.problem.weight * far_from_turns(prepared) > 0).astype(float)
    rest = found.residual / comparison.noise.at(prepared.stacked("v"))
    seconds = max(SECONDS, PERIODS / prepared.cutoff)
    for piece, rows in zip(prepared.pieces, comparison.bands.slices, strict=True):
        parts += [_windows(piece, rest[rows], clear[rows], seconds), np.full((1, 4), np.nan)]
    windows = np.concatenate(parts)
    known = np.isfinite(windows).all(1)
    if known.sum() < LEAST_WINDOWS:
        return 0.0
    energy = np.full(len(windows), np.nan)
    least = NONE * float(windows[known, 1].max()) * np.array([0.0, 1.0, seconds**-2, seconds**-4]) + 1e-300
    energy[known] = _beside_motion(np.log(np.maximum(windows[known], least)))
    above = np.maximum(_lasting(energy)[known] - ABOVE * np.median(energy[known]), 0.0)
    return float(above.sum() / energy[known].sum())


def _windows(piece: Piece, rest: Array, clear: Array, seconds: float) -> Array:
    """Variance of the rest, mean squares of speed, acceleration, jerk: (windows, 4); no number where hardly clear."""
    t, v = piece.t[piece.kept], piece.v[piece.kept]
    if len(t) < LEAST_ROWS:
        return np.full((1, 4), np.nan)
    way = np.sign(v)
    a = np.gradient(v, t)
    columns = (rest, rest**2, way, way**2, way * rest, v**2, a**2, np.gradient(a, t) ** 2)
    mean, square, ways, both, together, *motion = window_means(t, clear, columns, seconds).T
    of_level = (together - ways * mean) ** 2 / np.maximum(both - ways**2, LEAST_WAYS)
    return np.column_stack([square - mean**2 - of_level, *motion])


def _beside_motion(logs: Array) -> Array:
    """Energies relative to what a quadratic in the logarithms of speed, acceleration and jerk foretells."""
    motion = [(one - one.mean()) / (one.std() + 1e-300) for one in logs[:, 1:].T]
    shapes = [one * other for one, other in combinations_with_replacement(motion, 2)]
    columns = np.column_stack([np.ones(len(logs)), *motion, *shapes])
    return np.asarray(np.exp(logs[:, 0] - columns @ np.linalg.lstsq(columns, logs[:, 0], rcond=None)[0]))


def _lasting(energy: Array) -> Array:
    """The energy of each window that a neighbour has as well; 0 where it has none."""
    beside = np.concatenate([[np.nan], energy, [np.nan]])
    return np.asarray(np.nan_to_num(np.minimum(energy, np.fmax(beside[:-2], beside[2:]))))


def window_means(
    t: Array, counts: Array | npt.NDArray[np.bool_], columns: Sequence[Array], seconds: float = SECONDS
) -> Array:
    """Mean of each column over the rows that count: (windows, columns); not a number where they are too few.

    Args:
        t: time of each row [s].
        counts: 1 for rows that count, else 0.
        columns: one value a row.
        seconds: length of a window [s].
    """
    window = np.floor((t - t[0]) / seconds).astype(np.int64)
    rows, count = np.bincount(window), np.bincount(window, counts)
    enough, count = count >= np.maximum(LEAST_ROWS, rows / 2), np.maximum(count, 1.0)
    means = [np.bincount(window, counts * one) / count for one in columns]
    return np.where(enough[:, None], np.column_stack(means), np.nan)


@dataclass(frozen=True)
class Shaken:
    """A disturbance that goes on all the time: its level [N m, N], and the band [Hz] that holds nine tenths of it."""

    level: float = 0.0
    """Usual RMS."""
    least: float = 0.0
    """RMS that nine tenths of all windows reach."""
    low: float = 0.0
    high: float = 0.0


def shaken(prepared: Prepared, residual: Array, inertia: float, bands_hz: tuple[float, ...]) -> Shaken:
    """What is left of recordings at any motion; level 0 where nothing is, or too little was recorded to tell."""
    edges = (*(one for one in bands_hz if one < prepared.cutoff / 1.5), prepared.cutoff)
    bands = list(pairwise(edges))
    levels = np.array([_levels(prepared, residual, inertia, band) for band in bands]).reshape(-1, 2)
    whole = levels.sum(0)
    if not whole[0]:
        return Shaken()
    shown = [band for band, one in zip(bands, levels[:, 1], strict=True) if one > OUTSIDE * whole[1]]
    least, level = np.sqrt(whole)
    return Shaken(float(level), float(least), *_middle(prepared, residual, shown[0][0], shown[-1][1]))


def _levels(prepared: Prepared, residual: Array, inertia: float, band: tuple[float, float]) -> Array:
    """Decile and median of the energy in a band, noise taken off."""
    moving: list[Array] = []
    resting: list[float] = []
    noise = [0.0]
    parts = list(_parts(prepared, residual))
    rests = [_in_band(piece, rest * clear, band) for piece, rest, clear in parts]  # what turns leave would ring on
    again = _again(prepared, [piece for piece, *_ in parts], rests, band)
    for (piece, _, clear), rest, place in zip(parts, rests, again, strict=True):
        moving.append(_mean_squares(piece, rest - place, clear))
        resting.extend(_at_rest(prepared, piece, band))
        noise.append(_reading_noise(prepared, piece, inertia, band))
    energies = np.concatenate(moving) if moving else np.zeros(0)
    if len(energies) < LEAST_MOVING:
        return np.zeros(2)
    still = float(np.median(resting)) if len(resting) >= LEAST_MOVING else 0.0
    return np.maximum(np.quantile(energies, (SPARED, 0.5)) - max(still, *noise), 0.0)


def _parts(prepared: Prepared, residual: Array) -> Iterator[tuple[Piece, Array, Rows]]:
    """Each piece with its rest, and whether its rows are in clear motion away from turns."""
    clear, first = far_from_turns(prepared) > 0, 0
    for piece in prepared.pieces:
        rows = slice(first, first := first + len(piece.kept))
        if len(piece.kept) >= LEAST_ROWS:
            yield piece, residual[rows], clear[rows]


def _in_band(piece: Piece, column: Array, band: tuple[float, float]) -> Array:
    wave = dct(column, norm="ortho")
    hertz = np.arange(len(column)) / (2 * len(column) * piece.dt * piece.stride)
    return np.asarray(idct(np.where((hertz >= band[0]) & (hertz < band[1]), wave, 0.0), norm="ortho"))


def _mean_squares(piece: Piece, column: Array, rows: Rows) -> Array:
    """Mean squares in the windows that hold enough of the rows."""
    means = window_means(piece.t[piece.kept], rows, (column**2,))[:, 0]
    return means[np.isfinite(means)]


def _at_rest(prepared: Prepared, piece: Piece, band: tuple[float, float]) -> Array:
    """Mean squares of the torque in windows of rest in which the position is no more than its noise.

    What shakes an axis shakes it at rest too, and its controller answers what the encoder shows: that is no noise.
    """
    rows = np.abs(piece.v[piece.kept]) < least_speed(prepared.stacked("v"))
    torque, moved = (_mean_squares(piece, _in_band(piece, one[piece.kept], band), rows) for one in (piece.tau, piece.q))
    return torque[moved < UNMOVED * (2 * piece.reading_noise**2 * (band[1] - band[0]) + piece.step**2 / 12)]


def _again(prepared: Prepared, pieces: list[Piece], rests: list[Array], band: tuple[float, float]) -> list[Array]:
    """What each rest has in common with those of other passages at the same place and direction."""
    if not prepared.has_position:
        return [np.zeros_like(one) for one in rests]
    q, v = (np.concatenate([getattr(piece, name)[piece.kept] for piece in pieces]) for name in ("q", "v"))
    usual = float(np.sqrt(np.mean(v**2)))
    way = max(usual / (PLACES * band[1]), 1e-300)
    _, place = np.unique(np.column_stack([np.floor(q / way), v > 0]), axis=0, return_inverse=True)
    place = place.ravel()
    whole = np.concatenate(rests)
    passage = np.concatenate([[0], np.cumsum(np.diff(place) != 0)])
    own_count, own = np.bincount(passage), np.bincount(passage, whole)
    count = np.bincount(place)
    others = count[place] - own_count[passage]
    mean = (np.bincount(place, whole)[place] - own[passage]) / np.maximum(others, 1)
    share = float(np.clip(mean @ whole / max(float(mean @ mean), 1e-300), 0.0, 1.0))
    return np.split(share * mean, np.cumsum([len(one) for one in rests])[:-1])


def _reading_noise(prepared: Prepared, piece: Piece, inertia: float, band: tuple[float, float]) -> float:
    """Variance [N2 m2] of both readings' white noise in a band: D_q (J w^2 g^2)^2 + D_tau g^4, D densities."""
    hertz = np.linspace(*band, 200)
    position = reading_torque(hertz, prepared, inertia) * piece.reading_noise
    torque = passed(hertz, prepared.cutoff) ** 2 * piece.torque_noise
    return float(2 * (band[1] - band[0]) * np.mean(position**2 + torque**2))


def _middle(prepared: Prepared, residual: Array, low: float, high: float) -> tuple[float, float]:
    """Band that holds nine tenths of the energy between two frequencies."""
    grid = np.linspace(low, high, 61)
    energy = np.zeros(60)
    for piece, rest, _ in _parts(prepared, residual):
        hertz = np.arange(len(rest)) / (2 * len(rest) * piece.dt * piece.stride)
        energy += np.histogram(hertz, grid, weights=dct(rest, norm="ortho") ** 2)[0]
    shares = np.cumsum(energy) / max(float(energy.sum()), 1e-300)
    first, last = (int(np.searchsorted(shares, one)) for one in (OUTSIDE, 1 - OUTSIDE))
    return float(grid[first]), float(grid[min(last + 1, 60)])
