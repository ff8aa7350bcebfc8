"""Arrays wired and recorded whole: a wire or record of an array becomes one for each of its elements."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import prod

from cosim.fmi.component import Component, Port
from cosim.fmi.types import elements, indexed
from cosim.fmi.variables import MOST_ELEMENTS
from cosim.support.errors import WiringError
from cosim.system.ports import PortRef
from cosim.system.wire import Record, Wire


def each_wire(wires: Sequence[Wire], components: Mapping[str, Component]) -> list[Wire]:
    """Put a wire for each element in the place of those from array to array.

    Raises:
        WiringError: the two are not of the same shape, or only one is an array.
    """
    return [one for wire in wires for one in _each_wire(wire, components)]


def each_record(records: Mapping[str, Record], components: Mapping[str, Component]) -> dict[str, Record]:
    """Put a column for each element in the place of those that record an array: `x` becomes `x[1]`, `x[2]`, ..."""
    return {name: one for key, record in records.items() for name, one in _each_record(key, record, components)}


def _each_wire(wire: Wire, components: Mapping[str, Component]) -> Iterator[Wire]:
    source, target = (_port(name, components) for name in (wire.source, wire.target))
    shapes = tuple(port.shape if port else () for port in (source, target))
    if shapes == ((), ()) or _too_large(shapes):
        yield wire
        return
    if shapes[0] != shapes[1]:
        sizes = [" x ".join(map(str, shape)) + " elements" if shape else "one value" for shape in shapes]
        rule = "wire arrays of one shape, or their elements by index"
        message = f'"{wire.target}" has {sizes[1]} and "{wire.source}" {sizes[0]}; {rule}.'
        raise WiringError(message, culprit=wire.target, value=shapes)
    for index in elements(shapes[0]):
        yield replace(wire, source=indexed(wire.source, index), target=indexed(wire.target, index))


def _each_record(key: str, record: Record, components: Mapping[str, Component]) -> Iterator[tuple[str, Record]]:
    port = _port(record.signal, components)
    if port is None or not port.shape or _too_large((port.shape,)):
        yield key, record
        return
    for index in elements(port.shape):
        yield indexed(key, index), replace(record, signal=indexed(record.signal, index))


def _too_large(shapes: tuple[tuple[int, ...], ...]) -> bool:
    return any(prod(shape) > MOST_ELEMENTS or 0 in shape for shape in shapes)


def _port(name: str, components: Mapping[str, Component]) -> Port | None:
    owner, variable = PortRef(name).parts
    return components[owner].ports.get(variable) if owner in components else None
