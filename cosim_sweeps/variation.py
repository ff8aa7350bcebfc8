"""How parameters vary, each by an inverse distribution function, and which points of their space are run.

    "controller.kp" = [100.0, 225.0, 400.0]                       these values, equally likely
    "controller.kp" = { low = 100.0, high = 400.0, count = 4 }    evenly; scale = "log" or "integer"
    "mount.axis.inertia" = { mean = 30.0, std = 1.5 }             normal, cut at low and high where given
    Fc = { of = ["mount.friction.Fc", "controller.compensation.Fc"], low = 1.0, high = 4.0, count = 7 }

The key is the parameter, or any name where `of` lists the parameters that all take the value. `count` is for a grid.
"""

from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from math import exp, floor, inf, isfinite, log, prod
from statistics import NormalDist
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from cosim.system.address import Value

Point = tuple[Value, ...]
"""Values of one run, in the order of the variations."""
LIMIT = 1_000_000
"""Most runs of one sweep."""


class Variation(BaseModel):
    """A varied quantity: the parameters it sets and how it is spread."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    of: tuple[str, ...] = Field(min_length=1)

    @model_validator(mode="before")
    @classmethod
    def _one_or_many(cls, given: Any) -> Any:
        if isinstance(given, dict) and isinstance(given.get("of"), str):
            return given | {"of": [given["of"]]}
        return given

    @abstractmethod
    def at(self, u: float) -> Value:
        """Return the value below which the share u (0 <= u < 1) of all runs lies."""

    def grid(self) -> tuple[Value, ...]:
        """Return the values of a grid, none where there can be no grid."""
        return ()


class Values(Variation):
    """These values."""

    values: tuple[Value, ...] = Field(min_length=1)

    def at(self, u: float) -> Value:
        """Take them as equally likely."""
        return self.values[floor(u * len(self.values))]

    def grid(self) -> tuple[Value, ...]:
        """All of them."""
        return self.values


class Range(Variation):
    """From low to high: evenly in value, in its logarithm, or over the whole numbers, ends included."""

    low: float
    high: float
    scale: Literal["linear", "log", "integer"] = "linear"
    count: int | None = Field(default=None, ge=1, le=LIMIT)

    @model_validator(mode="after")
    def _fits(self) -> "Range":
        if not isfinite(self.high - self.low):
            raise ValueError(f"low = {self.low:g} and high = {self.high:g} are too far apart")
        if self.low >= self.high:
            raise ValueError(f"low = {self.low:g} must be below high = {self.high:g}")
        if self.scale == "log" and self.low <= 0:
            raise ValueError('scale = "log" needs low above 0')
        if self.scale == "integer" and not (self.low.is_integer() and self.high.is_integer()):
            raise ValueError('scale = "integer" needs whole numbers as low and high')
        return self

    def at(self, u: float) -> Value:
        """Spread u evenly on the scale."""
        if self.scale == "integer":
            return self.low + floor(u * (self.high - self.low + 1))
        if self.scale == "log":
            return exp(log(self.low) + u * log(self.high / self.low))
        return self.low + u * (self.high - self.low)

    def grid(self) -> tuple[Value, ...]:
        """`count` values; all whole numbers where none is given for them."""
        if self.scale == "integer":
            last = int(self.high - self.low)
            count = min(self.count or last + 1, last + 1, LIMIT + 1)
            return tuple(self.low + round(k * last / max(count - 1, 1)) for k in range(count))
        if self.count is None:
            return ()
        inner = tuple(self.at(k / (self.count - 1)) for k in range(1, self.count - 1))
        return (self.low, *inner, self.high)[: self.count]


class Normal(Variation):
    """Normal distribution, cut at `low` and `high`: what lies beyond is drawn again, so to speak."""

    mean: float
    std: float = Field(gt=0)
    low: float = Field(default=-inf, allow_inf_nan=True)
    high: float = Field(default=inf, allow_inf_nan=True)

    @model_validator(mode="after")
    def _fits(self) -> "Normal":
        below, above = self._shares()
        if above - below < 1e-9:
            raise ValueError(f"no values lie between low = {self.low:g} and high = {self.high:g}")
        return self

    def at(self, u: float) -> Value:
        """Invert the distribution function between the cuts."""
        below, above = self._shares()
        share = min(max(below + u * (above - below), 1e-16), 1 - 1e-16)
        return min(max(NormalDist(self.mean, self.std).inv_cdf(share), self.low), self.high)

    def _shares(self) -> tuple[float, float]:
        spread = NormalDist(self.mean, self.std)
        return spread.cdf(self.low), spread.cdf(self.high)


def kind_of(given: Any) -> type[Variation]:
    """Tell by its keys which kind of variation is meant."""
    keys = set(given) if isinstance(given, dict) else {"values"}
    return Values if "values" in keys else Normal if keys & {"mean", "std"} else Range


@dataclass(frozen=True)
class Design:
    """A countable set of points; `points` yields them in the order of their numbers."""

    runs: int
    points: Callable[[], Iterator[Point]]


def grid(variations: Sequence[Variation]) -> Design:
    """Every combination; the last one varies fastest."""
    axes = [variation.grid() for variation in variations]
    return Design(prod(map(len, axes)), lambda: product(*axes))


def drawn(variations: Sequence[Variation], runs: int, seed: int, latin: bool) -> Design:
    """Independent draws, or a Latin hypercube; a seed repeats them.

    A hypercube cuts each range into as many equally likely parts as there are runs, and meets each part once.
    Reference: McKay, Beckman, Conover, Technometrics 21 (1979) 239.
    """

    def points() -> Iterator[Point]:
        random, count = np.random.default_rng(seed), len(variations)
        if latin:
            shares = np.stack([(random.permutation(runs) + random.random(runs)) / runs for _ in range(count)], axis=1)
        else:
            shares = random.random((runs, count))
        return (tuple(one.at(u) for one, u in zip(variations, row, strict=True)) for row in shares.tolist())

    return Design(runs, points)
