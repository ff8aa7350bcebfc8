"""What is calibrated: an FMU alone, or a scenario or SSP; both as a scenario whose numbers have addresses.

In an FMU alone a variable is called by its own name; in a system by that of its component too: "motor.J".
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from cosim.fmi.component import Port
from cosim.fmi.description import INTERFACES, describe, own_step_of
from cosim.fmi.sound import inherited
from cosim.fmi.variables import ports_of
from cosim.support.errors import InputError
from cosim.system.address import Address, addresses
from cosim.system.scenario import Scenario
from cosim.system.sections import ComponentSection

MODEL = "model"
"""Name of the component that an FMU alone is."""
SHOWN = 30
"""Names that a message lists at most."""


@dataclass(frozen=True)
class Subject:
    """A model whose numbers can be set and whose inputs and outputs can be compared with columns.

    `source` is the file, `alone` whether it is one FMU. Ports, addresses and nominal values are by the names that a
    user writes.
    """

    source: Path
    scenario: Scenario
    ports: Mapping[str, Port]
    known: Mapping[str, Address]
    alone: bool
    nominals: Mapping[str, float] = field(default_factory=dict)
    own_step: float = 0.0
    """Length of the FMU's own steps in s; 0 where it has none."""

    def full(self, name: str) -> str:
        """The name in the scenario of what a user calls `name`."""
        return f"{MODEL}.{name}" if self.alone else name

    def with_values(self, values: Mapping[str, float]) -> Scenario:
        """The scenario with other numbers, by the names that a user writes."""
        scenario = self.scenario
        for name, value in values.items():
            scenario = self.known[name].set(scenario, value)
        return scenario

    def kind(self, causality: str) -> tuple[str, ...]:
        """Names of the variables of a causality, arrays left out."""
        return tuple(name for name, port in self.ports.items() if port.causality == causality and not port.shape)


def of_fmu(path: Path, interface: str = "") -> Subject:
    """Return an FMU as a subject, with each of its inputs open.

    Raises:
        FmuError: the file is no FMU that can run here.
    """
    description = describe(path)
    ports = ports_of(description)
    section = ComponentSection(fmu=path, interface=interface)  # type: ignore[arg-type]
    scenario = Scenario(
        path=str(path),
        text="",
        name=description.modelName or path.stem,
        description="",
        step=1.0,
        ticks=1,
        components={MODEL: section},
        signals={},
        wires=(),
        records={},
        decimation=1,
        last=True,
    )
    known = {name.removeprefix(f"{MODEL}."): one for name, one in addresses(scenario).items()}
    own = own_step_of(description, _interface(description, interface))
    return Subject(path, scenario, ports, known, True, _nominals(description), own)


def of_system(scenario: Scenario) -> Subject:
    """Return a scenario, whose components all have their FMU, as a subject."""
    ports: dict[str, Port] = {}
    nominals: dict[str, float] = {}
    for name, component in scenario.components.items():
        if component.fmu is None:
            continue
        description = describe(component.fmu)
        ours = {alias.name: key for key, alias in component.aliases.items()}
        for key, port in ports_of(description).items():
            ports[f"{name}.{ours.get(key, key)}"] = port
        nominals |= {f"{name}.{ours.get(key, key)}": value for key, value in _nominals(description).items()}
    silent = replace(scenario, decimation=1, last=True)
    return Subject(Path(scenario.path), silent, ports, addresses(scenario), False, nominals)


def unknown(option: str, name: str, source: Path, choices: Iterable[str], what: str) -> InputError:
    """The error of a name that is none of `choices`; `what` calls those that there are."""
    have = tuple(choices)
    listed = ", ".join(have[:SHOWN]) + (f" and {len(have) - SHOWN} more" if len(have) > SHOWN else "")
    text = f'{option} "{name}": {source} has no such variable; {what}: {listed or "none"}.'
    return InputError(text, culprit=name, value=name, choices=have)


def _interface(description: Any, wanted: str) -> str:
    names = {word: key for key, word in INTERFACES.items()}
    if wanted:
        return names[wanted]
    return next((key for key in INTERFACES if getattr(description, key) is not None), "coSimulation")


def _nominals(description: Any) -> dict[str, float]:
    found: dict[str, float] = {}
    for variable in description.modelVariables:
        text = inherited(variable, "nominal")
        if text is not None and float(text) > 0:
            found[variable.name] = float(text)
    return found
