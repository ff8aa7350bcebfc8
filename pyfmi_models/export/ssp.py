"""SSP 1.0: models, the wires between them, their parameters and a default experiment in one archive.

Tools read the prefixes of the names literally (ecos, libcosim) and refuse connectors of the system itself, so the
system is closed: what drives it is a component too. Only inputs that a wire feeds are connectors, because FMPy feeds
every connector it finds. Reference: System Structure and Parameterization 1.0, Modelica Association 2019.
"""

import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from pyfmi_models.errors import ExportError
from pyfmi_models.export.archive import export_fmu, write_zip
from pyfmi_models.export.description import xml_text
from pyfmi_models.export.documentation import page
from pyfmi_models.export.related import Related, identified
from pyfmi_models.export.srmd import metadata
from pyfmi_models.export.units import BASE, parse_unit
from pyfmi_models.model import Model, Variable

NAMESPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
}
PARAMETER_SET = "card"
"""One name for the sets of all components: tools apply parameter sets by name."""
_DELAYED = "Computed at tick k of {source}, acts from tick k + 1 on: a delay of one step."
_AT_ONCE = "The value at the start of a step, held over the step."


@dataclass(frozen=True, kw_only=True)
class Connection:
    """target = factor source + offset; both are written `component.variable`."""

    source: str
    target: str
    factor: float = 1.0
    offset: float = 0.0
    note: str = ""


@dataclass(frozen=True, kw_only=True)
class Archive:
    """An FMU that exists already, as a component of a system: those of its variables that wires may reach."""

    path: Path
    description: str
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    parameters: tuple[Variable, ...] = ()
    period: float | None = None


