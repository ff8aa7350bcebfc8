"""Where a system is proven: the ranges of its components, brought to the signals that feed them and intersected."""

from collections.abc import Mapping
from dataclasses import dataclass

from cosim.fmi.component import Port
from cosim.fmi.description import describe
from cosim.fmi.domain import KEY, Domain, domains_at, domains_of
from cosim.fmi.variables import ports_of
from cosim.support.errors import UnitError
from cosim.support.plain import Json
from cosim.support.units import conversion
from cosim.system.scenario import Scenario
from cosim.system.sections import ComponentSection

Row = dict[str, Json]


@dataclass(frozen=True)
class Range:
    """The range of a signal [unit] in which one component is proven."""

    signal: str
    component: str
    low: float
    high: float
    unit: str


def proven_rows(scenario: Scenario) -> list[Row]:
    """A row for each signal: the range in which all components that state one are proven, and which these are.

    Raises:
        FmuError: an FMU cannot be read.
    """
    found: dict[str, list[Range]] = {}
    for name, component in scenario.components.items():
        ours = {alias.name: key for key, alias in component.aliases.items()}
        for one in _domains(component):
            variable = ours.get(one.variable or one.name, one.variable or one.name)
            proven = _at_source(scenario, f"{name}.{variable}", name, one)
            found.setdefault(proven.signal, []).append(proven)
    return [_row(signal, ranges) for signal, ranges in found.items()]


def _row(signal: str, ranges: list[Range]) -> Row:
    low, high = max(one.low for one in ranges), min(one.high for one in ranges)
    unit = next((one.unit for one in ranges if one.unit), "")
    said = f"{low:.4g} to {high:.4g} {unit}".rstrip()
    if low > high:
        said = "none: " + "; ".join(f"{one.component} {one.low:.4g} to {one.high:.4g} {one.unit}" for one in ranges)
    return {"signal": signal, "proven": said, "for": ", ".join(dict.fromkeys(one.component for one in ranges))}


def _domains(component: ComponentSection) -> tuple[Domain, ...]:
    if component.fmu is not None:
        return domains_at(component.fmu)
    if component.card is None or component.part != "plant":
        return ()
    from pyfmi_models.card import read_card

    return domains_of(read_card(component.card).origin.get(KEY))


def _ports(component: ComponentSection) -> Mapping[str, Port]:
    ours = {alias.name: key for key, alias in component.aliases.items()}
    found = ports_of(describe(component.fmu)) if component.fmu is not None else {}
    return {ours.get(name, name): port for name, port in found.items()}


def _at_source(scenario: Scenario, signal: str, name: str, domain: Domain) -> Range:
    """The range of what feeds an input, or of the variable itself: x for which gain x + offset is in the domain."""
    wire = next((one for one in scenario.wires if one.target == signal), None)
    if wire is None or not wire.gain or wire.table:
        return Range(signal, name, domain.low, domain.high, domain.unit)
    owner, _, variable = str(wire.source).partition(".")
    unit = wire.unit or domain.unit
    if owner in scenario.components:
        source = _ports(scenario.components[owner]).get(variable)
        unit = wire.unit or (source.unit if source else "") or domain.unit
    try:
        gain, offset = conversion(domain.unit, unit)
    except UnitError:
        return Range(signal, name, domain.low, domain.high, domain.unit)
    low, high = sorted((gain * end + offset - wire.offset) / wire.gain for end in (domain.low, domain.high))
    return Range(str(wire.source), name, low, high, unit)
