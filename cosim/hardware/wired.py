"""A scenario as a machine sees it: one controller, one encoder, one torque, and set points for the controller."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from cosim.fmi.fmu import FmuComponent
from cosim.hardware.structures import INPUTS
from cosim.master.exchange import open_fmu
from cosim.master.planning import make_plan, make_streams
from cosim.support.errors import HardwareError
from cosim.system.algorithm import Jacobi
from cosim.system.scenario import Scenario
from cosim.system.wire import Wire
from cosim.system.wiring import Wiring

REFERENCE = "q_d"
"""The controller's input that the following error is measured from."""


@dataclass(frozen=True)
class Wired:
    """The two ends: components, and what their wires mean.

    `setpoints` has a row for each input of the controller, shape (inputs, ticks); that of the encoder is zero.
    """

    controller: FmuComponent
    plant: FmuComponent
    inputs: tuple[str, ...]
    encoder: str
    command: str
    torque: str
    position: str
    quantum: float
    setpoints: np.ndarray
    units: dict[str, str]


def wire_up(scenario: Scenario, stack: ExitStack) -> Wired:
    """Open and start both components of a scenario and compute the set points.

    Raises:
        HardwareError: the scenario is not one controller, one plant with an encoder, and set points.
        WiringError: a wire is wrong in itself.
    """
    refuse_what_has_no_machine(scenario)
    encoder, command = _ends(scenario)
    opened = {name: _open(stack, scenario, name) for name in scenario.components}
    wiring = Wiring(opened, scenario.signals, scenario.wires, scenario.records, scenario.algorithm)
    make_plan(wiring, scenario.step, 1)
    for name, component in opened.items():
        component.start(scenario.components[name].parameters)
    plant, position = encoder.source.parts
    controller, measured = encoder.target.parts
    fed = [wire for wire in scenario.wires if wire.target.startswith(f"{controller}.")]
    inputs = tuple(wire.target.port for wire in fed)
    _check_controller(scenario, controller, opened[controller], inputs)
    return Wired(
        controller=opened[controller],
        plant=opened[plant],
        inputs=inputs,
        encoder=measured,
        command=command.source.port,
        torque=command.target.port,
        position=position,
        quantum=encoder.quantum,
        setpoints=_setpoints(wiring, fed, scenario),
        units={name: opened[controller].ports[name].unit for name in inputs},
    )


def refuse_what_has_no_machine(scenario: Scenario) -> None:
    """Refuse what a simulation can do and a machine cannot."""
    if len(scenario.components) != 2:
        have = ", ".join(scenario.components)
        raise _no(scenario, f"a machine takes one controller and replaces one plant, and this has: {have}")
    if scenario.every or not isinstance(scenario.algorithm, Jacobi):
        raise _no(scenario, "on a machine both components step at each tick, by Jacobi's algorithm")
    if scenario.start:
        raise _no(scenario, f"a machine begins at 0 s, and this starts at {scenario.start:g} s")
    if scenario.faults:
        raise _no(scenario, "faults on wires belong to a simulation; a machine file injects its own")


def _no(scenario: Scenario, reason: str) -> HardwareError:
    return HardwareError(f"{scenario.path} cannot run on a machine: {reason}.", culprit=scenario.path)


def _ends(scenario: Scenario) -> tuple[Wire, Wire]:
    """Find the wire of the encoder (that with a quantum) and that of the torque, which goes the other way."""
    between = [wire for wire in scenario.wires if wire.source.owner in scenario.components]
    encoders = [wire for wire in between if wire.quantum > 0]
    if len(encoders) != 1:
        raise _no(scenario, f"one wire must have the quantum of the encoder, and {len(encoders)} have one")
    plant = encoders[0].source.owner
    commands = [wire for wire in between if wire.target.startswith(f"{plant}.")]
    if len(between) != 2 or len(commands) != 1:
        raise _no(scenario, "the plant gives one position to the controller and takes one torque from it")
    for wire in scenario.wires:
        if (wire.gain, wire.offset, wire.noise) != (1.0, 0.0, "") or (wire.quantum and wire is not encoders[0]):
            raise _no(scenario, f'the wire to "{wire.target}" has a gain, offset, quantum or noise that no machine has')
        if wire.target.startswith(f"{plant}.") and wire is not commands[0]:
            raise _no(scenario, f'"{wire.target}" is fed by a signal, and a machine has no such input')
    return encoders[0], commands[0]


def _open(stack: ExitStack, scenario: Scenario, name: str) -> FmuComponent:
    section = scenario.components[name]
    if section.fmu is None or section.variables:
        raise _no(scenario, f'"{name}" must be an FMU with its own names')
    return stack.enter_context(open_fmu(section.fmu, name, section.interface))


def _check_controller(scenario: Scenario, name: str, component: FmuComponent, inputs: Sequence[str]) -> None:
    if REFERENCE not in inputs:
        raise _no(scenario, f'"{name}.{REFERENCE}" must be fed, or there is no following error to watch')
    if len(inputs) > INPUTS:
        raise _no(scenario, f"the controller has {len(inputs)} inputs, and a record has room for {INPUTS}")
    if not component.can_get_and_set_state:
        raise _no(scenario, f'"{name}" cannot save its state, which each entry into operation starts from')
    period = period_of(component)
    if period and abs(period - scenario.step) > 1e-9 * period:
        raise _no(scenario, f'"{name}" is sampled every {period:g} s and the loop every {scenario.step:g} s')


def period_of(component: FmuComponent) -> float:
    """Return the sample time that an FMU states in s; 0 where it states none."""
    return component.own_step


def _setpoints(wiring: Wiring, fed: Sequence[Wire], scenario: Scenario) -> np.ndarray:
    ticks = np.arange(scenario.ticks)
    names = [f"{name}.{output}" for name, one in wiring.sources().items() for output in one.outputs]
    streams = make_streams(wiring, scenario.step)
    values = dict(zip(names, np.concatenate([stream(ticks) for stream in streams]), strict=True)) if streams else {}
    zero = np.zeros(scenario.ticks)
    rows = [values.get(wiring.full(wire.source), zero) for wire in fed]
    _check_units(wiring, fed, scenario)
    return np.ascontiguousarray(rows)


def _check_units(wiring: Wiring, fed: Sequence[Wire], scenario: Scenario) -> None:
    for wire in fed:
        if wiring.gain(wire) != (1.0, 0.0):
            raise _no(scenario, f'the wire to "{wire.target}" converts units, which is not done on a machine')
