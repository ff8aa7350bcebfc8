"""Parameter bindings: which values an SSP gives to the variables of a component.

Outer systems win over inner ones, a later binding over an earlier one. A binding with a mapping applies only what the
mapping names. What is given to a connector of a system goes along its connections, and wins over what is given to
the variable that it feeds.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

from cosim.support.errors import UnitError
from cosim.system.ssp.archive import child, children
from cosim.system.ssp.ssp_file import SspFile, units_of
from cosim.system.ssp.structure import End, Link, Path, Structure, name_of
from cosim.system.ssp.transformation import Effect, Transformation, Value, transformation_of

Values = Value | list[Value]
_INTEGERS = ("Integer", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64")
_READERS: tuple[tuple[str, Callable[[str], Value]], ...] = (
    *((kind, float) for kind in ("Real", "Float64", "Float32")),
    *((kind, int) for kind in _INTEGERS),
    *((kind, str) for kind in ("String", "Enumeration", "Binary")),
)


@dataclass(frozen=True)
class Setting:
    """A value and its unit; the unit is empty where it is that of the variable. `transformation` acts on the way."""

    value: Values
    unit: str = ""
    transformation: Transformation = field(default_factory=Transformation)

    def arriving(self, file: SspFile, name: str, unit: str) -> Values:
        """Return the value in the unit of the variable called `name`."""
        try:
            effect = Effect(unit=self.unit).then(self.transformation, unit)
        except UnitError as error:
            raise file.error(f'"{name}" is given in {self.unit}: {str(error).rstrip(".")}') from error
        if isinstance(self.value, list):
            return [effect.apply(one) for one in self.value]
        return effect.apply(self.value)


Bound = Mapping[Path, list[tuple[str, Setting]]]
"""What the bindings of each element say, by its path: names as they are seen from there, the strongest last."""


def bound_by(structure: Structure) -> Bound:
    """Read all parameter bindings."""
    return {
        path: [
            said
            for holder, file in node.bindings
            for binding in children(holder, "ssd:ParameterBindings", "ssd:ParameterBinding")
            for said in _binding(structure, file, binding)
        ]
        for path, node in structure.nodes.items()
    }


def settings_of(bound: Bound, path: Path) -> dict[str, Setting]:
    """Collect what the bindings of an element and of the systems around it say of its variables, by name."""
    found: dict[str, Setting] = {}
    for depth in range(len(path), -1, -1):
        below = "".join(f"{name}." for name in path[depth:])
        said = bound.get(path[:depth], [])
        found |= {name.removeprefix(below): one for name, one in said if name.startswith(below)}
    return found


def given(structure: Structure, chain: tuple[Link, ...], own: Mapping[End, Setting]) -> Setting | None:
    """Return what a chain of links brings from the first connector of a system on it that is given a value."""
    for number, link in enumerate(chain):
        setting = own.get(link.start)
        if setting is not None:
            return _carried(structure, setting, chain[number:])
    return None


def _carried(structure: Structure, setting: Setting, chain: tuple[Link, ...]) -> Setting:
    """Take a value along links; its last transformation is left to be done in the unit of the variable itself."""
    file = structure.file
    connector = structure.nodes[chain[0].start[0]].connectors[chain[0].start[1]]
    value, unit = setting.arriving(file, name_of(chain[0].start), connector.unit), connector.unit or setting.unit
    for link in chain[:-1]:
        stated = structure.nodes[link.end[0]].connectors[link.end[1]].unit
        value = Setting(value, unit, link.transformation).arriving(file, name_of(link.end), stated)
        unit = stated or unit
    return Setting(value, unit, chain[-1].transformation)


def _binding(structure: Structure, file: SspFile, binding: Element) -> Iterator[tuple[str, Setting]]:
    values = _content(file, binding, "ssd:ParameterValues", "ssv:ParameterSet")
    prefix, units = binding.get("prefix", ""), file.units | units_of(file.archive, values, "ssv:Units")
    parameters = children(values, "ssv:Parameters", "ssv:Parameter")
    named = {prefix + one.get("name", ""): _setting(file, one, units) for one in parameters}
    mapping = child(binding, "ssd:ParameterMapping")
    if mapping is None:
        yield from named.items()
        return
    targets: dict[str, str] = {}
    for entry in children(_mapping(file, mapping), "ssm:MappingEntry"):
        source, target = entry.get("source", ""), entry.get("target", "")
        if target in targets:
            raise file.error(f'a parameter mapping has two sources of "{target}", "{targets[target]}" and "{source}"')
        targets[target] = source
        if source in named:
            one = named[source]
            yield target, Setting(one.value, one.unit, transformation_of(file, entry, target))
        else:
            have = ", ".join(named) or "nothing"
            structure.notes.append(f'"{target}" is not set: its mapping names "{source}", and the set holds {have}.')


def _content(file: SspFile, holder: Element, inline: str, tag: str) -> Element:
    """Return what a binding holds, in its file or inline."""
    _check_base(file, holder)
    if holder.get("source"):
        return file.xml(holder.get("source", ""), tag)
    found = child(holder, inline, tag)
    if found is None:
        raise file.error(f"a parameter binding has neither a source nor a {tag} of its own")
    return found


def _mapping(file: SspFile, mapping: Element) -> Element:
    _check_base(file, mapping)
    if mapping.get("source"):
        return file.xml(mapping.get("source", ""), "ssm:ParameterMapping")
    found = child(mapping, "ssm:ParameterMapping")
    return mapping if found is None else found


def _check_base(file: SspFile, holder: Element) -> None:
    if holder.get("sourceBase", "SSD") != "SSD":
        raise file.error(f'"{holder.get("source")}" lies inside a component, and only the SSP\'s own files are read')


def _setting(file: SspFile, parameter: Element, units: Mapping[str, str]) -> Setting:
    name = parameter.get("name", "")
    for kind, read in (("Boolean", _boolean), *_READERS):
        one = child(parameter, f"ssv:{kind}")
        if one is not None:
            unit = one.get("unit", "")
            return Setting(_read(file, parameter, one, name, kind, read), units.get(unit, unit))
    choices = ("Boolean", *(kind for kind, _ in _READERS))
    raise file.error(f'the parameter "{name}" is of a kind that is not read', *choices)


def _read(
    file: SspFile, parameter: Element, one: Element, name: str, kind: str, read: Callable[[str], Value]
) -> Values:
    """Read a value, or the list of an array in row-major order."""
    several = [text.get("value", "") for text in children(one, "ssv:Value")]
    array = child(parameter, "ssc:Dimension") is not None or len(several) > 1
    texts = several or ([one.get("value", "")] if read is str or not array else one.get("value", "").split())
    try:
        values = [read(text) for text in texts]
    except ValueError as error:
        raise file.error(f'the parameter "{name}" = "{one.get("value")}" is no {kind}') from error
    return values if array else values[0]


def _boolean(text: str) -> bool:
    if text not in ("true", "false", "1", "0"):
        raise ValueError(text)
    return text in ("true", "1")
