"""SystemStructure.ssd: elements and connections, with nested systems made flat."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

from cosim.ssp.archive import Archive, child, children, tagged

Path = tuple[str, ...]
"""Names from the outermost system's elements inwards; the outermost system itself is ()."""
End = tuple[Path, str]
"""A connector of an element."""
FMU, SYSTEM = "application/x-fmu-sharedlibrary", tagged("ssd:System")


@dataclass(frozen=True)
class Connector:
    """Kind and unit of a connector; the unit is empty where none is given."""

    kind: str
    unit: str


@dataclass(frozen=True)
class Node:
    """An element: an FMU with its source, or a system, which has none."""

    element: Element
    source: str
    connectors: Mapping[str, Connector]


@dataclass(frozen=True)
class Link:
    """end = factor start + offset; with `keep` no unit is converted."""

    start: End
    end: End
    factor: float = 1.0
    offset: float = 0.0
    keep: bool = False

    def after(self, other: "Link") -> "Link":
        """Chain another link before this one."""
        factor, offset = self.factor * other.factor, self.factor * other.offset + self.offset
        return Link(other.start, self.end, factor, offset, self.keep or other.keep)


@dataclass(frozen=True)
class Structure:
    """All elements by their path, and the links by the end they feed."""

    archive: Archive
    root: Element
    nodes: dict[Path, Node] = field(default_factory=dict)
    links: dict[End, Link] = field(default_factory=dict)

    @property
    def components(self) -> dict[Path, Node]:
        """The FMUs."""
        return {path: node for path, node in self.nodes.items() if node.source}

    def ends(self, kind: str, paths: list[Path]) -> Iterator[End]:
        """Yield the connectors of one kind of these elements."""
        for path in paths:
            yield from ((path, name) for name, one in self.nodes[path].connectors.items() if one.kind == kind)

    def wires(self) -> Iterator[Link]:
        """Yield the links from FMU to FMU."""
        for end in self.ends("input", list(self.components)):
            found = self.traced(end)
            if found is not None:
                yield found

    def traced(self, end: End) -> Link | None:
        """Follow what feeds an end back to the FMU it comes from; None where nothing inside feeds it."""
        link = Link(end, end)
        for _ in range(len(self.links) + 1):
            if link.start in self.links:
                link = link.after(self.links[link.start])
            else:
                return link if link.start != end and link.start[0] in self.components else None
        raise self.archive.error(f'"{name_of(end)}" is fed by a circle of connections')


def read_structure(archive: Archive) -> Structure:
    """Read the structure of an SSP.

    Raises:
        ScenarioError: it breaks a rule of SSP 1.0, or has what is not read here.
    """
    root = archive.xml("SystemStructure.ssd", "ssd:SystemStructureDescription")
    if not root.get("version", "").startswith("1."):
        raise archive.error(f'its version is "{root.get("version")}", and only SSP 1 is read')
    system = child(root, "ssd:System")
    if system is None:
        raise archive.error("SystemStructure.ssd has no ssd:System")
    structure = Structure(archive, root)
    _add_system(structure, system, ())
    if not structure.components:
        raise archive.error("it has no component")
    return structure


def name_of(end: End) -> str:
    """Name a connector for a person."""
    return ".".join((*end[0], end[1]))


def _add_system(structure: Structure, system: Element, path: Path) -> None:
    structure.nodes[path] = Node(system, "", _connectors(system))
    for element in (one for group in children(system, "ssd:Elements") for one in group):
        inner = (*path, element.get("name", ""))
        if inner in structure.nodes:
            raise structure.archive.error(f'two elements are called "{".".join(inner)}"')
        if element.tag == SYSTEM:
            _add_system(structure, element, inner)
        else:
            structure.nodes[inner] = _component(structure.archive, element, ".".join(inner))
    for connection in children(system, "ssd:Connections", "ssd:Connection"):
        _add_link(structure, connection, path)


def _component(archive: Archive, element: Element, name: str) -> Node:
    kind = element.get("type") or FMU
    if element.tag != tagged("ssd:Component") or kind != FMU:
        what = kind if element.tag == tagged("ssd:Component") else element.tag.partition("}")[2]
        raise archive.error(f'"{name}" is of the kind {what}, and only FMUs and systems of them are read')
    if not element.get("source"):
        raise archive.error(f'the component "{name}" has no source')
    return Node(element, element.get("source", ""), _connectors(element))


def _connectors(element: Element) -> dict[str, Connector]:
    found = {}
    for one in children(element, "ssd:Connectors", "ssd:Connector"):
        real = child(one, "ssc:Real")
        unit = "" if real is None else real.get("unit", "")
        found[one.get("name", "")] = Connector(one.get("kind", ""), unit)
    return found


def _add_link(structure: Structure, connection: Element, path: Path) -> None:
    ends = [_end(structure, connection, side, path) for side in ("start", "end")]
    transformed = child(connection, "ssc:LinearTransformation")
    _refuse_maps(structure, connection, ends[1])
    gives = [_gives(structure, end, path) for end in ends]
    if gives == [False, True] and transformed is None:
        ends.reverse()  # SSP names ends, and some tools name the consumer first
    elif gives != [True, False]:
        says = f'"{name_of(ends[0])}" is joined to "{name_of(ends[1])}"'
        raise structure.archive.error(f"{says}, and a connection goes from an output to an input")
    start, end = ends
    if end in structure.links:
        other = name_of(structure.links[end].start)
        raise structure.archive.error(f'"{name_of(end)}" is fed twice, by "{other}" and by "{name_of(start)}"')
    keep = connection.get("suppressUnitConversion", "false") in ("true", "1")
    number = structure.archive.number
    shift = (1.0, 0.0) if transformed is None else (number(transformed, "factor", 1.0), number(transformed, "offset"))
    structure.links[end] = Link(start, end, *shift, keep)


def _end(structure: Structure, connection: Element, side: str, path: Path) -> End:
    element, connector = connection.get(f"{side}Element"), connection.get(f"{side}Connector", "")
    owner = path if element is None else (*path, element)
    if owner not in structure.nodes:
        here = [".".join(one) for one in structure.nodes if one[:-1] == path and one]
        raise structure.archive.error(f'a connection names "{".".join(owner)}", which does not exist', *here)
    connectors = structure.nodes[owner].connectors
    if connector not in connectors:
        raise structure.archive.error(f'"{name_of((owner, connector))}" is no connector', *connectors)
    return owner, connector


def _gives(structure: Structure, end: End, path: Path) -> bool:
    """Say whether values come out of a connector, seen from inside the system at `path`."""
    kind = structure.nodes[end[0]].connectors[end[1]].kind
    if kind not in ("input", "output"):
        rule = f'only inputs and outputs can be connected; it is "{kind}"'
        raise structure.archive.error(f'"{name_of(end)}" is connected, and {rule}')
    return (kind == "output") != (end[0] == path)


def _refuse_maps(structure: Structure, connection: Element, end: End) -> None:
    for kind in ("Boolean", "Integer", "Enumeration"):
        if child(connection, f"ssc:{kind}MappingTransformation") is not None:
            rule = "only linear ones are read"
            raise structure.archive.error(f'"{name_of(end)}" is fed through a {kind} mapping, and {rule}')
