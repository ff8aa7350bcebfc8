"""Cubic splines through readings: SciPy's would bring an optimiser along (.2 s), which a short diagnosis feels."""

import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dgtsv

Array = npt.NDArray[np.float64]


class CubicSpline:
    """The cubic spline through readings, whose third derivative is continuous at the second and the last but one.

    Args:
        t: times (rows,), rising.
        values: readings (rows,) or (rows, columns).

    Reference: de Boor, A Practical Guide to Splines (1978), ch. IV, "not-a-knot".
    """

    def __init__(self, t: Array, values: Array) -> None:
        self._t, self._values = np.asarray(t, float), np.asarray(values, float)
        self._slopes = _slopes(self._t, self._values.reshape(len(t), -1)).reshape(self._values.shape)

    def __call__(self, at: Array) -> Array:
        """Values at times (n,), those beyond the ends by the first and the last polynomial."""
        return self.with_slope(at, 0)[0]

    def with_slope(self, at: Array, count: int = 1) -> tuple[Array, Array]:
        """Values, and the derivatives by time of so many of the columns."""
        k = np.clip(np.searchsorted(self._t, at, side="right") - 1, 0, len(self._t) - 2)
        wide = self._t[k + 1] - self._t[k]
        x = (at - self._t[k]) / wide
        if self._values.ndim > 1:
            wide, x = wide[:, None], x[:, None]
        first, step = self._values[k], self._values[k + 1] - self._values[k]
        bend, turn = self._slopes[k] * wide - step, step - self._slopes[k + 1] * wide
        away = 1 - x
        value = first + x * (step + away * (away * bend + x * turn))
        few = (slice(None), slice(count)) if self._values.ndim > 1 else slice(None)
        return value, (step[few] + away * (away - 2 * x) * bend[few] + x * (2 * away - x) * turn[few]) / wide


def _slopes(t: Array, values: Array) -> Array:
    """Derivatives at the readings, (rows, columns)."""
    wide = np.diff(t)
    rises = np.diff(values, axis=0) / wide[:, None]
    if len(t) < 4:  # one polynomial through all of them
        return _of_few(t, values, rises)
    first, last = t[2] - t[0], t[-1] - t[-3]
    above, below = np.concatenate([[first], wide[:-1]]), np.concatenate([wide[1:], [last]])
    middle = np.concatenate([[wide[1]], 2 * (wide[1:] + wide[:-1]), [wide[-2]]])
    right = np.empty_like(values, order="F")
    right[1:-1] = 3 * (wide[1:, None] * rises[:-1] + wide[:-1, None] * rises[1:])
    right[0] = ((wide[0] + 2 * first) * wide[1] * rises[0] + wide[0] ** 2 * rises[1]) / first
    right[-1] = ((wide[-1] + 2 * last) * wide[-2] * rises[-1] + wide[-1] ** 2 * rises[-2]) / last
    return np.asarray(dgtsv(below, middle, above, right)[3])


def _of_few(t: Array, values: Array, rises: Array) -> Array:
    if len(t) < 3:
        return np.repeat(rises, 2, axis=0)
    bend = (rises[1] - rises[0]) / (t[2] - t[0])
    return np.asarray(rises[0] + bend * (2 * t - t[0] - t[1])[:, None])
