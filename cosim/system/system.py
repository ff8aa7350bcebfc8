"""A system: what is simulated, before anything of it is opened. A scenario means one, and Python code can make one.

read_scenario -> Scenario -> System        what a file says, checked by itself
System -> Wiring -> Plan                   opened and compiled: names checked against components, then places on a bus
Plan -> RunResult                          executed by the loop
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.data.signals import Signal
from cosim.fmi.alias import Alias
from cosim.fmi.component import Component
from cosim.system.algorithm import JACOBI, Algorithm
from cosim.system.faults import Fault
from cosim.system.wire import Record, Wire


@dataclass(frozen=True)
class Fmu:
    """An FMU and the interface by which it is stepped: "co-simulation", "model-exchange", or "" for what it has."""

    path: Path
    interface: str = ""


@dataclass(frozen=True)
class Function:
    """A Python function, `file.py:name`, with units of inputs and outputs; `where` it is named, for messages."""

    source: str
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    where: str


Source = Component | Fmu | Function | Path
"""Where a component comes from; one that is given open stays open and can be used again."""


@dataclass(frozen=True, kw_only=True)
class System:
    """Components, signals, wires, and what is recorded of them.

    Args:
        components: by name, FMU paths or other sources.
        wires: from "component.output", "signal.output" or "signal" to "component.input".
        records: by column, what is recorded: "component.variable" or "signal.output".
        step: length of a tick in s.
        ticks: how many; the recording has rows at ticks 0, decimation, 2 decimation, ...
        signals: generators (see `signals`), arrays with one value a tick, or numbers.
        parameters: by component, parameters and start values by name; "signal.output" is its value at the start.
        algorithm: how components are coupled; Jacobi where not given.
        every: by component, the ticks of its step where they are not one.
        variables: by component, names of ours for variables of its own (see `alias`).
        faults: what breaks on wires and signals, and when (see `faults`).
        decimation: ticks for each row.
        start: time of tick 0 in s, for components and recording; signals and faults count from the first tick.
        last: also record the sample at the end, where nothing is stepped any more.
        name: what the recording is called.
        text: the scenario that means it; the recording keeps it.
        notes: what a run shall say of where it comes from, as sentences.
    """

    components: Mapping[str, Source]
    records: Mapping[str, Record]
    step: float
    ticks: int
    wires: Sequence[Wire] = ()
    signals: Mapping[str, Signal | npt.NDArray[np.float64] | float] = field(default_factory=dict)
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    algorithm: Algorithm = JACOBI
    every: Mapping[str, int] = field(default_factory=dict)
    variables: Mapping[str, Mapping[str, Alias]] = field(default_factory=dict)
    faults: Sequence[Fault] = ()
    decimation: int = 1
    start: float = 0.0
    last: bool = False
    name: str = "run"
    text: str = ""
    notes: Sequence[str] = ()

    @property
    def ends_on_a_row(self) -> bool:
        """Whether a row is recorded at the end."""
        return self.last and self.ticks % self.decimation == 0
