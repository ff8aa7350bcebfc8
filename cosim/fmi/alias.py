"""A component under names of ours: any team's model can take a place in a scenario without new wires.

    [components.mount]
    fmu = "theirs.fmu"
    variables = { tau = "Motor.torque", q = { name = "Encoder.angle", unit = "deg" } }

A name on the left is what wires, records and parameters say; the one on the right is the component's own. `unit` is for
a variable whose model states none, or one that is not known here. Units then convert on the wires as always. A local
variable that gets a name here counts as an output.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cached_property
from typing import Any

from cosim.fmi.component import Component, Port
from cosim.fmi.domain import Domain
from cosim.support.errors import UnitError, WiringError
from cosim.support.units import unit


@dataclass(frozen=True)
class Alias:
    """The component's own name of a variable, and its unit where the component does not say it."""

    name: str
    unit: str = ""


class Aliased:
    """A component whose variables have other names; everything else is the component's own.

    Raises:
        WiringError: a name is not the component's, is given twice or is taken, or a unit contradicts the component's.
    """

    def __init__(self, component: Component, variables: Mapping[str, Alias]) -> None:
        self._component = component
        self._aliases = dict(variables)
        self._check()
        self._aliases |= _elements(component, variables)
        ours = {alias.name: name for name, alias in self._aliases.items()}
        self._ours = ours
        self.ports: Mapping[str, Port] = {
            ours.get(name, name): self._port(ours.get(name, name), port) for name, port in component.ports.items()
        }
        self.feedthrough = self._renamed(self._feedthrough())
        self.origin = component.origin | {"variables": {name: alias.name for name, alias in variables.items()}}

    @cached_property
    def initial_dependencies(self) -> Mapping[str, frozenset[str] | None]:
        """What the component says, in our names."""
        return self._renamed(self._component.initial_dependencies)

    @cached_property
    def domains(self) -> tuple[Domain, ...]:
        """Where the component is proven, in our names."""
        found: tuple[Domain, ...] = getattr(self._component, "domains", ())
        return tuple(replace(one, variable=self._ours.get(one.variable or one.name, one.variable)) for one in found)

    def enter_initialisation(self, parameters: Mapping[str, Any], time: float = 0.0) -> None:
        """Start the component with parameters under either name."""
        self._component.enter_initialisation({self._own(name): value for name, value in parameters.items()}, time)

    @property
    def behind(self) -> Component:
        """The component itself."""
        return self._component

    def settings(self, parameters: Mapping[str, Any]) -> Any:
        """What parameters under either name set."""
        return self._component.settings({self._own(name): value for name, value in parameters.items()})  # type: ignore[attr-defined]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._component, name)

    def _renamed(self, dependencies: Mapping[str, frozenset[str] | None]) -> Mapping[str, frozenset[str] | None]:
        ours = self._ours
        return {
            ours.get(output, output): None if inputs is None else frozenset(ours.get(one, one) for one in inputs)
            for output, inputs in dependencies.items()
        }

    def _feedthrough(self) -> Mapping[str, frozenset[str] | None]:
        """What the component says, and of local variables nothing."""
        known = self._component.feedthrough
        return {alias.name: None for alias in self._aliases.values() if self._local(alias.name)} | dict(known)

    def _local(self, name: str) -> bool:
        return self._component.ports[name].causality == "local"

    def _own(self, name: str) -> str:
        return self._aliases[name].name if name in self._aliases else name

    def _port(self, name: str, port: Port) -> Port:
        alias = self._aliases.get(name)
        if alias is None:
            return port
        causality = "output" if self._local(alias.name) else port.causality
        array = self._ours.get(port.array, port.array)
        return replace(port, name=name, array=array, causality=causality, unit=alias.unit or port.unit)

    def _check(self) -> None:
        component, taken = self._component, {alias.name for alias in self._aliases.values()}
        if len(taken) < len(self._aliases):
            names = [alias.name for alias in self._aliases.values()]
            twice = next(one for one in names if names.count(one) > 1)
            raise self._error(twice, f'"{twice}" of {component.name} has two names in its variables, and one is enough')
        for name, alias in self._aliases.items():
            whole = f"{component.name}.{name}"
            if alias.name not in component.ports:
                close = get_close_matches(alias.name, component.ports, n=5, cutoff=0.4) or list(component.ports)[:20]
                listed = f"names like it are: {', '.join(close)}"
                raise self._error(whole, f'"{whole}" stands for "{alias.name}", which does not exist; {listed}', *close)
            if name in component.ports and name not in taken:
                rule = f'but there is a "{name}" already; give that one another name too'
                raise self._error(whole, f'"{whole}" stands for "{alias.name}", {rule}')
            self._check_unit(whole, component.ports[alias.name].unit, alias.unit)

    def _check_unit(self, whole: str, stated: str, given: str) -> None:
        if not given:
            return
        try:
            wanted = unit(given)
        except UnitError as error:
            raise self._error(whole, f'"{whole}": {str(error).rstrip(".")}') from error
        with suppress(UnitError):  # a stated unit that is not known here is what giving one is for
            if stated and unit(stated) != wanted:
                raise self._error(whole, f'"{whole}" is in {stated}, as its model says, and cannot be in {given}')

    def _error(self, culprit: str, sentence: str, *choices: str) -> WiringError:
        return WiringError(f"{sentence}.", culprit=culprit, choices=choices)


def _elements(component: Component, variables: Mapping[str, Alias]) -> dict[str, Alias]:
    """Name the elements of arrays that have another name."""
    ours = {alias.name: (name, alias.unit) for name, alias in variables.items()}
    found = {}
    for port in component.ports.values():
        if port.array in ours:
            name, unit = ours[port.array]
            found[name + port.name.removeprefix(port.array)] = Alias(port.name, unit)
    return found
