"""The contract of what a master steps.

Call sequence, once each unless said otherwise:

    1. `ports`                      names, references, causality and units, before anything runs
    2. `start(parameters)`          sets parameters and start values, initialises at t = 0
    3. `get`, `set`, `step`         in every tick, or their addresses in `functions`, called by the C loop
    4. `close()`                    frees everything, whatever happened before

Statuses are those of FMI: 0 OK, 1 warning, 2 discard, 3 error, 4 fatal; above 1 a component must not be stepped again.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Any, Protocol

import numpy as np

OK, WARNING = 0, 1
NOT_FINITE, TERMINATED = 100, 101
STATUSES = {
    2: "discarded the step",
    3: "returned an error",
    4: "failed for good",
    5: "left the step pending",
    NOT_FINITE: "gave an output that is not a finite number",
    TERMINATED: "asked to end the simulation",
}


@dataclass(frozen=True)
class Port:
    """A variable of a component as the outside sees it; `unit` is empty where unknown."""

    name: str
    reference: int
    causality: str
    unit: str = ""
    description: str = ""
    start: float | None = None
    low: float = -inf
    high: float = inf
    settable: bool = False
    real: bool = True


@dataclass(frozen=True)
class Functions:
    """Addresses that the compiled loop calls: set, get and step of reals in FMI `version` 2 or 3."""

    version: int
    instance: int
    set: int
    get: int
    step: int


class Component(Protocol):
    """Anything a master can step."""

    name: str
    origin: dict[str, Any]

    @property
    def ports(self) -> Mapping[str, Port]:
        """Variables by name."""

    @property
    def functions(self) -> Functions | None:
        """Addresses for the compiled loop; None for a component that only Python can step."""

    def start(self, parameters: Mapping[str, Any]) -> None:
        """Set parameters and start values by name and initialise at t = 0; may be called again for another run."""

    def set(self, references: np.ndarray, values: np.ndarray) -> int:
        """Set real inputs; references uint32, values float64, shape (n,)."""

    def get(self, references: np.ndarray, values: np.ndarray) -> int:
        """Write the values of real variables into `values`."""

    def step(self, time: float, size: float) -> int:
        """Go from `time` to `time + size`, both in s."""

    def messages(self) -> tuple[str, ...]:
        """What the component said last, newest at the end."""

    def close(self) -> None:
        """Free everything; may be called twice."""
