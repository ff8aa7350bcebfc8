"""What an SSP means, written as a scenario file."""

import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path as File
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from cosim.component import Port
from cosim.description import describe, ports_of
from cosim.errors import FmuError, UnitError
from cosim.ssp.archive import child, children
from cosim.ssp.parameters import Setting, Value, settings_of
from cosim.ssp.structure import End, Link, Path, Structure, name_of
from cosim.units import BASE, conversion, in_base_units, unit

STOP, STEPS = 1.0, 1000
"""Length of a run [s], and steps in it, where neither the SSP nor an FMU says any."""
_INTERFACES = {"CoSimulation": {"interface": "co-simulation"}, "ModelExchange": {"interface": "model-exchange"}}
_OSP = "{http://opensimulationplatform.com/SSP/OSPAnnotations}"


@dataclass(frozen=True)
class Meaning:
    """A structure with the files of its FMUs by source."""

    structure: Structure
    files: Mapping[str, File]

    @cached_property
    def names(self) -> dict[Path, str]:
        """The components as a scenario calls them; a dot there parts component and variable."""
        return {path: "/".join(one.replace(".", "_") for one in path) for path in self.structure.components}

    @cached_property
    def descriptions(self) -> dict[Path, Any]:
        """FMPy's descriptions of the FMUs."""
        return {path: self._description(path, node.source) for path, node in self.structure.components.items()}

    @cached_property
    def ports(self) -> dict[Path, dict[str, Port]]:
        """The variables of the FMUs by name."""
        return {path: ports_of(one) for path, one in self.descriptions.items()}

    @cached_property
    def own_units(self) -> dict[str, str]:
        """The units that the archive defines, as this project knows them."""
        found = {}
        for one in children(self.structure.root, "ssd:Units", "ssc:Unit"):
            name, base = one.get("name", ""), child(one, "ssc:BaseUnit")
            if base is not None:
                powers = {key: int(self.structure.archive.number(base, key)) for key in BASE}
                number = self.structure.archive.number
                found[name] = in_base_units(name, powers, number(base, "factor", 1.0), number(base, "offset"))
        return found

    def name(self, end: End) -> str:
        """Name the variable of a component as a scenario does."""
        return f"{self.names[end[0]]}.{end[1]}"

    def experiment(self) -> tuple[float, float, str]:
        """Return stop and step [s], and a sentence where they are assumed."""
        given = child(self.structure.root, "ssd:DefaultExperiment")
        start = 0.0 if given is None else self.structure.archive.number(given, "startTime")
        if start != 0:
            raise self.structure.archive.error(f"it starts at {start:g} s, and runs here start at 0")
        stop = _positive(None if given is None else given.get("stopTime"))
        step = _positive(_annotated_step(given))
        step = step or min(self._proposed("stepSize"), default=0.0)
        assumed = " and ".join(word for word, number in (("stop", stop), ("step", step)) if not number)
        stop = stop or max(self._proposed("stopTime"), default=STOP)
        return stop, step or stop / STEPS, f"It says no {assumed}, which is assumed." if assumed else ""

    def parameters(self, path: Path) -> tuple[dict[str, Value], list[str]]:
        """Return the values for the parameters of a component in its units, and the names that it does not have."""
        ports, settings = self.ports[path], settings_of(self.structure, path)
        strange = [name_of((path, name)) for name in settings if name not in ports]
        return {name: self._value(one, ports[name], path) for name, one in settings.items() if name in ports}, strange

    def wire(self, link: Link) -> dict[str, Value]:
        """Write a link as a connection; where no unit is to be converted, what arrives is said to be the target's."""
        wire: dict[str, Value] = {"from": self.name(link.start), "to": self.name(link.end)}
        wire |= {"gain": link.factor} if link.factor != 1 else {}
        wire |= {"offset": link.offset} if link.offset != 0 else {}
        unit = self._unit(link.end) if link.keep else ""
        return wire | ({"unit": unit} if unit else {})

    def units(self, path: Path) -> dict[str, str]:
        """Units of connectors whose FMU states none."""
        found = {}
        for name in self.structure.nodes[path].connectors:
            stated, said = self._stated((path, name)), self._declared((path, name))
            if name in self.ports[path] and said and not stated:
                found[name] = said
            elif _differ(said, stated):
                what = f'"{name_of((path, name))}" is in {said}'
                raise self.structure.archive.error(f"{what}, but its FMU says {stated}")
        return found

    def records(self) -> dict[str, str]:
        """Columns: all real outputs with a connector, and those of the whole system under their own names."""
        paths = list(self.structure.components)
        ends = [end for end in self.structure.ends("output", paths) if self._real(end)]
        columns = {self.name(end): self.name(end) for end in ends}
        for end in self.structure.ends("output", [()]):
            link = self.structure.traced(end)
            if link is not None and (link.factor, link.offset) == (1, 0) and end[1] != "t":
                columns[end[1]] = self.name(link.start)
        if not columns:
            raise self.structure.archive.error("no real output has a connector, so there is nothing to record")
        return columns

    def _description(self, path: Path, source: str) -> Any:
        try:
            return describe(self.files[source])
        except FmuError as error:
            raise self.structure.archive.error(f'"{".".join(path)}" ({source}): {str(error).rstrip(".")}') from error

    def _real(self, end: End) -> bool:
        port = self.ports[end[0]].get(end[1])
        return port is None or port.real

    def _stated(self, end: End) -> str:
        port = self.ports[end[0]].get(end[1])
        return "" if port is None else port.unit

    def _unit(self, end: End) -> str:
        return self._stated(end) or self._declared(end)

    def _declared(self, end: End) -> str:
        unit = self.structure.nodes[end[0]].connectors[end[1]].unit
        return self.own_units.get(unit, unit)

    def _value(self, setting: Setting, port: Port, path: Path) -> Value:
        if isinstance(setting.value, str | bool):
            return setting.value
        try:
            gain, offset = conversion(self.own_units.get(setting.unit, setting.unit), port.unit)
        except UnitError as error:
            what = f'"{name_of((path, port.name))}" is given in {setting.unit}'
            raise self.structure.archive.error(f"{what}: {str(error).rstrip('.')}") from error
        return setting.value if (gain, offset) == (1, 0) else gain * setting.value + offset

    def _proposed(self, what: str) -> Iterator[float]:
        for one in self.descriptions.values():
            number = _positive(getattr(one.defaultExperiment, what, None))
            if number:
                yield number


