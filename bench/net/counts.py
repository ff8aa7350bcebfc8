"""What a diagnosis computes, as counts: they do not depend on the machine or on what else it does."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from unittest.mock import patch

from cosim.estimation import problem
from cosim.estimation.inverse import Inverse
from cosim.estimation.prepare import Piece


@dataclass
class Counts:
    """Fits of structures, evaluations of a model on a piece of a recording, and rows times columns of those."""

    fits: int = 0
    evaluations: int = 0
    row_columns: int = 0

    def as_json(self) -> dict[str, int]:
        """Plain data."""
        return {"fits": self.fits, "evaluations": self.evaluations, "row_columns": self.row_columns}


@contextmanager
def counted() -> Iterator[Counts]:
    """Count in this process, until the context ends."""
    counts, fit, columns = Counts(), problem.fit, Inverse.columns

    def counting_fit(*args: Any, **more: Any) -> Any:
        counts.fits += 1
        return fit(*args, **more)

    def counting_columns(self: Inverse, piece: Piece, values: Any) -> Any:
        counts.evaluations += 1
        counts.row_columns += len(piece.t) * (1 + len(self.by))
        return columns(self, piece, values)

    with patch.object(problem, "fit", counting_fit), patch.object(Inverse, "columns", counting_columns):
        yield counts
