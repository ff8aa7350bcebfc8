"""The variables of an FMU as ports: scalars, arrays with their elements, and the other names that FMI 3 gives them.

The size of an array may follow structural parameters; it is that of their start values unless others are given.
"""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import fields
from math import inf, prod
from typing import Any

from cosim.fmi.component import Port
from cosim.fmi.sound import inherited
from cosim.fmi.types import FLOATS, OF_FMI2, elements, indexed
from cosim.support.memory import many_objects
from cosim.support.units import BASE, in_base_units

MOST_ELEMENTS = 65_536
"""Elements of an array at most that become ports; a larger one is shown, and can be neither wired nor recorded."""
MOST_TOGETHER = 4 * MOST_ELEMENTS
"""Elements of all arrays of an FMU that become ports, of the first ones: each takes half a kB."""


def ports_of(description: Any, sizes: Mapping[str, int] | None = None) -> dict[str, Port]:
    """List the variables of a model description and the elements of its arrays by name.

    Args:
        description: FMPy's.
        sizes: values of structural parameters by name where they are not their start values.
    """
    found: dict[str, Port] = {}
    room = MOST_TOGETHER
    with many_objects():
        for port in variables_of(description, sizes):
            found.setdefault(port.name, port)
            count = prod(port.shape) if port.shape else 0
            if 0 < count <= min(MOST_ELEMENTS, room):
                room -= count
                for one in _elements(port, count):
                    found.setdefault(one.name, one)
    return found


def variables_of(description: Any, sizes: Mapping[str, int] | None = None) -> Iterator[Port]:
    """Yield the variables of a model description under each of their names, arrays whole; arguments of `ports_of`.

    Some releases of FMPy list an alias of FMI 3 among the variables too, with its own description.
    """
    own, listed = _own_units(description), {one.name for one in description.modelVariables}
    for variable in description.modelVariables:
        shape = tuple(_size(one, sizes or {}) for one in variable.dimensions) if variable.dimensions else ()
        yield _port(variable, variable.name, own, shape)
        for alias in (one for one in variable.aliases or () if one.name not in listed):
            yield _port(variable, alias.name, own, shape)


def _elements(array: Port, count: int) -> Iterator[Port]:
    starts = _starts(array, count)
    common = {one.name: getattr(array, one.name) for one in fields(array)} | {"shape": (), "array": array.name}
    for number, index in enumerate(elements(array.shape)):
        yield Port(**common | {"name": indexed(array.name, index), "start": starts[number], "element": number})


def _size(dimension: Any, sizes: Mapping[str, int]) -> int:
    if dimension.start is not None:
        return int(dimension.start)
    return int(sizes.get(dimension.variable.name, dimension.variable.start))


def _port(variable: Any, name: str, own_units: Mapping[str, str], shape: tuple[int, ...]) -> Port:
    unit, low, high = inherited(variable, "unit") or "", inherited(variable, "min"), inherited(variable, "max")
    kind = OF_FMI2.get(variable.type, variable.type)
    return Port(
        name=name,
        reference=variable.valueReference,
        causality=variable.causality or "local",
        unit=own_units.get(unit, unit) if kind in FLOATS else "",
        description=variable.description or "",
        start=_start(variable.start, kind, bool(shape)),
        low=-inf if low is None else float(low),
        high=inf if high is None else float(high),
        not_settable=_not_settable(variable, kind),
        type=kind,
        items=_items(variable.declaredType) if kind == "Enumeration" else {},
        shape=shape,
    )


def _not_settable(variable: Any, kind: str) -> str:
    """Say why FMI lets nobody set a variable at the start; empty where it can be set.

    A start value that the description leaves out, as some do, forbids nothing.
    """
    if variable.variability == "constant":
        return "is a constant"
    if variable.causality == "independent":
        return "is the time"
    if kind == "Clock":
        return "is a clock"
    given = variable.causality in ("parameter", "input", "structuralParameter")
    return "" if given or variable.initial in ("exact", "approx") else "is calculated by the FMU"


def _items(declared: Any) -> dict[int, str]:
    return {int(one.value): one.name for one in getattr(declared, "items", None) or ()}


def _start(text: str | None, kind: str, array: bool) -> Any:
    """Read a start value: a number, or the text of a string, a binary or an array."""
    if text is None or array or kind in ("String", "Binary"):
        return text
    if kind == "Boolean":
        return float(text in ("true", "1"))
    with suppress(TypeError, ValueError):
        return float(text)
    return None


def _starts(port: Port, count: int) -> list[Any]:
    """Return the start values of the elements; None where they are not said one by one."""
    texts = str(port.start).split() if port.start is not None else []
    if port.type in ("String", "Binary") or len(texts) != count:
        return [None] * count
    return [_start(text, port.type, False) for text in texts]


def _own_units(description: Any) -> dict[str, str]:
    """Write the units of an FMU as this project knows them."""
    bases = {one.name: one.baseUnit for one in description.unitDefinitions or () if one.baseUnit is not None}
    return {
        name: in_base_units(name, {one: getattr(base, one) for one in BASE}, float(base.factor), float(base.offset))
        for name, base in bases.items()
    }
