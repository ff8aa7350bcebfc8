"""What a loop executes, with names turned into places on one bus of values.

A tick is a programme of stages, taken in their order: `Gather` carries values to the inputs of some components, `Step`
takes some over their step, `Iterate` and `Balance` take some over the tick together. A stage names its components by
the index of the first and their number, so they stand side by side in `Plan.parts`.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.fmi.component import Component


@dataclass(frozen=True)
class Fault:
    """From tick `first` to before `last` a wire gives gain x + offset + bus[noise], or the value it had at `first`."""

    first: int
    last: int
    gain: float = 1.0
    offset: float = 0.0
    noise: int = -1
    freeze: bool = False


@dataclass(frozen=True)
class Link:
    """A wire: bus[target] = quantise(gain * bus[source] + offset) + bus[noise]; -1 and 0 mean no noise, no quantum.

    `table` holds pairs: where the result is the first of one, the target gets the second.
    `breaks_loop`: where values at the start depend on each other in a ring, it is followed once only.
    """

    source: int
    target: int
    noise: int = -1
    gain: float = 1.0
    offset: float = 0.0
    quantum: float = 0.0
    faults: tuple[Fault, ...] = ()
    breaks_loop: bool = False
    table: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class Part:
    """A component and the places of its values: inputs from `input`, outputs from `output` on.

    `links` feed it. It steps every `every` ticks: inputs are taken at the first of them, outputs shown after the last.
    """

    name: str
    component: Component
    input_references: np.ndarray
    output_references: np.ndarray
    input: int
    output: int
    input_names: tuple[str, ...] = ()
    output_names: tuple[str, ...] = ()
    links: tuple[Link, ...] = ()
    every: int = 1


@dataclass(frozen=True)
class Column:
    """A recorded place; `mean` takes the mean over the sample interval centred at its time, a value held per tick.

    Outputs and signals are noted as they are at the start of a tick, inputs (`late`) as they act in it. `kind` is the
    type of what the place names in the pool of the plan; empty for a number.
    """

    source: int
    mean: bool = False
    late: bool = False
    kind: str = ""


@dataclass(frozen=True)
class Gather:
    """Carry values to the inputs of these components, where a step of theirs begins."""

    part: int
    parts: int


@dataclass(frozen=True)
class Step:
    """Take these components over their step, where one of theirs ends."""

    part: int
    parts: int


@dataclass(frozen=True)
class Inner:
    """A wire between two components that are coupled: that of part `part` with number `link`.

    `back` says that its source comes after its target in their order.
    """

    part: int
    link: int
    back: bool


@dataclass(frozen=True)
class Iterate:
    """Take these components over the tick together by the theta method, iterated to a tolerance."""

    part: int
    parts: int
    inner: tuple[Inner, ...]
    tolerance: float
    most: int
    theta: float


@dataclass(frozen=True)
class Balance:
    """Take these components over the tick together in pieces whose size keeps the energy lost on the bonds small.

    A bond is a pair of inner wires, by number, whose values multiply to a power. `most` is a power of two.
    """

    part: int
    parts: int
    inner: tuple[Inner, ...]
    bonds: tuple[tuple[int, int], ...]
    tolerance: float
    most: int


PlannedStage = Gather | Step | Iterate | Balance


@dataclass(frozen=True)
class Plan:
    """Everything a loop needs; `bus` is its memory. Signals take the places from `signal` on."""

    parts: tuple[Part, ...]
    stages: tuple[PlannedStage, ...]
    columns: tuple[Column, ...]
    signal: int
    signals: int
    bus: np.ndarray
    step: float
    decimation: int
    pool: Any = None
    """Texts, binaries and exact integers that the bus names; None where there are none."""
    named: tuple[int, ...] = ()
    """The places that name something in the pool."""
    start: float = 0.0
    """Time of tick 0 in s, as components and the recording see it."""

    def inputs(self, part: int) -> dict[str, float]:
        """Return the inputs of a part as they are on the bus now, by name."""
        one = self.parts[part]
        values = self.bus[one.input : one.input + len(one.input_names)]
        return dict(zip(one.input_names, values.tolist(), strict=True))


@dataclass(frozen=True)
class Failure:
    """The part (by index) that failed, the tick in which the step that failed began, and the status."""

    part: int
    tick: int
    status: int


@dataclass
class Effort:
    """What a coupled stage took: iterations (or pieces) in all, the most in one tick, pieces too large at the limit."""

    rounds: int = 0
    greatest: int = 0
    at_limit: int = 0
