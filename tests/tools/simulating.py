"""A system in one line, for tests: pairs of names are wires, names are records, the rest is a System's or Options'."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

from cosim.data.recording import Recording
from cosim.master.result import RunResult
from cosim.master.simulate import Options
from cosim.master.simulate import simulate as simulate_system
from cosim.system.system import System
from cosim.system.wire import Record, Wire

_OPTIONS = {one.name for one in fields(Options)}


def simulate(
    components: Mapping[str, Any],
    wires: Sequence[Wire | tuple[str, str]],
    *,
    record: Mapping[str, str | Record],
    **given: Any,
) -> RunResult:
    """Simulate components; further arguments are fields of `System` and `Options`."""
    given = {key: value for key, value in given.items() if value is not None}
    system = System(
        components=components,
        wires=[one if isinstance(one, Wire) else Wire(*one) for one in wires],
        records={name: one if isinstance(one, Record) else Record(one) for name, one in record.items()},
        **{key: value for key, value in given.items() if key not in _OPTIONS},
    )
    return simulate_system(system, Options(**{key: value for key, value in given.items() if key in _OPTIONS}))


def alone(
    fmu: Any, wires: Sequence[Wire | tuple[str, str]], record: Mapping[str, str | Record], **given: Any
) -> RunResult:
    """Simulate an FMU alone, as "one", for four steps of 0.1 s unless told otherwise."""
    return simulate({"one": fmu}, wires, record=record, **({"step": 0.1, "ticks": 4} | given))


def pair(
    fmu: Any, wires: Sequence[Wire | tuple[str, str]], record: Mapping[str, str | Record], **given: Any
) -> Recording:
    """Simulate an FMU that is there twice, as "one" and "two", for four steps of 0.1 s unless told otherwise."""
    found = simulate({"one": fmu, "two": fmu}, wires, record=record, **({"step": 0.1, "ticks": 4} | given))
    return found.recording
