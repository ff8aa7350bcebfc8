"""The sections of a scenario file: which keys there are, and what each may hold."""

from pathlib import Path
from typing import Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, model_validator

from cosim.data.signals import Generator
from cosim.fmi.alias import Alias
from cosim.support.numbers import LONGEST, Count, Seconds, Step
from cosim.system.algorithm import JACOBI, Algorithm
from cosim.system.faults import Fault
from cosim.system.wire import Record, Wire, keys_of


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
    interface: Literal["", "co-simulation", "model-exchange", "scheduled-execution"] = ""
    python: str | None = None
    inputs: dict[str, str] = {}
    outputs: dict[str, str] = {}
    parameters: dict[str, int | float | bool | str | list[int | float | bool | str]] = {}
    variables: dict[str, VariableSection] = {}
    every: Count | None = None
    step: Step | None = None

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


class RecordingSection(_Section):
    """`[record]`: columns, ticks for each row, and the mode of columns that state none."""

    signals: dict[str, str | Record] | list[str] = Field(min_length=1)
    decimation: Count = 1
    mode: Literal["sample", "mean"] = "sample"
    last: bool = False


class File(_Section):
    """A scenario as its file says it."""

    name: str = ""
    description: str = ""
    notes: list[str] = []
    step: Step = 1e-4
    stop: Seconds
    start: float = Field(default=0.0, ge=0.0, le=LONGEST)
    algorithm: Algorithm = JACOBI
    components: dict[str, ComponentSection] = Field(min_length=1)
    signals: dict[str, Generator] = {}
    connections: list[Wire] = []
    faults: list[Fault] = []
    record: RecordingSection


def _kinds(union: Any) -> dict[str, Any]:
    """Map the kinds of signals, algorithms or faults to their classes."""
    return {get_args(one.model_fields["kind"].annotation)[0]: one for one in get_args(get_args(union)[0])}


def keys(location: tuple[int | str, ...]) -> tuple[str, ...]:
    """List the legal keys beside the one at `location`."""
    sections = {"components": ComponentSection, "connections": Wire, "record": RecordingSection}
    section: Any = File
    if location[2:3] == ("variables",):
        section = VariableSection
    elif len(location) > 1 and location[0] == "algorithm":
        section = _kinds(Algorithm)[str(location[1])]
    elif len(location) > 1:
        kinds = _kinds(Fault if location[0] == "faults" else Generator)
        section = sections.get(str(location[0])) or kinds[str(location[2])]
    if section is Wire:
        return keys_of(Wire)
    return tuple(field.alias or name for name, field in section.model_fields.items())
