"""What can be varied in a scenario, by name, and a scenario with other values.

component.parameter      a parameter or start value of an FMU (one made from a card is built once and set, not rebuilt),
                         or of a Python function one that the scenario gives
signal.key               a number of a signal: reference.frequency, noise.rms, noise.seed
component.input.key      gain, offset or quantum of the wire to this input
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from pydantic import ValidationError

from cosim.fmi.component import Port
from cosim.fmi.description import describe
from cosim.fmi.variables import ports_of
from cosim.support.complaint import complaint
from cosim.support.errors import ScenarioError, SweepError
from cosim.system.ports import PortRef
from cosim.system.scenario import Scenario
from cosim.system.sections import ComponentSection

Value = float | bool
WIRE_KEYS = {"gain": "1", "offset": "", "quantum": ""}


@dataclass(frozen=True)
class Address:
    """One number of a scenario: where it is, its unit, and how it is set."""

    owner: str
    key: str
    unit: str
    put: Callable[[Scenario, str, str, Value], Scenario]

    def set(self, scenario: Scenario, value: Value) -> Scenario:
        """Return the scenario with this value.

        Raises:
            ScenarioError: a signal or wire cannot have it; a component says so when it is started.
        """
        return self.put(scenario, self.owner, self.key, value)


def addresses(scenario: Scenario) -> dict[str, Address]:
    """List by name all numbers of a scenario whose components all have their FMU.

    Raises:
        FmuError: a component is no FMU.
    """
    fed = {wire.target for wire in scenario.wires}
    found: dict[str, Address] = {}
    for name, component in scenario.components.items():
        ports = _ports(component)
        units = {port.name: port.unit for port in ports.values() if port.settable and f"{name}.{port.name}" not in fed}
        units |= dict.fromkeys(component.parameters, "") if component.python else {}
        found |= {f"{name}.{key}": Address(name, key, unit, _component) for key, unit in units.items()}
        found |= _wires(scenario, name, ports)
    for name, signal in scenario.signals.items():
        found |= {f"{name}.{key}": Address(name, key, "", _signal) for key in _numbers(signal)}
    return found


def find(name: str, known: Mapping[str, Address], where: str, done: str = "varied") -> Address:
    """Return the address of this name; `where` begins the message, `done` says what was to be done with it.

    Raises:
        SweepError: there is none; lists those of the same owner, or the owners.
    """
    if name in known:
        return known[name]
    owner = PortRef(name).owner
    near = tuple(one for one in known if one.startswith(f"{owner}."))
    owners = tuple(dict.fromkeys(PortRef(one).owner for one in known))
    rule = f"of {owner} can be {done}: {', '.join(near)}" if near else f"there are: {', '.join(owners)}"
    raise SweepError(f'{where}: "{name}" is nothing that can be {done}; {rule}.', culprit=name, choices=near or owners)


def _ports(component: ComponentSection) -> dict[str, Port]:
    """List the variables of an FMU under the names of the scenario."""
    found = ports_of(describe(component.fmu)) if component.fmu else {}
    ours = {alias.name: name for name, alias in component.aliases.items()}
    return {ours.get(name, name): replace(port, name=ours.get(name, name)) for name, port in found.items()}


def _wires(scenario: Scenario, name: str, ports: Mapping[str, Port]) -> dict[str, Address]:
    targets = [wire.target for wire in scenario.wires if wire.target.owner == name]
    units = {target: ports[port].unit if (port := PortRef(target).port) in ports else "" for target in targets}
    return {
        f"{target}.{key}": Address(target, key, unit or units[target], _wire)
        for target in targets
        for key, unit in WIRE_KEYS.items()
    }


def _numbers(signal: Any) -> list[str]:
    values = {key: getattr(signal, key) for key in type(signal).model_fields}
    return [key for key, value in values.items() if isinstance(value, int | float)]


def _component(scenario: Scenario, owner: str, key: str, value: Value) -> Scenario:
    section = scenario.components[owner]
    changed = section.model_copy(update={"parameters": section.parameters | {key: value}})
    return replace(scenario, components={**scenario.components, owner: changed})


def _signal(scenario: Scenario, owner: str, key: str, value: Value) -> Scenario:
    signal: Any = scenario.signals[owner]
    try:
        changed = type(signal).model_validate(signal.model_dump() | {key: value})
    except ValidationError as error:
        raise ScenarioError(**complaint(error, f"signals.{owner}", "it", lambda _: ())) from error
    return replace(scenario, signals={**scenario.signals, owner: changed})


def _wire(scenario: Scenario, owner: str, key: str, value: Value) -> Scenario:
    if key == "quantum" and value < 0:
        raise ScenarioError(f"The quantum of the wire to {owner} is {value:g}; it must not be negative.", culprit=owner)
    changes: dict[str, Any] = {key: value}
    wires = (replace(wire, **changes) if wire.target == owner else wire for wire in scenario.wires)
    return replace(scenario, wires=tuple(wires))
