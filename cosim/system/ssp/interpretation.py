"""What an SSP means, written as a scenario file."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from math import floor
from pathlib import Path as File
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from cosim.fmi.component import Port
from cosim.fmi.description import check_binary, describe
from cosim.fmi.settings import STRUCTURAL
from cosim.fmi.variables import ports_of
from cosim.support.errors import FmuError, UnitError
from cosim.support.numbers import COUNT
from cosim.support.units import unit
from cosim.system.ssp.archive import child, children
from cosim.system.ssp.parameters import Bound, Setting, Values, bound_by, given, settings_of
from cosim.system.ssp.structure import End, Link, Path, Structure, name_of
from cosim.system.ssp.transformation import Effect

STOP, STEPS = 1.0, 1000
"""Length of a run [s], and steps in it, where neither the SSP nor an FMU says any."""
_OSP = "{http://opensimulationplatform.com/SSP/OSPAnnotations}"
_OMS = "{https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd}"


@dataclass(frozen=True)
class Interpretation:
    """A structure with the files of its FMUs by their element."""

    structure: Structure
    files: Mapping[Path, File]

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
        return {path: self._ports(path, one) for path, one in self.descriptions.items()}

    @cached_property
    def bound(self) -> Bound:
        """What parameter bindings say."""
        return bound_by(self.structure)

    @cached_property
    def outside(self) -> dict[End, Setting]:
        """What connectors of systems are given."""
        systems = [path for path, node in self.structure.nodes.items() if not node.source]
        found = {path: settings_of(self.bound, path) for path in systems}
        return {
            (path, name): one
            for path, settings in found.items()
            for name, one in settings.items()
            if name in self.structure.nodes[path].connectors
        }

    def name(self, end: End) -> str:
        """Name the variable of a component as a scenario does."""
        return f"{self.names[end[0]]}.{end[1]}"

    def experiment(self) -> tuple[float, float, float, str]:
        """Return start, stop and step [s], and a sentence where they are assumed."""
        file = self.structure.file
        experiment = child(file.root, "ssd:DefaultExperiment")
        start = 0.0 if experiment is None else file.number(experiment, "startTime")
        if start < 0:
            raise file.error(f"it starts at {start:g} s; a run starts at 0 s or later")
        stop = _positive(None if experiment is None else experiment.get("stopTime"))
        step = _positive(_annotated_step(experiment, self.structure.nodes[()].element))
        step = step or min(self._proposed("stepSize"), default=0.0)
        assumed = " and ".join(word for word, number in (("stop", stop), ("step", step)) if not number)
        said = f"It says no {assumed}, which is assumed." if assumed else ""
        stop = stop or start + max(self._proposed("stopTime"), default=STOP)
        if stop <= start:
            raise file.error(f"it starts at {start:g} s and stops at {stop:g} s; it must stop later than it starts")
        whole, step = _whole(stop - start, step or (stop - start) / STEPS)
        end = stop if whole == stop - start else start + whole
        cut = "" if end == stop else f"Its stop of {stop:g} s is no whole number of steps; the run ends at {end:g} s."
        return start, end, step, " ".join(filter(None, (said, cut)))

    def parameters(self, path: Path) -> dict[str, Values]:
        """Return the values for the variables of a component in its units."""
        ports, file = self.ports[path], self.structure.nodes[path].file
        known = {name: one for name, one in self._settings(path).items() if name in ports}
        return {name: one.arriving(file, name_of((path, name)), ports[name].unit) for name, one in known.items()}

    def unknown(self) -> tuple[list[str], list[str]]:
        """Return full names to which values are bound: those that their FMU lacks, and those of no element at all."""
        settings = {path: self._settings(path) for path in self.structure.components}
        lacking = [(path, name) for path, given in settings.items() for name in given if name not in self.ports[path]]
        nowhere = [
            (holder, name)
            for holder, said in self.bound.items()
            for name in dict.fromkeys(name for name, _ in said)
            if not any(self._takes(end) for end in self._meant(holder, name))
        ]
        return [name_of(end) for end in lacking], [name_of(end) for end in nowhere]

    def _takes(self, end: End) -> bool:
        """Say whether an element is an FMU, which answers for its own names, or has a connector of this name."""
        return end[0] in self.ports or end[1] in self.structure.nodes[end[0]].connectors

    def _meant(self, holder: Path, name: str) -> Iterator[End]:
        """Yield what a name can mean, as seen from an element: a variable of it or of one inside it."""
        parts = name.split(".")
        for depth in range(len(parts)):
            for path in self._dotted.get(".".join((*holder, *parts[:depth])), ()):
                if path[: len(holder)] == holder:
                    yield path, ".".join(parts[depth:])

    @cached_property
    def _dotted(self) -> dict[str, list[Path]]:
        """The elements by their names with dots between."""
        found: dict[str, list[Path]] = {}
        for path in self.structure.nodes:
            found.setdefault(".".join(path), []).append(path)
        return found

    def wires(self) -> Iterator[dict[str, Any]]:
        """Write the chains of links that lead from FMU to FMU as connections."""
        for end in [
            (path, name) for path in self.structure.components for name in self.structure.nodes[path].connectors
        ]:
            for chain in self.structure.chains(end):
                if chain[0].start[0] in self.structure.components:
                    yield self._wire(chain)

    def units(self, path: Path) -> dict[str, str]:
        """Units of connectors whose FMU states none."""
        found = {}
        for name, connector in self.structure.nodes[path].connectors.items():
            port, said = self.ports[path].get(name), connector.unit
            stated = port.unit if port else ""
            if port and said and not stated:
                found[name] = said
            elif _differ(said, stated):
                what = f'"{name_of((path, name))}" is in {said}'
                raise self.structure.archive.error(f"{what}, but its FMU says {stated}")
        return found

    def records(self) -> dict[str, str]:
        """Columns: all outputs with a connector, and those of the whole system under their own names."""
        paths = list(self.structure.components)
        ends = [end for end in self.structure.ends(("output",), paths) if self._is_recorded(end)]
        columns = {self.name(end): self.name(end) for end in ends}
        for end in self.structure.ends(("output",), [()]):
            for chain in self.structure.chains(end):
                effect = self._effect(chain)
                plain = (effect.gain, effect.offset, effect.table) == (1, 0, {})
                plain = plain and not any(index for link in chain for index in link.indices)
                if plain and chain[0].start[0] in self.structure.components and end[1] != "t":
                    columns[end[1]] = self.name(chain[0].start)
        if not columns:
            raise self.structure.archive.error("no output has a connector, so there is nothing to record")
        return columns

    def _wire(self, chain: tuple[Link, ...]) -> dict[str, Any]:
        """Write a chain as one connection; what arrives is in the unit of the target."""
        start, end = chain[0].start, chain[-1].end
        effect, indices = self._effect(chain), self._indices(chain)
        wire: dict[str, Any] = {"from": self.name(start) + indices[0], "to": self.name(end) + indices[1]}
        wire |= {"map": effect.table} if effect.table else {}
        wire |= {"gain": effect.gain} if effect.gain != 1 else {}
        wire |= {"offset": effect.offset} if effect.offset != 0 else {}
        target = self._unit(end)
        return wire | ({"unit": target} if target and target != self._unit(start) else {})

    def _indices(self, chain: tuple[Link, ...]) -> tuple[str, str]:
        """Return the indices of array elements at both ends of a chain, as `[2,1]`; SSP's count from 1, as FMI's do."""
        starts = [link.indices[0] for link in chain if link.indices[0]]
        if len(starts) > 1:
            what = f'"{name_of(chain[-1].end)}" is fed by an element of an element'
            raise self.structure.archive.error(f"{what} of an array, and only one index is read")
        both = ("".join(starts), chain[-1].indices[1])
        return tuple(f"[{','.join(one.split())}]" if one else "" for one in both)  # type: ignore[return-value]

    def _effect(self, chain: tuple[Link, ...]) -> Effect:
        effect = Effect(unit=self._unit(chain[0].start))
        for link in chain:
            try:
                effect = effect.then(link.transformation, self._unit(link.end))
            except UnitError as error:
                what = f'"{name_of(link.end)}" is fed by "{name_of(chain[0].start)}"'
                raise self.structure.archive.error(f"{what}: {str(error).rstrip('.')}") from error
        return effect

    def _description(self, path: Path, source: str) -> Any:
        try:
            found = describe(self.files[path])
            own = found.coSimulation or found.modelExchange or found.scheduledExecution
            check_binary(self.files[path], found, own.modelIdentifier)
            return found
        except FmuError as error:
            raise self.structure.archive.error(f'"{".".join(path)}" ({source}): {str(error).rstrip(".")}') from error

    def _is_recorded(self, end: End) -> bool:
        port = self.ports[end[0]].get(end[1])
        return port is None or port.type != "Clock"

    def _ports(self, path: Path, description: Any) -> dict[str, Port]:
        """List the variables of an FMU, with arrays of the size that its structural parameters are given."""
        ports, settings = ports_of(description), self._settings(path)
        sizes = {
            name: one.value
            for name, one in settings.items()
            if name in ports and ports[name].causality == STRUCTURAL and isinstance(one.value, int)
        }
        return ports_of(description, sizes) if sizes else ports

    def _settings(self, path: Path) -> dict[str, Setting]:
        """Collect what a component is given by its bindings and by connectors of systems that are wired to it."""
        settings = settings_of(self.bound, path)
        for name in self.structure.nodes[path].connectors:
            for chain in self.structure.chains((path, name)):
                brought = given(self.structure, chain, self.outside)
                if brought is not None and chain[0].start[0] not in self.structure.components:
                    settings[name] = brought
        return settings

    def _unit(self, end: End) -> str:
        port = self.ports.get(end[0], {}).get(end[1])
        return (port.unit if port else "") or self.structure.nodes[end[0]].connectors[end[1]].unit

    def _proposed(self, what: str) -> Iterator[float]:
        for one in self.descriptions.values():
            number = _positive(getattr(one.defaultExperiment, what, None))
            if number:
                yield number


def _annotated_step(experiment: Element | None, system: Element) -> str | None:
    """SSP itself has no step of a run; annotations of the Open Simulation Platform and of OMSimulator do."""
    found = [] if experiment is None else list(children(experiment, "ssd:Annotations", "ssc:Annotation"))
    steps = [one.find(f"{_OSP}Algorithm/{_OSP}FixedStepAlgorithm") for one in found]
    master = [one.find(f".//{_OMS}FixedStepMaster") for one in children(system, "ssd:Annotations", "ssc:Annotation")]
    said = [one.get("baseStepSize") for one in steps if one is not None]
    return next(iter(said + [one.get("stepSize") for one in master if one is not None]), None)


def _whole(stop: float, step: float) -> tuple[float, float]:
    """Return a stop that is a whole number of steps, and the step, which is no longer than the run."""
    if step >= stop:
        return stop, stop
    steps = stop / step
    if steps > COUNT:
        return stop, step  # which the scenario refuses
    return (stop if abs(steps - round(steps)) <= 1e-6 * steps else floor(steps) * step), step


def _differ(one: str, other: str) -> bool:
    """Say whether two units are known and mean different things."""
    with suppress(UnitError):
        return bool(one and other) and one != other and unit(one) != unit(other)
    return False


def _positive(text: Any) -> float:
    """Read a number that must be positive and finite to count; 0 where it does not."""
    try:
        number = float(text)
    except (TypeError, ValueError):
        return 0.0
    return number if 0 < number < np.inf else 0.0
