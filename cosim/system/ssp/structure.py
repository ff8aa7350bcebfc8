"""SystemStructure.ssd: elements and connections, with nested systems, archives and signal dictionaries made flat."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

from cosim.system.ssp.archive import Archive, child, children
from cosim.system.ssp.ssp_file import SspFile
from cosim.system.ssp.transformation import Transformation

Path = tuple[str, ...]
"""Names from the outermost system's elements inwards; the outermost system itself is ()."""
End = tuple[Path, str]
"""A connector of an element."""
GIVES = ("output", "calculatedParameter", "local", "constant")
"""Kinds of connectors out of which values come, seen from outside their element (SSP 2.0, Allowed Connections)."""
TAKES = ("input", "parameter", "structuralParameter", "inout")
_TYPES = {"Real": "Float64", "Integer": "Int32"}
_KINDS = (
    *("Real", "Float64", "Float32", "Integer", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64"),
    *("UInt64", "Boolean", "String", "Enumeration", "Binary", "Clock"),
)


@dataclass(frozen=True)
class Connector:
    """Kind, unit and FMI type of a connector; unit and type are empty where none is given."""

    kind: str
    unit: str = ""
    type: str = ""


@dataclass(frozen=True)
class Node:
    """An element with its connectors: an FMU with its source, else a system or a signal dictionary.

    `bindings` are the elements whose parameter bindings count for it, the strongest last.
    """

    element: Element
    file: SspFile
    connectors: Mapping[str, Connector]
    source: str = ""
    bindings: tuple[tuple[Element, SspFile], ...] = ()


@dataclass(frozen=True)
class Link:
    """A connection in the direction of its data, with indices of arrays where it names some."""

    start: End
    end: End
    transformation: Transformation = field(default_factory=Transformation)
    indices: tuple[str, str] = ("", "")


@dataclass(frozen=True)
class Structure:
    """All elements by their path, and the links by the end (and index) they feed."""

    file: SspFile
    nodes: dict[Path, Node] = field(default_factory=dict)
    links: dict[End, dict[str, Link]] = field(default_factory=dict)
    dictionaries: dict[Path, tuple[Path, Mapping[str, Connector]]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    @property
    def archive(self) -> Archive:
        """The archive that was opened."""
        return self.file.archive

    @property
    def components(self) -> dict[Path, Node]:
        """The FMUs."""
        return {path: node for path, node in self.nodes.items() if node.source}

    def ends(self, kinds: tuple[str, ...], paths: list[Path]) -> Iterator[End]:
        """Yield the connectors of these kinds of these elements."""
        for path in paths:
            yield from ((path, name) for name, one in self.nodes[path].connectors.items() if one.kind in kinds)

    def chains(self, end: End) -> list[tuple[Link, ...]]:
        """Follow what feeds an end back to where it comes from; a chain for each index that is fed apart."""
        return [self._chain(link, (end,)) for link in self.links.get(end, {}).values()]

    def _chain(self, link: Link, seen: tuple[End, ...]) -> tuple[Link, ...]:
        if link.start in seen:
            raise self.archive.error(f'"{name_of(seen[0])}" is fed by a circle of connections')
        before = self.links.get(link.start, {})
        if len(before) > 1 or any(index for index in before):
            what = f'"{name_of(link.start)}" passes on an array that is fed by its elements'
            raise self.archive.error(f"{what}; wire the elements without that connector between")
        return (*(chain for one in before.values() for chain in self._chain(one, (*seen, link.start))), link)


def name_of(end: End) -> str:
    """Name a connector for a person."""
    return ".".join((*end[0], end[1]))


def connectors_of(file: SspFile, element: Element, *path: str) -> dict[str, Connector]:
    """Read the connectors of an element (or, with another path, the entries of a signal dictionary)."""
    found = {}
    for one in children(element, *(path or ("ssd:Connectors", "ssd:Connector"))):
        typed = next((kind for kind in _KINDS if child(one, f"ssc:{kind}") is not None), "")
        unit = "" if not typed else child_of(one, typed).get("unit", "")
        found[one.get("name", "")] = Connector(
            one.get("kind", ""), file.units.get(unit, unit), _TYPES.get(typed, typed)
        )
    return found


def child_of(element: Element, kind: str) -> Element:
    """Return the element that tells the type."""
    found = child(element, f"ssc:{kind}")
    assert found is not None  # the caller found it before
    return found
