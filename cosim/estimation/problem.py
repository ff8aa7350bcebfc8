"""What all fits of a diagnosis share."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.estimation.fit import Fit, fit
from cosim.estimation.prepare import Array, Prepared
from pyfmi_models.mount import Mount


@dataclass(frozen=True)
class Problem:
    """What all fits of a diagnosis share: the base as in the card, the training data, the weight of each kept row."""

    mount: Mount
    prepared: Prepared
    weight: Array
    sample_time: float
    held: tuple[str, ...] = ()
    """Numbers of the base that these recordings do not determine: no fit changes them, none takes them for known."""

    @property
    def seconds(self) -> float:
        """Length of the longest piece of a recording."""
        return max(float(piece.t[-1] - piece.t[0]) for piece in self.prepared.pieces)

    @property
    def top_speed(self) -> float:
        """Highest speed that was recorded."""
        return max(abs(edge) for edge in self.prepared.ranges["v"])

    def error(self, found: Fit) -> float:
        """RMS of a fit's residual over the rows that count."""
        return float(np.linalg.norm(self.weight * found.residual) / np.sqrt(np.count_nonzero(self.weight)))

    def fit(self, mount: Mount, evaluations: int, freed: Sequence[str] = ()) -> Fit:
        """Fit a structure, its base held to the card; `freed` names endings of parameters, as in `fit`."""
        return fit(mount, self.prepared.pieces, self.weight, self.mount, evaluations, freed=freed, held=self.held)
