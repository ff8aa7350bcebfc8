"""What a loop executes, with names turned into places on one bus of values."""

from dataclasses import dataclass

import numpy as np

from cosim.component import Component


@dataclass(frozen=True)
class Part:
    """A component and the places of its values: inputs from `input`, outputs from `output` on."""

    component: Component
    input_references: np.ndarray
    output_references: np.ndarray
    input: int
    output: int
    input_names: tuple[str, ...] = ()


@dataclass(frozen=True)
class Link:
    """A wire: bus[target] = quantise(gain * bus[source] + offset) + bus[noise]; -1 and 0 mean no noise, no quantum."""

    source: int
    target: int
    noise: int = -1
    gain: float = 1.0
    offset: float = 0.0
    quantum: float = 0.0


@dataclass(frozen=True)
class Column:
    """A recorded place; `mean` takes the mean over the sample interval centred at its time, a value held per tick."""

    source: int
    mean: bool = False


@dataclass(frozen=True)
class Plan:
    """Everything a loop needs; `bus` is its memory. Signals take the places from `signal` on."""

    parts: tuple[Part, ...]
    links: tuple[Link, ...]
    columns: tuple[Column, ...]
    signal: int
    signals: int
    bus: np.ndarray
    step: float
    decimation: int

    def inputs(self, part: int) -> dict[str, float]:
        """Return the inputs of a part as they are on the bus now, by name."""
        one = self.parts[part]
        values = self.bus[one.input : one.input + len(one.input_names)]
        return dict(zip(one.input_names, values.tolist(), strict=True))


@dataclass(frozen=True)
class Failure:
    """The part (by index) that failed, the tick and the status."""

    part: int
    tick: int
    status: int
