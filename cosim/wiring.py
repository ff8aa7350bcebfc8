"""Wires by name, checked against the components before anything runs.

A source is `component.output`, `signal.output`, or `signal` where it has only one. Units of one kind are converted,
others refused.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from cosim.algorithm import JACOBI, Algorithm
from cosim.component import Component, Port
from cosim.errors import UnitError, WiringError
from cosim.faults import Fault
from cosim.schedule import check_loops
from cosim.signals import Signal
from cosim.units import conversion


@dataclass(frozen=True)
class Wire:
    """y = quantise(gain * x + offset) + noise, from an output or signal to an input.

    `quantum` is the step of the quantiser (0: none), `noise` a signal that is added, `unit` that of gain * x + offset
    (the source's where not given). `breaks_loop` accepts that the wire's delay breaks an algebraic loop.
    """

    source: str
    target: str
    gain: float = 1.0
    offset: float = 0.0
    quantum: float = 0.0
    noise: str = ""
    unit: str = ""
    breaks_loop: bool = False


@dataclass(frozen=True)
class Record:
    """A column of the recording: the sample at the row's time, or the mean over the sample interval around it."""

    signal: str
    mode: Literal["sample", "mean"] = "sample"


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
        for record in self.records.values():
            self.unit(record)
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
        fed = {wire.target for wire in self.wires}
        inputs = [f"{name}.{port.name}" for name, part in self.components.items() for port in _of(part, "input")]
        return tuple(name for name in inputs if name not in fed)

    def unit(self, record: Record) -> str:
        """Return the unit of a recorded signal.

        Raises:
            WiringError: there is no such signal.
        """
        owner, _, name = record.signal.partition(".")
        if owner in self.signals:
            return self._signal(record.signal, f'The record "{record.signal}"')[1]
        if owner not in self.components:
            raise self._no_owner(record.signal)
        port = self.components[owner].ports.get(name)
        if port is None or not port.real:
            choices = tuple(port.name for port in self.components[owner].ports.values() if port.real)
            what = "is not a real number" if port else "does not exist"
            message = f'"{record.signal}" cannot be recorded: it {what}; {owner} has: {", ".join(choices)}.'
            raise WiringError(message, culprit=record.signal, choices=choices)
        return port.unit

    def sources(self) -> dict[str, Signal]:
        """Return the signals, and the noise that faults on wires add, each under a name of its own."""
        wires = {number: fault.noise() for number, fault in enumerate(self.faults) if not self.is_signal(fault.on)}
        return {**self.signals, **{f"fault {number}": noise for number, noise in wires.items() if noise}}

    def is_signal(self, name: str) -> bool:
        """Tell a signal from an input."""
        return name.partition(".")[0] in self.signals

    def full(self, source: str) -> str:
        """Complete the name of a signal that has only one output."""
        owner, dot, _ = source.partition(".")
        return source if dot or owner not in self.signals else f"{source}.{next(iter(self.signals[owner].outputs))}"

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

    def _input(self, wire: Wire) -> Port:
        owner, _, name = wire.target.partition(".")
        if owner not in self.components:
            choices = tuple(self.components)
            message = (
                f'"{wire.target}" cannot be fed: there is no component "{owner}"; components are: {", ".join(choices)}.'
            )
            raise WiringError(message, culprit=wire.target, choices=choices)
        port = self.components[owner].ports.get(name)
        if port is None or port.causality != "input" or not port.real:
            choices = tuple(port.name for port in _of(self.components[owner], "input"))
            what = "does not exist" if port is None else _kind(port)
            message = f'"{wire.target}" cannot be fed: it {what}; inputs of {owner} are: {", ".join(choices)}.'
            raise WiringError(message, culprit=wire.target, choices=choices)
        return port

    def _unit_of_source(self, wire: Wire) -> str:
        owner, _, name = wire.source.partition(".")
        if owner in self.signals:
            return self._signal(wire.source, f'"{wire.target}"')[1]
        if owner not in self.components:
            raise self._no_owner(wire.source)
        outputs = {port.name: port for port in _of(self.components[owner], "output")}
        if name not in outputs:
            have = ", ".join(outputs)
            message = f'"{wire.target}" is fed by "{wire.source}", which is not an output; outputs are: {have}'
            raise WiringError(message, culprit=wire.source, choices=tuple(outputs))
        return outputs[name].unit

    def _signal(self, source: str, who: str) -> tuple[str, str]:
        """Return output and unit of a signal named alone or with its output."""
        owner, dot, name = source.partition(".")
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
        owner = source.partition(".")[0]
        message = f'"{source}" names no component or signal "{owner}"; there are: {", ".join(choices)}.'
        return WiringError(message, culprit=source, choices=choices)


def _of(component: Component, causality: str) -> list[Port]:
    return [port for port in component.ports.values() if port.causality == causality and port.real]


def _kind(port: Port) -> str:
    article = "an" if port.causality[0] in "aeiou" else "a"
    return f"is {article} {port.causality}" if port.real else "is not a real number"
