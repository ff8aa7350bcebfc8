"""From a system to what can be compiled: components are opened, signals checked, arrays wired element by element."""

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, cast

import numpy as np

from cosim.data.signals import Samples, Signal, check_signal
from cosim.fmi.alias import Aliased
from cosim.fmi.component import Component
from cosim.fmi.function import FunctionComponent, load_function
from cosim.fmi.guard import Guard
from cosim.master.exchange import open_fmu
from cosim.support.errors import WiringError
from cosim.system.arrays import each_record, each_wire
from cosim.system.plan import Plan
from cosim.system.ports import PortRef
from cosim.system.system import Fmu, Function, Source, System
from cosim.system.wiring import Wiring

Settings = dict[str, dict[str, Any]]
"""Parameters and start values by component and name."""


def wiring_of(stack: ExitStack, system: System) -> Wiring:
    """Open the components of a system, which the stack closes, and return what is wired with what.

    Raises:
        WiringError, FmuError, SignalError: one sentence.
    """
    opened = {name: _opened(stack, name, source, system) for name, source in system.components.items()}
    return Wiring(
        components=opened,
        signals={name: _signal(name, one, system) for name, one in system.signals.items()},
        wires=each_wire(system.wires, opened),
        records=each_record(system.records, opened),
        algorithm=system.algorithm,
        every=system.every,
        faults=system.faults,
    )


def started(wiring: Wiring, system: System, plan: Plan) -> Settings:
    """Bring the components into initialisation mode with their parameters and start values, and return those."""
    for name in system.parameters:
        if name not in wiring.components:
            have = tuple(wiring.components)
            message = f'Parameters are given for "{name}", which is no component; components are: {", ".join(have)}.'
            raise WiringError(message, culprit=name, choices=have)
    settings = {
        name: {key: _at_start(one, wiring.signals, plan.step) for key, one in system.parameters.get(name, {}).items()}
        for name in wiring.components
    }
    for name, component in wiring.components.items():
        component.enter_initialisation(settings[name], plan.start)
    return settings


def _opened(stack: ExitStack, name: str, source: Source, system: System) -> Component:
    """Open a component, with our names for its variables; one that is given open stays so after the run.

    Structural parameters are told at once, because the wires depend on the arrays whose size they are.
    """
    component = open_source(stack, name, source)
    names = system.variables.get(name, {})
    if hasattr(component, "configure"):
        given = system.parameters.get(name, {}).items()
        component.configure({names[key].name if key in names else key: value for key, value in given})
    return cast(Component, Aliased(component, names)) if names else component


def open_source(stack: ExitStack, name: str, source: Source) -> Component:
    """Open a component under its own names, which the stack closes; one that is given open stays as it is.

    Raises:
        FmuError, WiringError: it cannot be opened.
    """
    if isinstance(source, Function):
        guard = Guard()
        function, origin = load_function(source.source, source.where, guard)
        return FunctionComponent(function, source.inputs, source.outputs, name, origin, guard)
    if isinstance(source, Path | str):
        return stack.enter_context(open_fmu(source, name))
    return stack.enter_context(open_fmu(source.path, name, source.interface)) if isinstance(source, Fmu) else source


def _signal(name: str, given: Any, system: System) -> Signal:
    """Return what is given as a signal: a generator as it is, an array or a number as samples."""
    made: Signal = given if hasattr(given, "stream") else Samples(given, name=name)
    check_signal(name, made, system.step, system.ticks)
    if isinstance(made, Samples):
        made.check(system.ticks + system.ends_on_a_row)
    return made


def _at_start(value: Any, signals: Mapping[str, Signal], step: float) -> Any:
    """Return the value at tick 0 of a signal's output that is named, and anything else as it is."""
    owner, name = PortRef(value).parts if isinstance(value, str) else ("", "")
    if owner not in signals or name not in signals[owner].outputs:
        return value
    first = signals[owner].stream(step)(np.zeros(1, dtype=np.int64))
    return float(first[list(signals[owner].outputs).index(name), 0])
