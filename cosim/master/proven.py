"""Whether a run stays where its components are proven: operational domains, watched at the rows of a recording."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from cosim.fmi.domain import Domain
from cosim.support.errors import UnitError
from cosim.support.units import conversion
from cosim.system.ports import PortRef
from cosim.system.wire import Record
from cosim.system.wiring import Wiring

EDGE = 1e-9
"""Share of a range by which a value may lie outside: rounding."""


@dataclass
class Proven:
    """The range of one variable [its unit], and what was seen of it."""

    signal: PortRef
    low: float
    high: float
    unit: str
    first: float = inf
    """Time of the first row outside [s]; inf as long as there is none."""
    value: float = 0.0
    least: float = inf
    greatest: float = -inf

    @property
    def record(self) -> Record:
        """What is recorded of it."""
        return Record(self.signal)

    def see(self, t: np.ndarray, values: np.ndarray) -> None:
        """Look at rows, which come in their order."""
        edge = EDGE * (self.high - self.low)
        outside = np.flatnonzero((values < self.low - edge) | (values > self.high + edge))
        if len(outside) and self.first == inf:
            self.first, self.value = float(t[outside[0]]), float(values[outside[0]])
        if len(values):
            self.least = min(self.least, float(np.min(values)))
            self.greatest = max(self.greatest, float(np.max(values)))

    def __str__(self) -> str:
        unit = self.unit and f" {self.unit}"
        beyond = self.greatest if self.greatest - self.high > self.low - self.least else self.least
        said = f"{self.signal} leaves the range in which {self.signal.owner} is proven at {self.first:g} s"
        return f"{said}: {self.value:.4g}{unit}, proven {self.low:.4g} to {self.high:.4g}; at most it is {beyond:.4g}."


def proven_of(wiring: Wiring) -> list[Proven]:
    """What is watched: variables of components that state where they are proven."""
    return [
        found
        for name, component in wiring.components.items()
        for domain in getattr(component, "domains", ())
        if (found := _proven(wiring, name, domain)) is not None
    ]


def with_records(wiring: Wiring, proven: Sequence[Proven]) -> Mapping[str, Record]:
    """The records of a system, and after them one of each variable that is watched."""
    return {**wiring.records, **{f"proven {k}": one.record for k, one in enumerate(proven)}}


def said_of(proven: Sequence[Proven]) -> list[str]:
    """A sentence for each range that was left, the first one first."""
    return [str(one) for one in sorted(proven, key=lambda one: one.first) if one.first < inf]


def _proven(wiring: Wiring, name: str, domain: Domain) -> Proven | None:
    """A domain in the unit of its variable; None where there is no such real variable, or the unit does not fit."""
    signal = PortRef(f"{name}.{domain.variable or domain.name}")
    port = wiring.port(signal)
    if port is None or not port.real or port.causality not in ("input", "output", "local"):
        return None
    fed = {wire.target for wire in wiring.wires}
    if port.causality == "input" and signal not in fed:
        return None
    try:
        gain, offset = conversion(domain.unit, port.unit)
    except UnitError:
        return None
    return Proven(signal, gain * domain.low + offset, gain * domain.high + offset, port.unit)
