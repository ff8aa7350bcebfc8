"""Scenarios: a TOML file that names components, wires, inputs, the step and what to record.

    name, description, notes = [...] that a run repeats
    step [s], stop [s]; start [s] where components and recording shall not begin at 0 (signals and faults do)
    [algorithm]         kind = "jacobi" | "gauss-seidel" | "iterated" | "energy" and its options, see `algorithm`
    [components.NAME]   fmu = "file.fmu", or card = "CARD" with part = "plant" | "controller"; parameters = { NAME =
                        number, or "signal.output": its value at the start };
                        or model = "pointing_error", see `pyfmi_models.pointing`;
                        interface = "model-exchange" to step it by the built-in solver, or
                        "co-simulation", "scheduled-execution";
                        or python = "file.py:function" with inputs and outputs, see `function`;
                        variables = { NAME = "its own name" or { name, unit } } where its names differ, see `alias`
                        every = ticks of a step of this component, or step = s, a whole multiple of the scenario's
    [signals.NAME]      kind = "sine" | "ramp" | "sidereal" | "star" | "constant" | "steps" | "multisine" | "chirp"
                        | "slews" | "recorded" | "noise" and what the kind needs, see `signals`
    [[connections]]     from, to; gain, offset, quantum, noise, unit, breaks_loop, cast, map where wanted
    [[faults]]          on, kind, from, until and what the kind needs, see `faults`
    [record]            signals = { column = "component.variable", ... } or a list of them; decimation; mode;
                        last = true also records the sample at stop

Files are relative to the scenario. A name without .toml is a shipped scenario.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from cosim.data.signals import Recorded, Signal
from cosim.support.complaint import complaint
from cosim.support.errors import ScenarioError, WiringError
from cosim.support.toml import parsed
from cosim.system.algorithm import JACOBI, Algorithm
from cosim.system.faults import Fault
from cosim.system.sections import ComponentSection, File, RecordingSection, keys
from cosim.system.system import Fmu, Function, Source, System
from cosim.system.ticks import every_of, whole
from cosim.system.variant import ssp_of
from cosim.system.wire import Record, Wire


@dataclass(frozen=True)
class Scenario:
    """A checked scenario; components made from cards get their FMU from `with_fmus` before it can run."""

    path: str
    text: str
    name: str
    description: str
    step: float
    ticks: int
    components: Mapping[str, ComponentSection]
    signals: Mapping[str, Signal]
    wires: tuple[Wire, ...]
    records: Mapping[str, Record]
    decimation: int
    algorithm: Algorithm = JACOBI
    every: Mapping[str, int] = field(default_factory=dict)
    faults: tuple[Fault, ...] = ()
    start: float = 0.0
    last: bool = False
    notes: tuple[str, ...] = ()

    @property
    def stop(self) -> float:
        """Time at which the run ends in s."""
        return self.start + self.ticks * self.step

    def system(self) -> System:
        """Return what is simulated.

        Raises:
            ScenarioError: a component is made from a card and has no FMU yet.
        """
        return System(
            components={name: self._source(name, one) for name, one in self.components.items()},
            wires=self.wires,
            records=self.records,
            step=self.step,
            ticks=self.ticks,
            signals=self.signals,
            parameters={name: one.parameters for name, one in self.components.items()},
            algorithm=self.algorithm,
            every=self.every,
            variables={name: one.aliases for name, one in self.components.items()},
            faults=self.faults,
            decimation=self.decimation,
            start=self.start,
            last=self.last,
            name=self.name,
            text=self.text,
            notes=self.notes,
        )

    def _source(self, name: str, component: ComponentSection) -> Source:
        if component.fmu is not None:
            return Fmu(component.fmu, component.interface)
        if component.python is not None:
            where = f"{self.path}: components.{name}.python"
            return Function(component.python, component.inputs, component.outputs, where)
        message = f'{self.path}: the component "{name}" has no FMU yet; `cosim run` builds it from its card.'
        raise ScenarioError(message, culprit=name)

    def with_fmus(self, fmus: Mapping[str, Path]) -> "Scenario":
        """Return the scenario with these FMUs in the place of the cards of the components named."""
        changed = {name: self.components[name].model_copy(update={"fmu": path}) for name, path in fmus.items()}
        return replace(self, components={**self.components, **changed})


def read_scenario(source: str | Path, outside: bool = False) -> Scenario:
    """Read a scenario from a file or by the name of a shipped one.

    Args:
        source: a .toml file, an .ssp archive, the .ssd of one that lies unpacked, or a name; `FILE.ssp#VARIANT.ssd` is
            another system of an archive.
        outside: whether sources of an SSP may lead out of it, to files beside it.

    Raises:
        ScenarioError: one sentence that names file, key, value and rule.
    """
    path = Path(source)
    shipped = files("cosim") / "scenarios" / f"{source}.toml"
    if not path.exists() and shipped.is_file():
        return parse_scenario(shipped.read_text("utf-8"), str(source), Path())
    archive, variant = ssp_of(source)
    if archive is not None:
        from cosim.system.ssp import read_ssp  # most runs need no XML

        return parse_scenario(read_ssp(archive, outside, variant), str(source), Path())
    if path.suffix != ".toml" or not path.is_file():
        choices = shipped_scenarios()
        rule = f"a scenario is a .toml or .ssp file or one of: {', '.join(choices)}."
        raise ScenarioError(f"{source}: no such scenario; {rule}", culprit=str(source), choices=choices)
    try:
        return parse_scenario(path.read_text("utf-8"), str(source), path.parent)
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{source} is no scenario: it is not UTF-8 text.", culprit=str(source)) from error


def shipped_scenarios() -> tuple[str, ...]:
    """Return the names of the scenarios that come with the package."""
    return tuple(sorted(one.name.removesuffix(".toml") for one in (files("cosim") / "scenarios").iterdir()))


def parse_scenario(text: str, path: str, directory: Path) -> Scenario:
    """Check the text of a scenario; `path` is its name in errors, `directory` where its files are."""
    try:
        raw = File.model_validate(parsed(text))
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{path} is not valid TOML: {error}.", culprit=path) from error
    except ValidationError as error:
        raise ScenarioError(**complaint(error, path, "a scenario", keys)) from error
    _check_algorithm(raw, path)
    ticks = whole(raw.stop - raw.start, raw.step, path, "stop - start" if raw.start else "stop")
    return Scenario(
        path=path,
        text=text,
        name=raw.name or Path(path).stem,
        description=raw.description,
        step=raw.step,
        ticks=ticks,
        components={name: _located(one, directory) for name, one in raw.components.items()},
        signals={name: _located_signal(one, directory) for name, one in raw.signals.items()},
        wires=tuple(raw.connections),
        records=_records(raw.record),
        decimation=raw.record.decimation,
        algorithm=raw.algorithm,
        every=every_of({name: (one.every, one.step) for name, one in raw.components.items()}, raw.step, path, ticks),
        faults=tuple(raw.faults),
        start=raw.start,
        last=raw.record.last,
        notes=tuple(raw.notes),
    )


def _check_algorithm(raw: File, path: str) -> None:
    try:
        raw.algorithm.stages(tuple(raw.components))
    except WiringError as error:
        raise ScenarioError(f"{path}: {error}", culprit=error.culprit, choices=error.choices) from error


def _located(component: ComponentSection, directory: Path) -> ComponentSection:
    """Make paths relative to the scenario; the name of a shipped card stays as it is."""
    fmu = None if component.fmu is None else directory / component.fmu
    python = None if component.python is None else str(directory / component.python)
    card = component.card
    if card is not None and (directory / card).is_file():
        card = str(directory / card)
    return component.model_copy(update={"fmu": fmu, "card": card, "python": python})


def _located_signal(signal: Any, directory: Path) -> Any:
    return signal.model_copy(update={"file": directory / signal.file}) if isinstance(signal, Recorded) else signal


def _records(section: RecordingSection) -> dict[str, Record]:
    named = section.signals if isinstance(section.signals, dict) else {name: name for name in section.signals}
    return {name: Record(one, section.mode) if isinstance(one, str) else one for name, one in named.items()}
