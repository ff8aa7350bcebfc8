"""Columns in the frequency domain: what springs and drives answer is a product there."""

import numpy as np
import numpy.typing as npt
from scipy.fft import irfft, next_fast_len, rfft

from cosim.estimation.prepare import Array


class Spectrum:
    """Columns in the frequency domain, mirrored at both ends so that a shift does not wrap around.

    What is mirrored fades to zero: a jump from the last row to the first would ring through all of them.
    """

    def __init__(self, columns: Array, dt: float) -> None:
        self.rows = len(columns)
        self.pad = min(self.rows - 1, int(0.5 / dt) + 8)
        extended = np.pad(columns, ((self.pad, self.pad), (0, 0)), mode="reflect", reflect_type="odd")
        fade = np.sin(np.pi / 2 * np.arange(self.pad) / self.pad)[:, None] ** 2
        extended[: self.pad] *= fade
        extended[len(extended) - self.pad :] *= fade[::-1]
        # Zeros behind what has faded: a length without large prime factors is transformed several times faster.
        self.length = next_fast_len(len(extended), real=True)
        self.omega = 2 * np.pi * np.fft.rfftfreq(self.length, dt)
        self.values = rfft(extended.T, self.length).T

    def times(self, response: npt.NDArray[np.complex128], columns: slice = slice(None)) -> Array:
        """Some of the columns after a frequency response."""
        whole = irfft(self.values.T[columns] * response, self.length)
        return np.asarray(whole[:, self.pad : self.pad + self.rows].T)
