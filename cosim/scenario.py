"""Scenarios: a TOML file that names components, wires, inputs, the step and what to record.

    name, step [s], stop [s]
    [algorithm]         kind = "jacobi" | "gauss-seidel" | "iterated" | "energy" and its options, see `algorithm`
    [components.NAME]   fmu = "file.fmu", or card = "CARD" with part = "plant" | "controller"; parameters = { NAME =
                        number, or "signal.output": its value at the start };
                        or model = "pointing_error", see `pyfmi_models.pointing`;
                        interface = "model-exchange" to step it by the built-in solver;
                        or python = "file.py:function" with inputs and outputs, see `function`;
                        variables = { NAME = "its own name" or { name, unit } } where its names differ, see `renamed`
                        every = ticks of a step of this component, or step = s, a whole multiple of the scenario's
    [signals.NAME]      kind = "sine" | "ramp" | "sidereal" | "star" | "constant" | "steps" | "multisine" | "chirp"
                        | "slews" | "recorded" | "noise" and what the kind needs, see `signals`
    [[connections]]     from, to; gain, offset, quantum, noise, unit, breaks_loop where wanted
    [[faults]]          on, kind, from, until and what the kind needs, see `faults`
    [record]            signals = { column = "component.variable", ... } or a list of them; decimation; mode

Files are relative to the scenario. A name without .toml is a shipped scenario.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from cosim.algorithm import JACOBI, Algorithm
from cosim.complaint import complaint
from cosim.errors import ScenarioError, WiringError
from cosim.faults import Fault
from cosim.renamed import Alias
from cosim.signals import Generator, Recorded, Signal
from cosim.wiring import Record, Wire


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, populate_by_name=True)


class VariableSection(_Section):
    """A variable by the component's own name, with its unit where the component does not say it."""

    name: str
    unit: str = ""

    @model_validator(mode="before")
    @classmethod
    def _only_a_name(cls, given: Any) -> Any:
        return {"name": given} if isinstance(given, str) else given


class ComponentSection(_Section):
    """`[components.NAME]`: an FMU, a part of a card or a model from which one is built, or a Python function."""

    fmu: Path | None = None
    card: str | None = None
    part: Literal["plant", "controller"] | None = None
    model: Literal["pointing_error"] | None = None
    interface: Literal["", "co-simulation", "model-exchange"] = ""
    python: str | None = None
    inputs: dict[str, str] = {}
    outputs: dict[str, str] = {}
    parameters: dict[str, float | bool | str] = {}
    variables: dict[str, VariableSection] = {}
    every: int | None = Field(default=None, ge=1)
    step: float | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _one_source(self) -> "ComponentSection":
        sources = [one for one in (self.fmu, self.card, self.model, self.python) if one is not None]
        named = self.python is not None and bool(self.outputs)
        if len(sources) != 1 or (self.card is None) != (self.part is None) or named != bool(self.inputs | self.outputs):
            raise ValueError(
                'give fmu = "...", or card = "..." with part = "plant" or "controller", or model = "pointing_error", '
                'or python = "file.py:function" with inputs and outputs'
            )
        if self.every is not None and self.step is not None:
            raise ValueError("give either every or step")
        return self

    @property
    def aliases(self) -> dict[str, Alias]:
        """The variables that have a name of ours, by that name."""
        return {name: Alias(**one.model_dump()) for name, one in self.variables.items()}


class ConnectionSection(_Section):
    """`[[connections]]`: one wire."""

    source: str = Field(alias="from")
    target: str = Field(alias="to")
    gain: float = 1.0
    offset: float = 0.0
    quantum: float = Field(default=0.0, ge=0)
    noise: str = ""
    unit: str = ""
    breaks_loop: bool = False


class RecordSection(_Section):
    """A recorded signal with its mode."""

    signal: str
    mode: Literal["sample", "mean"]


class RecordingSection(_Section):
    """`[record]`: columns, ticks for each row, and the mode of columns that state none."""

    signals: dict[str, str | RecordSection] | list[str] = Field(min_length=1)
    decimation: int = Field(default=1, ge=1)
    mode: Literal["sample", "mean"] = "sample"


