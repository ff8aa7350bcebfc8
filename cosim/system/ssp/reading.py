"""From the XML of an SSD to its structure: systems, components, signal dictionaries, connections."""

import posixpath
from xml.etree.ElementTree import Element

from cosim.support.errors import ScenarioError
from cosim.system.ssp.archive import MAIN, Archive, child, children, tagged
from cosim.system.ssp.ssp_file import SspFile
from cosim.system.ssp.structure import (
    GIVES,
    TAKES,
    Connector,
    End,
    Link,
    Node,
    Path,
    Structure,
    connectors_of,
    name_of,
)
from cosim.system.ssp.transformation import transformation_of

SSD, SSP, FMU = "application/x-ssp-definition", "application/x-ssp-package", "application/x-fmu-sharedlibrary"
DEEPEST = 50
"""Systems within each other at most: more is a mistake or an attack."""
MOST = 10_000
"""Elements at most: systems that use each other twice at each level have a million after twenty."""
_SYSTEM, _COMPONENT = tagged("ssd:System"), tagged("ssd:Component")
_REFERENCE = tagged("ssd:SignalDictionaryReference")


def read_structure(archive: Archive, variant: str = "") -> Structure:
    """Read the structure of an SSP.

    Args:
        archive: of the SSP.
        variant: the file or the name of another SSD at its root; its SystemStructure.ssd where not given.

    Raises:
        ScenarioError: it breaks a rule of SSP, or has what is not read here.
    """
    file = _opened(archive, _variant(archive, variant) if variant else archive.main)
    structure = Structure(file)
    structure.notes.extend([] if variant else _others(archive))
    _add_system(structure, _system(file), file, ())
    if not structure.components:
        raise archive.error("it has no component that is an FMU" if len(structure.nodes) > 1 else "it has no component")
    return structure


def _variant(archive: Archive, variant: str) -> str:
    """Return the file of the SSD that has this name, or is this file."""
    files = archive.roots()
    found = [one for one in files if one == variant] or [one for one in files if _name(archive, one) == variant]
    if len(found) != 1:
        what = f'"{variant}" is the name of {len(found)} of its SSDs' if found else f'it has no SSD "{variant}"'
        raise archive.error(what, *files)
    return found[0]


def _others(archive: Archive) -> list[str]:
    """Say which other SSDs there are, and how each is chosen."""
    others = [one for one in archive.roots() if one != archive.main]
    chosen = ", ".join(f"{archive.path.name}#{one} ({_name(archive, one)})" for one in others)
    return (
        [f"It holds more than one system, of which {archive.main} is run; the others are: {chosen}."] if others else []
    )


def _name(archive: Archive, source: str) -> str:
    try:
        return archive.xml(source, "ssd:SystemStructureDescription").get("name") or "without a name"
    except ScenarioError:  # it is not the one that is run
        return "unreadable"


def _opened(archive: Archive, source: str) -> SspFile:
    root = archive.xml(source, "ssd:SystemStructureDescription")
    if root.get("version", "").partition(".")[0] not in ("1", "2"):
        raise archive.error(f'{source} is of version "{root.get("version")}", and only SSP 1 and 2 are read')
    return SspFile(archive, root, posixpath.dirname(source))


def _system(file: SspFile) -> Element:
    system = child(file.root, "ssd:System")
    if system is None:
        raise file.error("its SSD has no ssd:System")
    return system


def _add_system(
    structure: Structure, system: Element, file: SspFile, path: Path, *outer: tuple[Element, SspFile]
) -> None:
    """Add a system and all in it; `outer` is the component in its place, whose bindings are stronger."""
    if len(structure.nodes) > MOST:
        raise file.error(f"it has more than {MOST:,} elements, counting those of a system as often as it is used")
    if len(path) > DEEPEST:
        raise file.error(f'"{".".join(path[:3])}..." nests systems more than {DEEPEST} deep')
    structure.nodes[path] = Node(system, file, connectors_of(file, system), bindings=((system, file), *outer))
    _add_dictionaries(structure, system, file, path)
    for element in (one for group in children(system, "ssd:Elements") for one in group):
        inner = (*path, element.get("name", ""))
        if inner in structure.nodes or inner in structure.dictionaries:
            raise file.error(f'two elements are called "{".".join(inner)}"')
        if element.tag == _SYSTEM:
            _add_system(structure, element, file, inner)
        elif element.tag == _REFERENCE:
            structure.dictionaries[inner] = _looked_up(structure, element, file, inner)
        elif element.tag == _COMPONENT:
            _add_component(structure, element, file, inner)
        else:
            kind = element.tag.partition("}")[2]
            raise file.error(f'"{".".join(inner)}" is a {kind}, and only FMUs and systems of them are read')
    for connection in children(system, "ssd:Connections", "ssd:Connection"):
        _add_link(structure, connection, file, path)


