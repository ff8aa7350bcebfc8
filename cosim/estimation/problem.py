"""What all fits of a diagnosis share."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from weakref import WeakValueDictionary

import numpy as np

from cosim.estimation.fit import Fit, fit
from cosim.estimation.least_squares import ENOUGH
from cosim.estimation.prepare import Array, Prepared
from pyfmi_models.mount import Mount

LESS = 45
"""Evaluations of a structure from which an effect was taken: those that stay go far where they stood in for it."""

ROUGH = 1e-4
"""A fit that is one of many ends where a step lowers the sum of squares by less than this share. Unit: 1. What that
leaves is a nat at most (129 fits of two diagnoses), for two thirds of the evaluations."""

AT_HAND = 4
"""Of those so many stay in memory, 14 MB each where recordings are long."""


@dataclass(frozen=True)
class Problem:
    """What all fits of a diagnosis share: the base as in the card, the training data, the weight of each kept row."""

    mount: Mount
    prepared: Prepared
    weight: Array
    sample_time: float
    held: tuple[str, ...] = ()
    """Numbers of the base that these recordings do not determine: no fit changes them, none takes them for known."""
    enough: float = ENOUGH
    """Share of the sum of squares below which a fit's step ends it."""

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
        """Fit a structure, its base held to the card; `freed` names endings of parameters, as in `fit`.

        The same fit from the same start is made once while anyone holds it.
        """
        key = mount, evaluations, tuple(freed)
        found = self._fits.get(key)
        if found is None:
            pieces, held, enough = self.prepared.pieces, self.held, self.enough
            found = fit(mount, pieces, self.weight, self.mount, evaluations, freed=freed, held=held, enough=enough)
            self._fits[key] = found
        return found

    @cached_property
    def roughly(self) -> "Problem":
        """The same whose fits end where it is clear which of many is best."""
        return replace(self, enough=ROUGH)

    def without(self, found: Fit, name: str) -> Fit:
        """A fitted structure without an effect that was added to the mount, by its name, refitted."""
        own = len(self.mount.effects)
        rest = tuple(one for k, one in enumerate(found.mount.effects) if k < own or one.name != name)
        self._last.append(self.fit(replace(found.mount, effects=rest), LESS))
        return self._last[-1]

    def __getstate__(self) -> dict[str, object]:
        """What another process needs: no fits that are held here."""
        return {one.name: getattr(self, one.name) for one in fields(self)}

    @cached_property
    def _fits(self) -> WeakValueDictionary[tuple[Mount, int, tuple[str, ...]], Fit]:
        return WeakValueDictionary()

    @cached_property
    def _last(self) -> deque[Fit]:
        """Structures from which an effect was taken: the search, the proof and what comes after ask for the same."""
        return deque(maxlen=AT_HAND)
