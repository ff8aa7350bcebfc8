"""From names to places: a checked wiring becomes the plan that the loop executes."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cosim.component import Component
from cosim.faults import broken
from cosim.loop import Column, Link, Part, Plan
from cosim.schedule import backward, order_of, turns
from cosim.signals import Stream
from cosim.wiring import Record, Wire, Wiring

Places = Mapping[str, int]


def make_plan(wiring: Wiring, step: float, decimation: int) -> Plan:
    """Turn checked names into places on a bus.

    Raises:
        WiringError: a name, unit or the algorithm does not fit.
    """
    wiring.check()
    wiring.doubts()
    order = order_of(wiring.algorithm.acts(tuple(wiring.components)))
    places = _places(wiring, order)
    signal = len(places)
    for name, one in wiring.sources().items():
        for output in one.outputs:
            places[f"{name}.{output}"] = len(places)
    return Plan(
        parts=tuple(_part(wiring, name, places, step) for name in order),
        turns=turns(wiring.algorithm, wiring.wires, wiring.components, wiring.every),
        columns=tuple(_column(wiring, record, places) for record in wiring.records.values()),
        signal=signal,
        signals=len(places) - signal,
        bus=np.zeros(len(places)),
        step=step,
        decimation=decimation,
    )


def make_streams(wiring: Wiring, step: float) -> list[Stream]:
    """Start the streams of all signals, with their faults, in the order of their places."""
    made = []
    for name, signal in wiring.sources().items():
        stream = signal.stream(step)
        for fault in wiring.faults:
            if wiring.is_signal(fault.on) and fault.on.partition(".")[0] == name:
                output = list(signal.outputs).index(wiring.full(fault.on).partition(".")[2])
                stream = broken(stream, fault, output, step)
        made.append(stream)
    return made


def _places(wiring: Wiring, order: Sequence[str]) -> dict[str, int]:
    """Number what is used of each component: its outputs, then its inputs."""
    names = [full for name in order for full in (*_outputs(wiring, name), *_inputs(wiring, name))]
    return {full: index for index, full in enumerate(names)}


def _inputs(wiring: Wiring, name: str) -> list[str]:
    return [wire.target for wire in wiring.wires if wire.target.partition(".")[0] == name]


def _outputs(wiring: Wiring, name: str) -> list[str]:
    wanted = [wire.source for wire in wiring.wires] + [record.signal for record in wiring.records.values()]
    inputs = _inputs(wiring, name)
    return [one for one in dict.fromkeys(wanted) if one.partition(".")[0] == name and one not in inputs]


def _part(wiring: Wiring, name: str, places: Places, step: float) -> Part:
    component, inputs, outputs = wiring.components[name], _inputs(wiring, name), _outputs(wiring, name)
    return Part(
        name=name,
        component=component,
        input_references=_references(component, inputs),
        output_references=_references(component, outputs),
        input=places[inputs[0]] if inputs else 0,
        output=places[outputs[0]] if outputs else 0,
        input_names=tuple(full.partition(".")[2] for full in inputs),
        links=tuple(_link(wiring, wire, places, step) for wire in wiring.wires if wire.target in inputs),
        every=wiring.every.get(name, 1),
        direct=any(component.feedthrough.values()),
    )


def _link(wiring: Wiring, wire: Wire, places: Places, step: float) -> Link:
    gain, offset = wiring.gain(wire)
    faults = {number: fault for number, fault in enumerate(wiring.faults) if fault.on == wire.target}
    return Link(
        source=places[wiring.full(wire.source)],
        target=places[wire.target],
        noise=places[wiring.full(wire.noise)] if wire.noise else -1,
        gain=gain * wire.gain,
        offset=gain * wire.offset + offset,
        quantum=gain * wire.quantum,
        breaks_loop=wire.breaks_loop or wire.target in backward(wiring.algorithm, wiring.wires, wiring.components),
        faults=tuple(fault.of_wire(step, places.get(f"fault {n}.value", -1)) for n, fault in faults.items()),
    )


def _column(wiring: Wiring, record: Record, places: Places) -> Column:
    fed = any(wire.target == record.signal for wire in wiring.wires)
    return Column(places[wiring.full(record.signal)], record.mode == "mean", late=fed)


def _references(component: Component, names: list[str]) -> Any:
    ports = [component.ports[name.partition(".")[2]] for name in names]
    return np.array([port.reference for port in ports], dtype=np.uint32)
