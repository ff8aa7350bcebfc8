"""Wires by name, checked against the components before anything runs.

A source is `component.output`, `signal.output`, or `signal` where it has only one. Units of one kind are converted,
others refused.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from cosim.data.signals import Signal
from cosim.fmi.component import Component, Port
from cosim.support.errors import UnitError, WiringError
from cosim.support.units import conversion
from cosim.system.algorithm import JACOBI, Algorithm
from cosim.system.conversions import check_fault, check_record, check_wire
from cosim.system.faults import Fault
from cosim.system.ports import PortRef
from cosim.system.schedule import check_loops
from cosim.system.wire import Record, Wire

SOURCES = ("output", "calculatedParameter")
"""Causalities of variables that may feed an input."""


@dataclass(frozen=True)
class Wiring:
    """Components, signals, wires and records, by name; `every` gives the ticks of a step where they are not one."""

    components: Mapping[str, Component]
    signals: Mapping[str, Signal]
    wires: Sequence[Wire]
    records: Mapping[str, Record]
    algorithm: Algorithm = JACOBI
    every: Mapping[str, int] = field(default_factory=dict)
    faults: Sequence[Fault] = ()

    def check(self) -> None:
        """Check every name, causality and unit.

        Raises:
            WiringError: one sentence with the culprit, the rule and the choices.
        """
        self._check_names()
        fed: dict[str, str] = {}
        for wire in self.wires:
            self._input(wire)
            if wire.target in fed:
                raise WiringError(
                    f'"{wire.target}" is fed twice, by "{fed[wire.target]}" and by "{wire.source}".',
                    culprit=wire.target,
                )
            fed[wire.target] = wire.source
            self._unit_of_source(wire)
            self.gain(wire)
            check_wire(wire, self.port(wire.source), self.port(wire.target))
        for column, record in self.records.items():
            self.unit(record)
            check_record(column, record, self.port(record.signal))
        self._check_every()
        self._check_faults(fed)

    def doubts(self) -> tuple[str, ...]:
        """Return algebraic loops that cannot be excluded, as sentences.

        Raises:
            WiringError: there is one, and the algorithm does not solve it.
        """
        return check_loops(self.algorithm, self.wires, self.components)

    def unconnected(self) -> tuple[str, ...]:
        """List the inputs that no wire feeds; they keep their start values."""
        ports = [(wire.target, self.port(wire.target)) for wire in self.wires]
        fed = {f"{name.owner}.{port.variable}" for name, port in ports if port}
        inputs = [f"{name}.{port.name}" for name, part in self.components.items() for port in _of(part, "input")]
        return tuple(name for name in inputs if name not in fed)

    def unit(self, record: Record) -> str:
        """Return the unit of a recorded signal.

        Raises:
            WiringError: there is no such signal.
        """
        owner, name = record.signal.parts
        if owner in self.signals:
            return self._signal(record.signal, f'The record "{record.signal}"')[1]
        if owner not in self.components:
            raise self._no_owner(record.signal)
        port = self.components[owner].ports.get(name)
        if port is None or port.shape:
            choices = tuple(port.name for port in self.components[owner].ports.values() if not port.array)
            what = "is an array too large to be recorded" if port else "does not exist"
            message = f'"{record.signal}" cannot be recorded: it {what}; {owner} has: {", ".join(choices)}.'
            raise WiringError(message, culprit=record.signal, choices=choices)
        return port.unit

    def port(self, name: str) -> Port | None:
        """Return the variable that a name means; None for a signal's output."""
        owner, variable = PortRef(name).parts
        return self.components[owner].ports.get(variable) if owner in self.components else None

    def sources(self) -> dict[str, Signal]:
        """Return the signals, and the noise that faults on wires add, each under a name of its own."""
        wires = {number: fault.noise() for number, fault in enumerate(self.faults) if not self.is_signal(fault.on)}
        return {**self.signals, **{f"fault {number}": noise for number, noise in wires.items() if noise}}

    def is_signal(self, name: str) -> bool:
        """Tell a signal from an input."""
        return PortRef(name).owner in self.signals

    def full(self, source: str) -> str:
        """Complete the name of a signal that has only one output."""
        owner = PortRef(source).owner
        if "." in source or owner not in self.signals:
            return source
        return f"{source}.{next(iter(self.signals[owner].outputs))}"

    def gain(self, wire: Wire) -> tuple[float, float]:
        """Return gain and offset that convert the wire's unit to the target's.

        Raises:
            WiringError: the units are of different kinds.
        """
        target = self._input(wire)
        unit = wire.unit or self._unit_of_source(wire)
        try:
            if wire.noise and conversion(self._signal(wire.noise, f'The noise of "{wire.target}"')[1], target.unit) != (
                1,
                0,
            ):
                raise UnitError(f'its noise "{wire.noise}" is not in {target.unit}')
            return conversion(unit, target.unit)
        except UnitError as error:
            message = f'"{wire.target}" [{target.unit}] is fed by "{wire.source}" [{unit}]: {error}'
            raise WiringError(message, culprit=wire.target, value=unit) from error

    def _check_names(self) -> None:
        both = set(self.components) & set(self.signals)
        if both:
            raise WiringError(f'"{min(both)}" names a component and a signal; names must differ.', culprit=min(both))
        if "t" in self.records:
            raise WiringError(
                'The column "t" is time and is always recorded; give the record another name.', culprit="t"
            )

    def _check_every(self) -> None:
        for name, ticks in self.every.items():
            if name not in self.components:
                choices = tuple(self.components)
                message = f'"{name}" is given a step, but is no component; components are: {", ".join(choices)}.'
                raise WiringError(message, culprit=name, choices=choices)
            if ticks < 1:
                message = f'"{name}" shall step every {ticks} ticks; that must be a whole number from 1 on.'
                raise WiringError(message, culprit=name, value=ticks)

    def _check_faults(self, fed: Mapping[str, str]) -> None:
        for fault in self.faults:
            if self.is_signal(fault.on):
                self._signal(fault.on, "A fault")
            elif fault.on not in fed:
                choices = (*fed, *self.signals)
                message = f'A fault is on "{fault.on}", which is no signal and no input that a wire feeds; there are: '
                raise WiringError(message + ", ".join(choices) + ".", culprit=fault.on, choices=choices)
            else:
                check_fault(fault.on, self.port(fault.on))

    def _input(self, wire: Wire) -> Port:
        owner, name = wire.target.parts
        if owner not in self.components:
            choices = tuple(self.components)
            message = (
                f'"{wire.target}" cannot be fed: there is no component "{owner}"; components are: {", ".join(choices)}.'
            )
            raise WiringError(message, culprit=wire.target, choices=choices)
        port = self.components[owner].ports.get(name)
        if port is None or port.causality != "input" or port.shape:
            choices = tuple(port.name for port in _of(self.components[owner], "input"))
            what = "does not exist" if port is None else _kind(port)
            message = f'"{wire.target}" cannot be fed: it {what}; inputs of {owner} are: {", ".join(choices)}.'
            raise WiringError(message, culprit=wire.target, choices=choices)
        return port

    def _unit_of_source(self, wire: Wire) -> str:
        owner, name = wire.source.parts
        if owner in self.signals:
            return self._signal(wire.source, f'"{wire.target}"')[1]
        if owner not in self.components:
            raise self._no_owner(wire.source)
        port = self.components[owner].ports.get(name)
        if port is None or port.causality not in SOURCES or port.shape:
            outputs = tuple(port.name for port in _of(self.components[owner], "output"))
            what = "which is an array too large to be wired" if port and port.shape else "which is not an output"
            message = f'"{wire.target}" is fed by "{wire.source}", {what}; outputs are: {", ".join(outputs)}'
            raise WiringError(message, culprit=wire.source, choices=outputs)
        return port.unit

    def _signal(self, source: str, who: str) -> tuple[str, str]:
        """Return output and unit of a signal named alone or with its output."""
        (owner, name), dot = PortRef(source).parts, "." in source
        if owner not in self.signals:
            choices = tuple(self.signals)
            message = f'{who} needs the signal "{owner}", which does not exist; signals are: {", ".join(choices)}.'
            raise WiringError(message, culprit=source, choices=choices)
        outputs = dict(self.signals[owner].outputs)
        if (dot and name not in outputs) or (not dot and len(outputs) > 1):
            have = ", ".join(f"{owner}.{output}" for output in outputs)
            raise WiringError(
                f'{who} is fed by "{source}", which is not one output; outputs are: {have}', culprit=source
            )
        return (name, outputs[name]) if dot else next(iter(outputs.items()))

    def _no_owner(self, source: str) -> WiringError:
        choices = (*self.components, *self.signals)
        owner = PortRef(source).owner
        message = f'"{source}" names no component or signal "{owner}"; there are: {", ".join(choices)}.'
        return WiringError(message, culprit=source, choices=choices)


def _of(component: Component, causality: str) -> list[Port]:
    """List variables of one causality, arrays whole."""
    return [port for port in component.ports.values() if port.causality == causality and not port.array]


def _kind(port: Port) -> str:
    if port.causality == "input":
        return "is an array too large to be wired"
    article = "an" if port.causality[0] in "aeiou" else "a"
    return f"is {article} {port.causality}"
