"""The low-pass of all signals and models, and the derivative."""

from functools import lru_cache
from math import ceil

import numpy as np
import numpy.typing as npt
from scipy.signal import butter, sosfilt, sosfilt_zi

from cosim.estimation.kernels import done, library

Array = npt.NDArray[np.float64]
EDGE = 15
"""Rows, at least, by which signals are continued at both ends, turned about their last row, before filtering."""
FADED = 6.0
"""Periods of the cutoff by which they are continued: what the filter starts with has faded to 1e-6 there. With fewer an
axis at constant speed was taken to start and stop at the ends of each piece."""


def lowpass(columns: Array, dt: float, cutoff: float, passes: int = 1) -> Array:
    """Fourth-order Butterworth, forward and backward: no phase, -6 dB at the cutoff [Hz]; along the first axis."""
    if cutoff >= 0.45 / dt:
        return columns
    sections, settled = _filter(dt, cutoff, passes)
    edge, kernels = min(max(EDGE, ceil(FADED / (cutoff * dt))), len(columns) - 1), library()
    if kernels is not None:
        signals = np.array(columns.T, order="C", ndmin=2)
        many, rows = signals.shape
        places = signals.ctypes.data, many, rows, edge, sections.ctypes.data, settled.ctypes.data, len(sections)
        done(kernels.filter_run(*places))
        return signals.T.reshape(columns.shape) if columns.ndim < 2 else signals.T
    # What SciPy's `sosfiltfilt` does, but that finds out anew each time how the filter settles: a third of its time.
    before, after = 2 * columns[:1] - columns[edge:0:-1], 2 * columns[-1:] - columns[-2::-1][:edge]
    settled = settled.reshape(*settled.shape, *[1] * (columns.ndim - 1))
    passed = np.concatenate([before, columns, after])
    for _ in ("forward", "backward"):
        passed = sosfilt(sections, passed, axis=0, zi=settled * passed[:1])[0][::-1]
    return np.asarray(passed[edge : len(passed) - edge])


@lru_cache(maxsize=1024)  # each piece has a time step of its own, and all of them are filtered in turn
def _filter(dt: float, cutoff: float, passes: int) -> tuple[Array, Array]:
    """Sections of the filter, and the states it settles in at a constant 1; designing costs as much as filtering."""
    sections = np.tile(butter(4, cutoff, fs=1 / dt, output="sos"), (passes, 1))
    return np.ascontiguousarray(sections), np.ascontiguousarray(sosfilt_zi(sections))


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
