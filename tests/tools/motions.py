"""Motions of which every number is known, as the parts of a diagnosis see them."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
RATE = 200
"""Rows in a second."""
TORQUE = 2.0
"""Of every row for which no other is said."""


@dataclass
class Motion:
    """Recordings one after the other, each from its time 0, as the parts of a diagnosis see them."""

    columns: dict[str, list[Array]]
    asked: list[bool] = field(default_factory=list)

    @property
    def pieces(self) -> list[Any]:
        speeds = self.columns["v"]
        many = [len(one) for one in speeds]
        q = self.columns.get("q", [np.zeros(count) for count in many])
        asked = self.asked or [True] * len(many)
        shared = {"dt": 1 / RATE, "cutoff": RATE, "inside": slice(1, -1)}
        return [
            SimpleNamespace(kept=np.arange(n), t=np.arange(n) / RATE, q=place, v=v, is_asked=wanted, **shared)
            for n, v, place, wanted in zip(many, speeds, q, asked, strict=True)
        ]

    @property
    def recording_of(self) -> Array:
        return np.concatenate([np.full(len(one), k) for k, one in enumerate(self.columns["v"])])

    def stacked(self, name: str) -> Array:
        if name in ("t", "q"):
            return np.concatenate([getattr(piece, name) for piece in self.pieces])
        return np.concatenate(self.columns.get(name) or [np.full(len(one), TORQUE) for one in self.columns["v"]])
