"""The master: checks the wiring, starts the components, runs the loop in chunks, and streams what is recorded.

Time is counted in ticks. How a value gets from one component to another in a tick, and so how long each wire delays, is
the algorithm's (`algorithm`); Jacobi where nothing else is said.
"""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np

import cosim
from cosim.algorithm import JACOBI, Algorithm
from cosim.component import Component
from cosim.errors import ScenarioError, WiringError
from cosim.exchange import open_fmu
from cosim.execution import Execution, Progress
from cosim.faults import Fault
from cosim.files import check_room
from cosim.function import FunctionComponent, load_function
from cosim.loop import Plan, make_loop
from cosim.planning import make_plan
from cosim.recording import Recording
from cosim.renamed import Alias, Renamed
from cosim.scenario import ComponentSection, Scenario
from cosim.signals import Samples, Signal
from cosim.wiring import Record, Wire, Wiring
from cosim.writer import MemoryWriter, StreamWriter


@dataclass(frozen=True)
class Run:
    """What came out: statistics, and the recording (read from its file when it is first asked for)."""

    statistics: dict[str, Any]
    path: Path | None = None
    _recording: Recording | None = field(default=None, repr=False)

    @cached_property
    def recording(self) -> Recording:
        """The recording, whole in memory."""
        if self._recording is not None:
            return self._recording
        assert self.path is not None  # a run without a file keeps its recording
        return Recording.read(self.path, required=())


