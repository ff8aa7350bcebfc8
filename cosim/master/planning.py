"""From names to places: a checked wiring becomes the plan that the loop executes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, cast

import numpy as np

from cosim.data.signals import Stream
from cosim.fmi.component import Component, Port
from cosim.fmi.fmu import FmuComponent
from cosim.fmi.types import OPAQUE
from cosim.master.loop import library
from cosim.master.pool import Pool
from cosim.master.typed import TypedComponent, Use, by_variable, needs_types
from cosim.system.conversions import exact, table_of
from cosim.system.faults import broken
from cosim.system.plan import Column, Link, Part, Plan
from cosim.system.ports import PortRef
from cosim.system.schedule import order_of, planned_stages
from cosim.system.wire import Record, Wire
from cosim.system.wiring import Wiring

Places = Mapping[str, int]


def make_plan(wiring: Wiring, step: float, decimation: int, start: float = 0.0) -> Plan:
    """Turn checked names into places on a bus; `start` [s] is the time of tick 0.

    Raises:
        WiringError: a name, unit, type or the algorithm does not fit.
    """
    wiring.check()
    wiring.doubts()
    order = order_of(wiring.algorithm.stages(tuple(wiring.components)))
    bus = _Bus(wiring, order, start)
    places = dict(bus.places)
    signal = len(places)
    for name, one in wiring.sources().items():
        for output in one.outputs:
            places[f"{name}.{output}"] = len(places)
    return Plan(
        parts=tuple(_part(bus, name, places, step) for name in order),
        stages=planned_stages(wiring.algorithm, wiring.wires, wiring.components, wiring.every),
        columns=tuple(_column(bus, record, places) for record in wiring.records.values()),
        signal=signal,
        signals=len(places) - signal,
        bus=np.zeros(len(places)),
        step=step,
        decimation=decimation,
        pool=bus.pool,
        start=start,
        named=tuple(place for name, place in bus.places.items() if bus.uses[name].opaque),
    )


def make_streams(wiring: Wiring, step: float) -> list[Stream]:
    """Start the streams of all signals, with their faults, in the order of their places."""
    made = []
    for name, signal in wiring.sources().items():
        stream = signal.stream(step)
        for fault in wiring.faults:
            if wiring.is_signal(fault.on) and PortRef(fault.on).owner == name:
                output = list(signal.outputs).index(PortRef(wiring.full(fault.on)).port)
                stream = broken(stream, fault, output, step)
        made.append(stream)
    return made


@dataclass(frozen=True)
class _Bus:
    """What stands on the bus: of each component its outputs that are used, then its inputs that are fed."""

    wiring: Wiring
    order: Sequence[str]
    start: float
    uses: dict[str, Use] = field(default_factory=dict)

    def __post_init__(self) -> None:
        cast_ = {wire.target for wire in self.wiring.wires if wire.cast}
        names = [*self._fed, *self._read]
        ports = {name: cast(Port, self.wiring.port(name)) for name in dict.fromkeys(names)}
        faults = {fault.on for fault in self.wiring.faults}
        kept = exact(self.wiring.wires, self.wiring.records, ports, faults)
        self.uses.update({name: Use(port, name in cast_, name in kept) for name, port in ports.items()})

    @cached_property
    def _fed(self) -> list[str]:
        return [wire.target for wire in self.wiring.wires]

    @cached_property
    def inputs_fed(self) -> frozenset[str]:
        """The inputs that a wire feeds."""
        return frozenset(self._fed)

    @cached_property
    def _read(self) -> list[str]:
        wanted = [wire.source for wire in self.wiring.wires]
        wanted += [record.signal for record in self.wiring.records.values()]
        names = [one for one in dict.fromkeys(wanted) if one.owner in self.wiring.components]
        return [one for one in names if one not in self.inputs_fed]

    @cached_property
    def inputs(self) -> dict[str, list[str]]:
        """The inputs of each component, in the order of their places."""
        return {name: self._sorted(name, self._fed) for name in self.order}

    @cached_property
    def outputs(self) -> dict[str, list[str]]:
        """The outputs of each component, in the order of their places."""
        return {name: self._sorted(name, self._read) for name in self.order}

    @cached_property
    def places(self) -> dict[str, int]:
        """Places by full name."""
        names = [full for name in self.order for full in (*self.outputs[name], *self.inputs[name])]
        return {full: index for index, full in enumerate(names)}

    @cached_property
    def pool(self) -> Any:
        """Where texts, binaries and exact integers are kept; None where there are none."""
        found = library()
        named = any(use.opaque for use in self.uses.values())
        return Pool(found) if named and found is not None and hasattr(found, "pool_new") else None

    def component(self, name: str) -> Component:
        """Return a component as the loop calls it."""
        component = self.wiring.components[name]
        inputs, outputs = ([self.uses[full] for full in of[name]] for of in (self.inputs, self.outputs))
        if (not needs_types([*inputs, *outputs]) and not self.start) or component.functions is None:
            return component
        return cast(Component, TypedComponent(cast(FmuComponent, component), inputs, outputs, self.pool, self.start))

    def _sorted(self, name: str, names: Sequence[str]) -> list[str]:
        uses = {full: self.uses[full] for full in names if PortRef(full).owner == name}
        places = {id(use): full for full, use in uses.items()}
        return [places[id(use)] for use in by_variable(list(uses.values()))]


def _part(bus: _Bus, name: str, places: Places, step: float) -> Part:
    wiring, inputs, outputs = bus.wiring, bus.inputs[name], bus.outputs[name]
    component = bus.component(name)
    return Part(
        name=name,
        component=component,
        input_references=_references(component, inputs),
        output_references=_references(component, outputs),
        input=places[inputs[0]] if inputs else 0,
        output=places[outputs[0]] if outputs else 0,
        input_names=tuple(PortRef(full).port for full in inputs),
        output_names=tuple(PortRef(full).port for full in outputs),
        links=tuple(_link(wiring, wire, places, step) for wire in wiring.wires if wire.target.owner == name),
        every=wiring.every.get(name, 1),
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
        breaks_loop=wire.breaks_loop,
        faults=tuple(fault.of_wire(step, places.get(f"fault {n}.value", -1)) for n, fault in faults.items()),
        table=table_of(wire, wiring.port(wire.source), cast(Port, wiring.port(wire.target))),
    )


def _column(bus: _Bus, record: Record, places: Places) -> Column:
    full = bus.wiring.full(record.signal)
    use = bus.uses.get(full)
    kind = use.port.type if use is not None and (use.port.type in OPAQUE or use.exact) else ""
    return Column(places[full], record.mode == "mean", late=record.signal in bus.inputs_fed, kind=kind)


def _references(component: Component, names: list[str]) -> Any:
    ports = [component.ports[PortRef(name).port] for name in names]
    return np.array([port.reference for port in ports], dtype=np.uint32)