@dataclass(frozen=True, kw_only=True)
class System:
    """Models or FMUs by the name of their component, the wires between them, and step and stop [s] of a run.

    `origins` says of components what they were identified from and how well (see `srmd`).

    Raises ExportError if a wire joins what does not exist, or other units.
    """

    name: str
    description: str
    components: Mapping[str, Model | Archive]
    connections: tuple[Connection, ...]
    step: float
    stop: float
    origins: Mapping[str, Mapping[str, object]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for connection in self.connections:
            ends = self.variable(connection.source, "output"), self.variable(connection.target, "input")
            one, other = (parse_unit(end.unit) for end in ends)
            if (one.exponents, one.factor, one.offset) != (other.exponents, other.factor, other.offset):
                wire = f'"{connection.target}" [{other.name}] is fed by "{connection.source}" [{one.name}]'
                raise ExportError(f"{wire}: these are different units")

    def variable(self, name: str, causality: Literal["input", "output"]) -> Variable:
        """Find `component.variable`; raises ExportError that names the end of a wire that is not there."""
        owner, _, variable = name.partition(".")
        model = self.components.get(owner)
        choices = () if model is None else model.inputs if causality == "input" else model.outputs
        found = next((one for one in choices if one.name == variable), None)
        if found is None:
            have = ", ".join(one.name for one in choices) or "none"
            raise ExportError(f'"{name}" is no {causality}; there are: {have}')
        return found

    def delay(self, connection: Connection) -> str:
        """Say in a sentence when a value that the wire carries acts."""
        source = connection.source.partition(".")[0]
        said = _DELAYED if self.components[source].period else _AT_ONCE
        return " ".join(filter(None, (said.format(source=source), connection.note)))


def export_ssp(
    system: System,
    path: Path,
    *,
    fmi: Literal[2, 3] = 2,
    force: bool = False,
    platforms: tuple[str, ...] = (),
) -> Path:
    """Write the system as an SSP 1.0 archive and return its path.

    The archive holds the structure, an FMU, a parameter set and where known its metadata a component under
    `resources/`, and a page of documentation. FMI 2 by default: FMPy's SSP runner and libcosim know no other. Equal
    systems give equal bytes.
    Raises ExportError if the file exists and `force` is not given, or a model cannot be exported.
    """
    path = Path(path)
    if path.exists() and not force:
        raise ExportError(f"{path} exists; use force to replace it")
    found = {"SystemStructure.ssd": _structure(system), "documentation/index.html": _page(system)}
    for name, model in system.components.items():
        numbers = _parameters(model) if model.parameters else b""
        origin = system.origins.get(name, {})
        found[f"resources/{name}.fmu"] = fmu = _fmu(model, fmi, platforms, identified(name, origin, numbers))
        if origin:
            found[f"resources/{name}.srmd"] = metadata(name, origin, f"{name}.fmu", fmu)
        if numbers:
            found[f"resources/{name}.ssv"] = numbers
    write_zip(path, found)
    return path


def _fmu(model: Model | Archive, fmi: Literal[2, 3], platforms: tuple[str, ...], related: tuple[Related, ...]) -> bytes:
    if isinstance(model, Archive):
        return model.path.read_bytes()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.fmu"
        return export_fmu(model, path, fmi=fmi, platforms=platforms, related=related).read_bytes()


def _root(tag: str, name: str, *prefixes: str) -> ET.Element:
    spaces = {f"xmlns:{prefix}": NAMESPACES[prefix] for prefix in prefixes}
    return ET.Element(tag, {**spaces, "version": "1.0", "name": name})


def _structure(system: System) -> bytes:
    root = _root("ssd:SystemStructureDescription", system.name, *NAMESPACES)
    root.set("generationTool", "mount-cosim")
    top = ET.SubElement(root, "ssd:System", name=system.name, description=system.description)
    elements = ET.SubElement(top, "ssd:Elements")
    for name, model in system.components.items():
        _component(elements, name, model, system)
    wires = ET.SubElement(top, "ssd:Connections")
    for connection in system.connections:
        _wire(wires, connection, system.delay(connection))
    variables = [one for model in system.components.values() for one in (*model.inputs, *model.outputs)]
    _units(ET.SubElement(root, "ssd:Units"), variables)
    _experiment(root, system)
    return xml_text(root)


def _component(elements: ET.Element, name: str, model: Model | Archive, system: System) -> None:
    element = ET.SubElement(
        elements,
        "ssd:Component",
        name=name,
        description=model.description,
        type="application/x-fmu-sharedlibrary",
        source=f"resources/{name}.fmu",
        implementation="CoSimulation",
    )
    fed = {connection.target for connection in system.connections}
    inputs = [one for one in model.inputs if f"{name}.{one.name}" in fed]
    connectors = ET.SubElement(element, "ssd:Connectors")
    for kind, variables in (("input", inputs), ("output", model.outputs)):
        for one in variables:
            connector = ET.SubElement(
                connectors, "ssd:Connector", name=one.name, kind=kind, description=one.description
            )
            ET.SubElement(connector, "ssc:Real", unit=one.unit)
    if not model.parameters:
        return
    bindings = ET.SubElement(element, "ssd:ParameterBindings")
    ET.SubElement(bindings, "ssd:ParameterBinding", source=f"resources/{name}.ssv")


def _wire(wires: ET.Element, connection: Connection, delay: str) -> None:
    start, end = connection.source.partition("."), connection.target.partition(".")
    element = ET.SubElement(
        wires,
        "ssd:Connection",
        startElement=start[0],
        startConnector=start[2],
        endElement=end[0],
        endConnector=end[2],
        description=delay,
    )
    if (connection.factor, connection.offset) != (1, 0):
        numbers = {"factor": repr(float(connection.factor)), "offset": repr(float(connection.offset))}
        ET.SubElement(element, "ssc:LinearTransformation", numbers)


def _units(group: ET.Element, variables: Iterable[Variable]) -> None:
    for name in sorted({one.unit for one in variables}):
        unit = parse_unit(name)
        base = {key: str(power) for key, power in zip(BASE, unit.exponents, strict=True) if power}
        base |= {"factor": repr(unit.factor)} if unit.factor != 1 else {}
        base |= {"offset": repr(unit.offset)} if unit.offset else {}
        ET.SubElement(ET.SubElement(group, "ssc:Unit", name=name), "ssc:BaseUnit", base)


def _experiment(root: ET.Element, system: System) -> None:
    """SSP 1.0 has no step of a run; the annotation is that of the Open Simulation Platform, which libcosim reads."""
    experiment = ET.SubElement(root, "ssd:DefaultExperiment", startTime="0.0", stopTime=repr(float(system.stop)))
    annotations = ET.SubElement(experiment, "ssd:Annotations")
    annotation = ET.SubElement(annotations, "ssc:Annotation", type="com.opensimulationplatform")
    algorithm = ET.SubElement(annotation, "osp:Algorithm")
    ET.SubElement(algorithm, "osp:FixedStepAlgorithm", baseStepSize=repr(float(system.step)))


def _parameters(model: Model | Archive) -> bytes:
    root = _root("ssv:ParameterSet", PARAMETER_SET, "ssv", "ssc")
    group = ET.SubElement(root, "ssv:Parameters")
    for one in model.parameters:
        parameter = ET.SubElement(group, "ssv:Parameter", name=one.name, description=one.description)
        ET.SubElement(parameter, "ssv:Real", value=repr(float(one.start)), unit=one.unit)
    _units(ET.SubElement(root, "ssv:Units"), model.parameters)
    return xml_text(root)


def _page(system: System) -> bytes:
    delays = [(connection, system.delay(connection)) for connection in system.connections]
    return page("ssp.html.j2", system=system, delays=delays)