def simulate(
    components: Mapping[str, Component | Path | str],
    wires: Sequence[Wire | tuple[str, str]],
    *,
    record: Mapping[str, str | Record],
    step: float,
    ticks: int,
    signals: Mapping[str, Any] | None = None,
    parameters: Mapping[str, Mapping[str, Any]] | None = None,
    algorithm: Algorithm | None = None,
    every: Mapping[str, int] | None = None,
    variables: Mapping[str, Mapping[str, Alias]] | None = None,
    faults: Sequence[Fault] = (),
    decimation: int = 1,
    path: Path | None = None,
    force: bool = False,
    name: str = "run",
    origin: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
    compiled: bool = True,
) -> Run:
    """Step components together and record.

    Args:
        components: FMU paths, or components (which are left open and can be used again).
        wires: `Wire`s or pairs (source, target); sources are "component.output", "signal.output" or "signal".
        record: column to what it records: "component.variable", "signal.output" or a `Record`.
        step: length of a tick in s.
        ticks: how many; the recording has rows at ticks 0, decimation, 2 decimation, ...
        signals: generators (see `signals`), arrays with one value a tick, or numbers.
        parameters: by component, parameters and start values by name; "signal.output" is its value at the start.
        algorithm: how components are coupled; Jacobi where not given.
        every: by component, the ticks of its step where they are not one.
        variables: by component, names of ours for variables of its own (see `renamed`).
        faults: what breaks on wires and signals, and when (see `faults`).
        decimation: ticks for each row.
        path: Parquet file to stream to; None keeps the recording in memory.
        force: overwrite the file.
        name: of a recording kept in memory.
        origin: what else the recording shall say about where it comes from.
        progress: called between chunks.
        compiled: False asks for the loop in Python, which gives the same bits.

    Raises:
        WiringError, FmuError, SignalError, OutputError: before the first step.
        StepError: a component failed; what was recorded before is in the file.
    """
    output = _Output(path, force, name, dict(origin or {}))
    output.check_room(-(-ticks // decimation), len(record) + 1)
    with ExitStack() as stack:
        wiring = Wiring(
            components=_opened(stack, components, variables or {}),
            signals={key: _signal(key, one, ticks) for key, one in (signals or {}).items()},
            wires=[wire if isinstance(wire, Wire) else Wire(*wire) for wire in wires],
            records={key: one if isinstance(one, Record) else Record(one) for key, one in record.items()},
            algorithm=algorithm or JACOBI,
            every=dict(every or {}),
            faults=faults,
        )
        return output.of(wiring, make_plan(wiring, step, decimation), parameters or {}, ticks, progress, compiled)


@dataclass(frozen=True)
class _Output:
    """Where a recording goes: to a file, or into memory under a name; `origin` is what else it says."""

    path: Path | None
    force: bool
    name: str
    origin: dict[str, Any]

    def check_room(self, rows: int, columns: int) -> None:
        advice = "record fewer signals, or one row in more ticks (decimation), or stop earlier"
        check_room(self.path, 8 * rows * columns, f"the recording has {rows:,} rows; {advice}")

    def of(
        self,
        wiring: Wiring,
        plan: Plan,
        parameters: Mapping[str, Mapping[str, Any]],
        ticks: int,
        progress: Progress | None,
        compiled: bool,
    ) -> Run:
        """Start the components and carry out the plan."""
        writer = self._writer(wiring, plan, _started(wiring, parameters, plan.step))
        work = Execution(wiring, plan, make_loop(plan, compiled), writer, ticks, progress)
        work.execute()
        return Run(work.statistics(), self.path, self._kept(writer))

    def _writer(self, wiring: Wiring, plan: Plan, settings: Mapping[str, Any]) -> MemoryWriter:
        story = _story(wiring, settings, plan.step, plan.decimation) | self.origin
        units = {"t": "s"} | {key: wiring.unit(one) for key, one in wiring.records.items()}
        return StreamWriter(self.path, units, story, self.force) if self.path else MemoryWriter(units, story)

    def _kept(self, writer: MemoryWriter) -> Recording | None:
        if self.path:
            return None
        known = {key: unit for key, unit in writer.units.items() if unit}
        return Recording(self.name, writer.table(), known, writer.origin)


def run(
    scenario: Scenario,
    path: Path | None = None,
    *,
    force: bool = False,
    progress: Progress | None = None,
    compiled: bool = True,
    command: str = "",
) -> Run:
    """Run a scenario whose components all have their FMU; arguments and errors as in `simulate`.

    Raises:
        ScenarioError: a component is made from a card and has no FMU yet.
    """
    for name, component in scenario.components.items():
        if component.fmu is None and component.python is None:
            message = f'{scenario.path}: the component "{name}" has no FMU yet; `cosim run` builds it from its card.'
            raise ScenarioError(message, culprit=name)
    told = {"scenario": scenario.text, "command": command}
    with ExitStack() as stack:
        return simulate(
            {name: _made(stack, name, component, scenario.path) for name, component in scenario.components.items()},
            scenario.wires,
            record=scenario.records,
            step=scenario.step,
            ticks=scenario.ticks,
            signals=scenario.signals,
            parameters={name: component.parameters for name, component in scenario.components.items()},
            algorithm=scenario.algorithm,
            every=scenario.every,
            variables={name: component.aliases for name, component in scenario.components.items()},
            faults=scenario.faults,
            decimation=scenario.decimation,
            path=path,
            force=force,
            name=scenario.name,
            origin=told,
            progress=progress,
            compiled=compiled,
        )


def _made(stack: ExitStack, name: str, section: ComponentSection, path: str) -> Component | Path:
    """Return what a section of a scenario means: an FMU, or a Python function."""
    if section.fmu is not None:
        wanted = section.interface
        return stack.enter_context(open_fmu(section.fmu, name, wanted)) if wanted else section.fmu
    assert section.python is not None  # the section has one source, and a card's FMU was asked for above
    function, origin = load_function(section.python, f"{path}: components.{name}.python")
    return FunctionComponent(function, section.inputs, section.outputs, name, origin)


def _opened(
    stack: ExitStack,
    components: Mapping[str, Component | Path | str],
    variables: Mapping[str, Mapping[str, Alias]],
) -> dict[str, Component]:
    """Open the FMUs for this run, with our names for their variables; a component given as such stays open after it."""
    opened = {}
    for key, one in components.items():
        component = stack.enter_context(open_fmu(one, key)) if isinstance(one, Path | str) else one
        names = variables.get(key)
        opened[key] = cast(Component, Renamed(component, names)) if names else component
    return opened


def _signal(name: str, signal: Any, ticks: int) -> Signal:
    made: Signal = signal if hasattr(signal, "stream") else Samples(signal, name=name)
    if isinstance(made, Samples):
        made.check(ticks)
    return made


def _started(wiring: Wiring, parameters: Mapping[str, Mapping[str, Any]], step: float) -> dict[str, dict[str, Any]]:
    """Start the components with their parameters and start values, and return those."""
    for name in parameters:
        if name not in wiring.components:
            have = tuple(wiring.components)
            message = f'Parameters are given for "{name}", which is no component; components are: {", ".join(have)}.'
            raise WiringError(message, culprit=name, choices=have)
    settings = {
        name: {key: _at_start(value, wiring.signals, step) for key, value in parameters.get(name, {}).items()}
        for name in wiring.components
    }
    for name, component in wiring.components.items():
        component.start(settings[name])
    return settings


def _at_start(value: Any, signals: Mapping[str, Signal], step: float) -> Any:
    """Return the value at tick 0 of a signal's output that is named, and anything else as it is."""
    owner, _, name = value.partition(".") if isinstance(value, str) else ("", "", "")
    if owner not in signals or name not in signals[owner].outputs:
        return value
    first = signals[owner].stream(step)(np.zeros(1, dtype=np.int64))
    return float(first[list(signals[owner].outputs).index(name), 0])


def _story(wiring: Wiring, settings: Mapping[str, Any], step: float, decimation: int) -> dict[str, Any]:
    """Say where a recording comes from."""
    return {
        "version": f"mount-cosim {cosim.__version__}",
        "step": step,
        "decimation": decimation,
        "algorithm": wiring.algorithm.model_dump(),
        "every": dict(wiring.every),
        "faults": [fault.model_dump() for fault in wiring.faults],
        "components": {name: one.origin | {"parameters": settings[name]} for name, one in wiring.components.items()},
        "wires": [asdict(wire) for wire in wiring.wires],
        "record": {name: asdict(record) for name, record in wiring.records.items()},
    }
