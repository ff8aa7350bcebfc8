"""What a fit moves: free parameters in units of their own, so that whatever must not cross cannot.

    values = matrix u,   low <= u <= high

Where an effect says that one parameter is above another by a factor at least (`Effect.ordered`), u holds what the
upper one has beyond that, and the bound on u keeps it from going below zero.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.estimation.prepare import Array
from pyfmi_models.effects import Effect
from pyfmi_models.mount import Mount


@dataclass(frozen=True)
class Coordinates:
    """The matrix (parameters, parameters) and the bounds of u."""

    matrix: Array
    low: Array
    high: Array

    def of(self, values: Array) -> Array:
        """The u of these values, a little inside its bounds."""
        u = np.linalg.solve(self.matrix, values)
        return np.asarray(np.clip(u, np.nextafter(self.low, 0) + 1e-9, np.nextafter(self.high, 0) - 1e-9))


def coordinates(mount: Mount, free: Sequence[str], scale: Array, edges: tuple[Array, Array]) -> Coordinates:
    """Coordinates of the free parameters, given their units and their lowest and highest values."""
    matrix, low, high = np.diag(scale), edges[0] / scale, edges[1] / scale
    for lower, upper, factor in _ordered(mount, free):
        matrix[upper, lower] = factor * scale[lower]
        low[upper], high[upper] = 0.0, (edges[1][upper] - factor * edges[0][lower]) / scale[upper]
    return Coordinates(matrix, low, high)


def _ordered(mount: Mount, free: Sequence[str]) -> list[tuple[int, int, float]]:
    """Numbers of the free parameters that must not cross, lower and upper, and the least factor between them."""
    found = [(f"{own}.{a}", f"{own}.{b}", least) for own, part in mount.of_kind(Effect) for a, b, least in part.ordered]
    return [(free.index(a), free.index(b), least) for a, b, least in found if a in free and b in free]
