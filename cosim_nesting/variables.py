"""What the FMU of a system shows: free inputs, parameters and outputs of its components, and its signals."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite
from typing import Literal

from cosim.fmi.component import Port
from cosim_nesting.prepared import Prepared


@dataclass(frozen=True)
class Shown:
    """A variable of the FMU, called as in the scenario; `part` -1 is a signal, whose number is the `reference`."""

    name: str
    kind: Literal["INPUT", "PARAMETER", "OUTPUT"]
    part: int
    reference: int
    unit: str = ""
    description: str = ""
    start: float = 0.0


def shown_of(prepared: Prepared) -> tuple[Shown, ...]:
    """Inputs that no wire feeds, then parameters, then outputs and signals; doubles, one by one."""
    found = [*_of_components(prepared), *_of_signals(prepared)]
    return tuple(one for kind in ("INPUT", "PARAMETER", "OUTPUT") for one in found if one.kind == kind)


def _of_components(prepared: Prepared) -> Iterator[Shown]:
    fed = {str(wire.target) for wire in prepared.wiring.wires}
    given = {
        (one.part, one.reference): one.values[0] for one in prepared.given if one.function in ("SetReal", "SetFloat64")
    }
    for number, part in enumerate(prepared.plan.parts):
        for port in part.component.ports.values():
            name, kind = f"{part.name}.{port.name}", _kind(port)
            if kind is None or name in fed:
                continue
            start = given.get((number, port.reference), port.start)
            value = float(start) if isinstance(start, int | float) and isfinite(start) else 0.0
            yield Shown(name, kind, number, port.reference, port.unit, port.description, value)


def _kind(port: Port) -> Literal["INPUT", "PARAMETER", "OUTPUT"] | None:
    if not port.real:
        return None
    if port.causality == "input":
        return "INPUT"
    if port.causality == "parameter" and port.settable and isinstance(port.start, int | float):
        return "PARAMETER"
    return "OUTPUT" if port.causality == "output" else None


def _of_signals(prepared: Prepared) -> Iterator[Shown]:
    number = 0
    for name, signal in prepared.wiring.sources().items():
        for output, unit in signal.outputs.items():
            if not name.startswith("fault "):
                yield Shown(f"{name}.{output}", "OUTPUT", -1, number, unit, f"Signal {name} of the system")
            number += 1
