"""Parameter bindings: which values an SSP gives to the parameters of a component."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from xml.etree.ElementTree import Element

from cosim.ssp.archive import Archive, child, children
from cosim.ssp.structure import Path, Structure

Value = float | int | bool | str


@dataclass(frozen=True)
class Setting:
    """A value and its unit; the unit is empty where it is that of the parameter."""

    value: Value
    unit: str = ""


def settings_of(structure: Structure, path: Path) -> dict[str, Setting]:
    """Collect what the bindings of a component and of the systems around it say of its parameters, by name.

    Outer systems win over inner ones, a later binding over an earlier one. What a set says of others is left out.
    """
    found: dict[str, Setting] = {}
    for depth in range(len(path), -1, -1):
        below = "".join(f"{name}." for name in path[depth:])
        for binding in children(structure.nodes[path[:depth]].element, "ssd:ParameterBindings", "ssd:ParameterBinding"):
            values = _binding(structure.archive, binding)
            found |= {name.removeprefix(below): one for name, one in values if name.startswith(below)}
    return found


def _binding(archive: Archive, binding: Element) -> Iterator[tuple[str, Setting]]:
    values = _content(archive, binding, "ssd:ParameterValues", "ssv:ParameterSet")
    mapping = child(binding, "ssd:ParameterMapping")
    entries = [] if mapping is None else list(children(_mapping(archive, mapping), "ssm:MappingEntry"))
    prefix = binding.get("prefix", "")
    for parameter in children(values, "ssv:Parameters", "ssv:Parameter"):
        name, setting = prefix + parameter.get("name", ""), _setting(archive, parameter)
        targets = [entry for entry in entries if entry.get("source") == name]
        yield from ((entry.get("target", ""), _mapped(archive, entry, setting)) for entry in targets)
        if not targets:
            yield name, setting


def _content(archive: Archive, holder: Element, inline: str, tag: str) -> Element:
    """Return what a binding holds, in its file or inline."""
    _check_base(archive, holder)
    if holder.get("source"):
        return archive.xml(holder.get("source", ""), tag)
    found = child(holder, inline, tag)
    if found is None:
        raise archive.error(f"a parameter binding has neither a source nor a {tag} of its own")
    return found


def _mapping(archive: Archive, mapping: Element) -> Element:
    _check_base(archive, mapping)
    if mapping.get("source"):
        return archive.xml(mapping.get("source", ""), "ssm:ParameterMapping")
    found = child(mapping, "ssm:ParameterMapping")
    return mapping if found is None else found


def _check_base(archive: Archive, holder: Element) -> None:
    if holder.get("sourceBase", "SSD") != "SSD":
        raise archive.error(f'"{holder.get("source")}" lies inside a component, and only the SSP\'s own files are read')


def _setting(archive: Archive, parameter: Element) -> Setting:
    name = parameter.get("name", "")
    for kind, read in (("Real", float), ("Integer", int), ("Boolean", _boolean), ("String", str)):
        one = child(parameter, f"ssv:{kind}")
        if one is not None:
            try:
                return Setting(read(one.get("value", "")), one.get("unit", ""))
            except ValueError as error:
                raise archive.error(f'the parameter "{name}" = "{one.get("value")}" is no {kind}') from error
    raise archive.error(f'the parameter "{name}" is of a kind that is not read', "Real", "Integer", "Boolean", "String")


def _boolean(text: str) -> bool:
    if text not in ("true", "false", "1", "0"):
        raise ValueError(text)
    return text in ("true", "1")


def _mapped(archive: Archive, entry: Element, setting: Setting) -> Setting:
    """Apply the transformation of an SSM entry; with `suppressUnitConversion` the number is that of the target."""
    linear = child(entry, "ssc:LinearTransformation")
    unit = "" if entry.get("suppressUnitConversion", "false") in ("true", "1") else setting.unit
    if linear is None:
        return replace(setting, unit=unit)
    if isinstance(setting.value, str | bool):
        raise archive.error(f'the mapping of "{entry.get("source")}" scales what is no number')
    factor, offset = archive.number(linear, "factor", 1.0), archive.number(linear, "offset")
    return Setting(setting.value * factor + offset, unit)
