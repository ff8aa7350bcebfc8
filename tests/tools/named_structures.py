"""Structures whose effects are only names: a search of which all but the choice is a table."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.search.candidate_fit import CandidateFit


@dataclass(frozen=True)
class Named:
    """An effect that is only its name."""

    id: str
    amplitude: float = 0.0
    source: str = ""

    @property
    def title(self) -> str:
        return self.id

    name = title


@dataclass(frozen=True)
class Structure:
    """A mount that is only its effects."""

    effects: tuple[Named, ...]

    @property
    def names(self) -> str:
        return "".join(one.id for one in self.effects)


@dataclass(frozen=True)
class Fitted:
    """A fit of so many numbers, that leaves so much in each of four rows."""

    mount: Structure
    count: int = 0
    left: float = 0.0

    @property
    def names(self) -> str:
        return self.mount.names

    @property
    def residual(self) -> Any:
        return np.full(4, self.left)


def fitted(names: str, count: int = 0, left: float = 0.0) -> Fitted:
    """A fit of effects of one letter each."""
    return Fitted(Structure(tuple(Named(one) for one in names)), count, left)


def candidate(names: str, evidence: float, count: int = 0, removes: float = 0.5) -> CandidateFit:
    """The last of some effects beside the others, and what it is worth there."""
    fit = fitted(names, count, float(np.sqrt(1 - removes)))
    return CandidateFit(Named(names[-1]), fit, evidence, 0.0, removes)  # type: ignore[arg-type]


class Tables:
    """Comparison and problem in one; the base has the effect "b" of its own."""

    policy = POLICY
    mount = Structure((Named("b"),))
    prepared = None

    def enter(self, *_: object) -> None:
        """Nothing is written into a ledger here."""

    judge = enter

    @property
    def problem(self) -> "Tables":
        return self

    def fit(self, mount: Structure, iterations: int) -> Fitted:
        assert 1 < iterations < 100
        return Fitted(mount)

    def without(self, found: Fitted, name: str) -> Fitted:
        """The base keeps its own effect."""
        own = len(self.mount.effects)
        kept = tuple(one for place, one in enumerate(found.mount.effects) if one.id != name or place < own)
        return self.fit(Structure(kept), 30)
