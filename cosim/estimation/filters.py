"""The low-pass of all signals and models, and the derivative."""

from functools import lru_cache
from math import ceil

import numpy as np
import numpy.typing as npt

from cosim.estimation.kernels import done, library

Array = npt.NDArray[np.float64]
EDGE = 15
"""Rows, at least, by which signals are continued at both ends, turned about their last row, before filtering."""
FADED = 6.0
"""Periods of the cutoff by which they are continued: what the filter starts with has faded to 1e-6 there. With fewer an
axis at constant speed was taken to start and stop at the ends of each piece."""


def lowpass(columns: Array, dt: float, cutoff: float, passes: int = 1) -> Array:
    """Fourth-order Butterworth, forward and backward: no phase, -6 dB at the cutoff [Hz]; along the first axis."""
    signals = np.array(columns.T, order="C", ndmin=2)
    lowpass_in_place(signals, dt, cutoff, passes)
    return np.asarray(signals.T.reshape(columns.shape) if columns.ndim < 2 else signals.T)


def lowpass_in_place(signals: Array, dt: float, cutoff: float, passes: int = 1) -> None:
    """The same along the last axis of (signals, rows), which are overwritten."""
    if cutoff < 0.45 / dt:
        _both_ways(signals, *_butterworth(cutoff * dt, passes), max(EDGE, ceil(FADED / (cutoff * dt))))


def highpass(column: Array, dt: float, cutoff: float) -> Array:
    """The same of one column (rows,) for what is faster than the cutoff [Hz]."""
    signals = np.array(column, ndmin=2)
    _both_ways(signals, *_butterworth(cutoff * dt, 1, high=True), EDGE)
    return np.asarray(signals[0])


def noise_of(values: Array, dt: float) -> float:
    """RMS of white noise per sample, judged from the upper 40 % of the spectrum."""
    high = highpass(values - values[0], dt, 0.6 * 0.5 / dt)
    return float(np.sqrt(np.mean(high[20:-20] ** 2) / 0.4))


def _both_ways(signals: Array, sections: Array, settled: Array, edge: int) -> None:
    (many, rows), kernels = signals.shape, library()
    edge = min(edge, rows - 1)
    if kernels is not None:
        places = signals.ctypes.data, many, rows, edge, sections.ctypes.data, settled.ctypes.data, len(sections)
        done(kernels.filter_run(*places))
        return
    from scipy.signal import sosfilt  # it takes longer to import than to filter a recording

    before, after = 2 * signals[:, :1] - signals[:, edge:0:-1], 2 * signals[:, -1:] - signals[:, -2::-1][:, :edge]
    passed = np.concatenate([before, signals, after], axis=1)
    for _ in ("forward", "backward"):
        passed = sosfilt(sections, passed, zi=settled[:, None] * passed[:, :1])[0][:, ::-1]
    signals[:] = passed[:, edge : edge + rows]


@lru_cache(maxsize=1024)  # each piece has a time step of its own, and all of them are filtered in turn
def _butterworth(cutoff: float, passes: int, high: bool = False) -> tuple[Array, Array]:
    """Sections (b0 b1 b2 a0 a1 a2) of the filter, and the states that they settle in at a constant 1.

    A pair of poles of quality Q, by the bilinear transform with k = tan(pi cutoff), is

        k^2 (1 + z^-1)^2 / (1 + k/Q + k^2 + 2 (k^2 - 1) z^-1 + (1 - k/Q + k^2) z^-2),

    (1 - z^-1)^2 in its place for what is faster; 1/Q = 2 cos(pi/8) and 2 cos(3 pi/8). `cutoff` is in cycles a row.
    """
    k = np.tan(np.pi * cutoff)
    sections = []
    for damping in (2 * np.cos(np.pi / 8), 2 * np.cos(3 * np.pi / 8)):
        whole = 1 + k * damping + k**2
        top = np.array([1.0, -2.0, 1.0] if high else [k**2, 2 * k**2, k**2])
        sections.append([*top / whole, 1.0, 2 * (k**2 - 1) / whole, (1 - k * damping + k**2) / whole])
    settled, given = [], 1.0
    for b0, b1, b2, _, a1, a2 in sections * passes:
        passed = given * (b0 + b1 + b2) / (1 + a1 + a2)
        late = b2 * given - a2 * passed
        settled.append([b1 * given - a1 * passed + late, late])
        given = passed
    return np.array(sections * passes), np.array(settled)


def passes_of(cutoff: float, motion: float) -> int:
    """How often the second filter acts: the band is that of two passes at `cutoff`."""
    return 2 if motion > cutoff else 1


def gain(hertz: float, dt: float, cutoff: float) -> float:
    """What one pass of `lowpass` leaves of a tone."""
    if cutoff >= 0.45 / dt:
        return 1.0
    ratio = np.tan(np.pi * min(hertz * dt, 0.49)) / np.tan(np.pi * cutoff * dt)
    return float(1 / (1 + ratio**8))


def derivative(x: Array, dt: float) -> Array:
    """Five-point central difference; the two rows at each end repeat the nearest one."""
    inner = (x[:-4] - 8 * x[1:-3] + 8 * x[3:-1] - x[4:]) / (12 * dt)
    return np.concatenate([inner[:1], inner[:1], inner, inner[-1:], inner[-1:]])


def derivative_at(x: Array, dt: float, rows: npt.NDArray[np.int64], order: int = 1) -> Array:
    """The same at some rows alone, of so high an order: of all rows of a fast recording most are not wanted."""
    at = np.clip(rows, 2, len(x) - 3)

    def value(k: int) -> Array:
        return derivative_at(x, dt, at + k, order - 1) if order > 1 else x[at + k]

    return np.asarray((value(-2) - 8 * value(-1) + 8 * value(1) - value(2)) / (12 * dt))


def between(t: Array, values: Array, at: Array) -> Array:
    """A signal of rows at times t (rows,), read between them at times of any shape; NaN beyond its ends.

    By a cubic spline, which is loaded here: it brings an optimiser along (.1 s).
    """
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(t, values, extrapolate=False)(at))