def _add_component(structure: Structure, element: Element, file: SspFile, path: Path) -> None:
    kind, source = (element.get("type") or FMU).partition(";")[0].strip(), element.get("source")
    own = (element, file)
    if source is None:
        structure.notes.append(f'The component "{".".join(path)}" has no source, so nothing comes out of it.')
        structure.nodes[path] = Node(element, file, connectors_of(file, element))
    elif source.startswith("#"):
        system = next((one for one in file.root.iter(_SYSTEM) if one.get("id") == source[1:]), None)
        if system is None:
            raise file.error(f'"{".".join(path)}" is a "{source}", and no system has that id')
        _add_system(structure, system, file, path, own)
    elif kind in (SSD, SSP):
        inner = _inner(file, kind, source)
        _add_system(structure, _system(inner), inner, path, own)
    elif kind == FMU:
        structure.nodes[path] = Node(element, file, connectors_of(file, element), source, bindings=(own,))
    else:
        raise file.error(f'"{".".join(path)}" is of the kind {kind}, and only FMUs and systems of them are read')


def _inner(file: SspFile, kind: str, source: str) -> SspFile:
    if kind == SSD:
        return _opened(file.archive, file.path(source))
    inner, _, variant = source.partition("#")
    return _opened(file.archive.nested(file.path(inner)), variant or MAIN)


def _add_dictionaries(structure: Structure, system: Element, file: SspFile, path: Path) -> None:
    """Add the signal dictionaries of a system as elements whose connectors are their entries."""
    for one in children(system, "ssd:SignalDictionaries", "ssd:SignalDictionary"):
        source, inline = one.get("source"), child(one, "ssb:SignalDictionary")
        root = file.xml(source, "ssb:SignalDictionary") if source else inline
        if root is None:
            raise file.error(f'the signal dictionary "{one.get("name")}" has neither a source nor entries')
        own = SspFile(file.archive, root, file.folder)
        entries = connectors_of(own, root, "ssb:DictionaryEntry")
        structure.nodes[(*path, f"({one.get('name')})")] = Node(root, own, entries)


def _looked_up(structure: Structure, element: Element, file: SspFile, path: Path) -> tuple[Path, dict[str, Connector]]:
    """Find the dictionary that a reference means: in its own system, then outwards."""
    name = element.get("dictionary", "")
    for depth in range(len(path) - 1, -1, -1):
        found = (*path[:depth], f"({name})")
        if found in structure.nodes:
            return found, connectors_of(file, element)
    raise file.error(f'"{".".join(path)}" refers to the signal dictionary "{name}", which does not exist')


def _add_link(structure: Structure, connection: Element, file: SspFile, path: Path) -> None:
    sides = [(_end(structure, connection, file, side, path)) for side in ("start", "end")]
    ends, gives = [end for end, _ in sides], [given for _, given in sides]
    indices = [connection.get(f"{side}Indices", "").strip() for side in ("start", "end")]
    if gives in ([False, True], [None, True], [False, None]):  # SSP names ends; data may flow from either
        ends.reverse()
        indices.reverse()
    elif gives not in ([True, False], [None, False], [True, None]):
        says = f'"{name_of(ends[0])}" is joined to "{name_of(ends[1])}"'
        raise file.error(f"{says}, and a connection goes from an output to an input")
    start, end = ends
    fed = structure.links.setdefault(end, {})
    if indices[1] in fed or (fed and not (indices[1] and all(fed))):
        other = name_of(next(iter(fed.values())).start)
        raise file.error(f'"{name_of(end)}" is fed twice, by "{other}" and by "{name_of(start)}"')
    fed[indices[1]] = Link(start, end, transformation_of(file, connection, name_of(end)), (indices[0], indices[1]))


def _end(structure: Structure, connection: Element, file: SspFile, side: str, path: Path) -> tuple[End, bool | None]:
    """Return a connector, and whether values come out of it, seen from inside the system at `path`; None: either."""
    element, connector = connection.get(f"{side}Element"), connection.get(f"{side}Connector", "")
    owner = (*path, element) if element else path
    if owner in structure.dictionaries:
        return _entry(structure, file, owner, connector)
    if owner not in structure.nodes:
        here = [".".join(one) for one in (*structure.nodes, *structure.dictionaries) if one[:-1] == path and one]
        raise file.error(f'a connection names "{".".join(owner)}", which does not exist', *here)
    connectors = structure.nodes[owner].connectors
    if connector not in connectors:
        raise file.error(f'"{name_of((owner, connector))}" is no connector', *connectors)
    kind = connectors[connector].kind
    if kind not in (*GIVES, *TAKES):
        raise file.error(f'"{name_of((owner, connector))}" is connected, and its kind "{kind}" says no direction')
    return (owner, connector), (kind in GIVES) != (owner == path)


def _entry(structure: Structure, file: SspFile, owner: Path, connector: str) -> tuple[End, bool | None]:
    """Return the entry of the dictionary behind a reference, and whether the reference gives it."""
    dictionary, connectors = structure.dictionaries[owner]
    entries = structure.nodes[dictionary].connectors
    if connector not in connectors or connector not in entries:
        raise file.error(
            f'"{name_of((owner, connector))}" is no connector', *(one for one in connectors if one in entries)
        )
    return (dictionary, connector), {"output": True, "input": False}.get(connectors[connector].kind)