def scenario_of(structure: Structure, files: Mapping[str, File]) -> str:
    """Write the scenario; `files` are the FMUs by their source in the archive, all in one folder."""
    meaning = Meaning(structure, files)
    stop, step, assumed = meaning.experiment()
    parameters = {path: meaning.parameters(path) for path in structure.components}
    strange = [name for _, names in parameters.values() for name in names]
    described = structure.nodes[()].element.get("description", "").rstrip(".")
    said = [f"{described}." if described else "", assumed]
    said += [f"Not set, because their FMUs do not have them: {', '.join(strange)}."] if strange else []
    head = {"name": structure.root.get("name") or "system", "description": " ".join(filter(None, said))}
    lines = _table("", head | {"step": step, "stop": stop})
    for path, node in structure.components.items():
        name = _text(meaning.names[path])
        interface = _INTERFACES.get(node.element.get("implementation", ""), {})
        lines += _table(f"[components.{name}]", {"fmu": files[node.source].name} | interface)
        lines += _table(f"[components.{name}.parameters]", parameters[path][0])
        for variable, stated in meaning.units(path).items():
            lines += _table(f"[components.{name}.variables.{_text(variable)}]", {"name": variable, "unit": stated})
    for link in structure.wires():
        lines += _table("[[connections]]", meaning.wire(link))
    return "\n".join(lines + _table("[record.signals]", meaning.records())) + "\n"


def _annotated_step(experiment: Element | None) -> str | None:
    """SSP 1.0 itself has no step of a run; the Open Simulation Platform's annotation does."""
    found = [] if experiment is None else list(children(experiment, "ssd:Annotations", "ssc:Annotation"))
    steps = (one.find(f"{_OSP}Algorithm/{_OSP}FixedStepAlgorithm") for one in found)
    return next((one.get("baseStepSize") for one in steps if one is not None), None)


def _differ(one: str, other: str) -> bool:
    """Say whether two units are known and mean different things."""
    with suppress(UnitError):
        return bool(one and other) and unit(one) != unit(other)
    return False


def _positive(text: Any) -> float:
    """Read a number that must be positive and finite to count; 0 where it does not."""
    try:
        number = float(text)
    except (TypeError, ValueError):
        return 0.0
    return number if 0 < number < np.inf else 0.0


def _table(head: str, values: Mapping[str, Value]) -> list[str]:
    rows = [f"{_text(key)} = {_text(value)}" for key, value in values.items()]
    return ["", head, *rows] if head else rows


def _text(value: Value) -> str:
    """Write a value as TOML, which reads JSON's strings and Python's floats (DEL must be escaped)."""
    if isinstance(value, float):
        return repr(value)
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