class _File(_Section):
    name: str = ""
    description: str = ""
    step: float = Field(default=1e-4, gt=0)
    stop: float = Field(gt=0)
    algorithm: Algorithm = JACOBI
    components: dict[str, ComponentSection] = Field(min_length=1)
    signals: dict[str, Generator] = {}
    connections: list[ConnectionSection] = []
    faults: list[Fault] = []
    record: RecordingSection


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

    @property
    def stop(self) -> float:
        """Length of the run in s."""
        return self.ticks * self.step

    def with_fmus(self, fmus: Mapping[str, Path]) -> "Scenario":
        """Return the scenario with these FMUs in the place of the cards of the components named."""
        changed = {name: self.components[name].model_copy(update={"fmu": path}) for name, path in fmus.items()}
        return replace(self, components={**self.components, **changed})


def read_scenario(source: str | Path) -> Scenario:
    """Read a scenario from a file or by the name of a shipped one.

    Raises:
        ScenarioError: one sentence that names file, key, value and rule.
    """
    path = Path(source)
    shipped = files("cosim") / "scenarios" / f"{source}.toml"
    if not path.exists() and shipped.is_file():
        return parse_scenario(shipped.read_text("utf-8"), str(source), Path())
    if path.suffix == ".ssp":
        from cosim.ssp import read_ssp  # most runs need no XML

        text, folder = read_ssp(path)
        return parse_scenario(text, str(source), folder)
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
        raw = _File.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{path} is not valid TOML: {error}.", culprit=path) from error
    except ValidationError as error:
        raise ScenarioError(**complaint(error, path, "a scenario", _keys)) from error
    _check_algorithm(raw, path)
    return Scenario(
        path=path,
        text=text,
        name=raw.name or Path(path).stem,
        description=raw.description,
        step=raw.step,
        ticks=_ticks(raw, path),
        components={name: _located(one, directory) for name, one in raw.components.items()},
        signals={name: _located_signal(one, directory) for name, one in raw.signals.items()},
        wires=tuple(Wire(**one.model_dump()) for one in raw.connections),
        records=_records(raw.record),
        decimation=raw.record.decimation,
        algorithm=raw.algorithm,
        every=_every(raw, path),
        faults=tuple(raw.faults),
    )


def _check_algorithm(raw: _File, path: str) -> None:
    try:
        raw.algorithm.acts(tuple(raw.components))
    except WiringError as error:
        raise ScenarioError(f"{path}: {error}", culprit=error.culprit, choices=error.choices) from error


def _ticks(raw: _File, path: str) -> int:
    return _whole(raw.stop, raw.step, path, "stop")


def _every(raw: _File, path: str) -> dict[str, int]:
    """Return the ticks of a step of the components that do not step at each."""
    found = {}
    for name, one in raw.components.items():
        ticks = one.every or (_whole(one.step, raw.step, path, f"components.{name}.step") if one.step else 1)
        if ticks > 1:
            found[name] = ticks
    return found


def _whole(time: float, step: float, path: str, key: str) -> int:
    """Return how many steps a time is, to a millionth.

    Raises:
        ScenarioError: it is no whole number of them.
    """
    ticks = round(time / step)
    if ticks < 1 or abs(time / step - ticks) > 1e-6 * ticks:
        raise ScenarioError(
            f"{path}: {key} = {time} is not a whole number of steps of {step} s.", culprit=key, value=time
        )
    return ticks


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
    modes = {name: Record(one, section.mode) for name, one in named.items() if isinstance(one, str)}
    return {name: modes.get(name) or Record(**one.model_dump()) for name, one in named.items()}  # type: ignore[union-attr]


def _kinds(union: Any) -> dict[str, Any]:
    """Map the kinds of signals, algorithms or faults to their classes."""
    return {get_args(one.model_fields["kind"].annotation)[0]: one for one in get_args(get_args(union)[0])}


def _keys(location: tuple[int | str, ...]) -> tuple[str, ...]:
    """List the legal keys beside the one at `location`."""
    sections = {"components": ComponentSection, "connections": ConnectionSection, "record": RecordingSection}
    section: Any = _File
    if location[2:3] == ("variables",):
        section = VariableSection
    elif len(location) > 1 and location[0] == "algorithm":
        section = _kinds(Algorithm)[str(location[1])]
    elif len(location) > 1:
        kinds = _kinds(Fault if location[0] == "faults" else Generator)
        section = sections.get(str(location[0])) or kinds[str(location[2])]
    return tuple(field.alias or name for name, field in section.model_fields.items())
