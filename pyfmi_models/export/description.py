"""modelDescription.xml of FMI 2.0 and FMI 3.0 from the layout of a model."""

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from importlib.metadata import PackageNotFoundError, version

from pyfmi_models.export.codegen import TOLERANCE, Generated
from pyfmi_models.export.layout import Layout, Row
from pyfmi_models.export.structure import unknowns_of
from pyfmi_models.export.units import BASE, parse_unit

TICK_RULE = (
    "Sampled every {period!r} s: tick k is at start + k * period, counted. A co-simulation step over [t, t + h) "
    "executes the ticks in it with the inputs set before the step; outputs read after it are those of its last tick, "
    "so the command computed from the sample of tick k acts from tick k + 1. In model exchange ticks are time events."
)
LOG_CATEGORIES = {
    "logStatusError": "Why a call was refused or failed, with the variable and the rule",
    "logEvents": "Changes of mode",
}
_NAME = re.compile(r"[A-Za-z_]\w*(\[\d+(,\d+)*\])?(\.[A-Za-z_]\w*(\[\d+(,\d+)*\])?)*", re.ASCII)


def description_text(model_description: str, period: float | None) -> str:
    """The model's sentence, and for a sampled model the rule of its ticks."""
    return f"{model_description} {TICK_RULE.format(period=period)}" if period else model_description


def fmi2_description(generated: Generated, sources: Iterable[str]) -> bytes:
    """The XML of FMI 2.0; `sources` are the C files to compile. Raises ExportError for an unknown unit."""
    layout = generated.layout
    root = ET.Element("fmiModelDescription", fmiVersion="2.0", guid=generated.token, numberOfEventIndicators="0")
    _head(root, layout)
    continuous = "false" if layout.model.period else "true"
    flags = {
        "modelIdentifier": layout.identifier,
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "providesDirectionalDerivative": continuous,
    }
    exchange = ET.SubElement(root, "ModelExchange", {**flags, "completedIntegratorStepNotNeeded": "true"})
    simulation = ET.SubElement(root, "CoSimulation", {**flags, "canHandleVariableCommunicationStepSize": "true"})
    for interface in (exchange, simulation):
        group = ET.SubElement(interface, "SourceFiles")
        for name in sources:
            ET.SubElement(group, "File", name=name)
    variables = _body(root, layout)
    for row in layout.rows:
        head, numbers = _variable(row, layout)
        numbers |= {} if row.state is None else {"derivative": str(row.state + 1)}
        ET.SubElement(ET.SubElement(variables, "ScalarVariable", head), "Real", numbers)
    _structure2(root, layout)
    return xml_text(root)


def fmi3_description(generated: Generated) -> bytes:
    """The XML of FMI 3.0. Raises ExportError for an unknown unit."""
    layout = generated.layout
    root = ET.Element("fmiModelDescription", fmiVersion="3.0", instantiationToken=generated.token)
    _head(root, layout)
    continuous = "false" if layout.model.period else "true"
    flags = {
        "modelIdentifier": layout.identifier,
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "providesDirectionalDerivatives": continuous,
        "providesAdjointDerivatives": continuous,
    }
    ET.SubElement(root, "ModelExchange", {**flags, "needsCompletedIntegratorStep": "false"})
    step = {"fixedInternalStepSize": repr(layout.model.period)} if layout.model.period else {}
    ET.SubElement(root, "CoSimulation", {**flags, "canHandleVariableCommunicationStepSize": "true", **step})
    variables = _body(root, layout)
    for row in layout.rows:
        head, numbers = _variable(row, layout)
        ET.SubElement(
            variables, "Float64", head | numbers | ({} if row.state is None else {"derivative": str(row.state)})
        )
    _structure3(root, layout)
    return xml_text(root)


def _head(root: ET.Element, layout: Layout) -> None:
    model = layout.model
    structured = all(_NAME.fullmatch(row.variable.name) for row in layout.rows if row.kind != "rate")
    root.set("modelName", model.name)
    root.set("description", description_text(model.description, model.period))
    root.set("generationTool", f"mount-cosim {version_text()}")
    root.set("variableNamingConvention", "structured" if structured else "flat")


def version_text() -> str:
    """The version of mount-cosim that is installed."""
    try:
        return version("mount-cosim")
    except PackageNotFoundError:
        return "(not installed)"


def _units(root: ET.Element, layout: Layout) -> None:
    group = ET.SubElement(root, "UnitDefinitions")
    for name in sorted({row.variable.unit for row in layout.rows}):
        unit = parse_unit(name)
        element = ET.SubElement(group, "Unit", name=name)
        base = {key: str(power) for key, power in zip(BASE, unit.exponents, strict=True) if power}
        base |= {"factor": repr(unit.factor)} if unit.factor != 1 else {}
        base |= {"offset": repr(unit.offset)} if unit.offset else {}
        ET.SubElement(element, "BaseUnit", base)
        for display, factor in unit.display.items():
            if display != name:
                ET.SubElement(element, "DisplayUnit", name=display, factor=repr(factor))


def _body(root: ET.Element, layout: Layout) -> ET.Element:
    """Units, categories of messages and the default experiment; return the element for the variables."""
    _units(root, layout)
    group = ET.SubElement(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        ET.SubElement(group, "Category", name=name, description=text)
    step = repr(layout.model.period or 1e-4)
    ET.SubElement(root, "DefaultExperiment", startTime="0.0", stopTime="1.0", tolerance=repr(TOLERANCE), stepSize=step)
    return ET.SubElement(root, "ModelVariables")


def _role(row: Row, layout: Layout) -> dict[str, str]:
    """Causality, variability and initial. Outputs of a sampled model hold their start value until the first tick."""
    changing = "discrete" if layout.model.period else "continuous"
    setting = "tunable" if row.variable.tunable else "fixed"
    return {
        "time": {"causality": "independent", "variability": "continuous"},
        "input": {"causality": "input", "variability": "continuous"},
        "parameter": {"causality": "parameter", "variability": setting, "initial": "exact"},
        "state": {"causality": "local", "variability": changing, "initial": "exact"},
        "rate": {"causality": "local", "variability": "continuous", "initial": "calculated"},
        "output": {
            "causality": "output",
            "variability": changing,
            "initial": "exact" if layout.model.period else "calculated",
        },
    }[row.kind]


def _numbers(row: Row, role: dict[str, str]) -> dict[str, str]:
    variable = row.variable
    found = {"unit": variable.unit}
    display = parse_unit(variable.unit).display_for(_size(row))
    found |= {"displayUnit": display} if display not in (None, variable.unit) else {}
    if row.kind != "time":
        found |= {"min": repr(float(variable.low))} if math.isfinite(variable.low) else {}
        found |= {"max": repr(float(variable.high))} if math.isfinite(variable.high) else {}
        found |= {"nominal": repr(float(variable.nominal))} if variable.nominal != 1 else {}
    if row.kind == "input" or role.get("initial") == "exact":
        found["start"] = repr(float(variable.start))
    return found


def _size(row: Row) -> float:
    """How large the numbers are that a person will read: a parameter's own, else the nominal value."""
    return abs(row.variable.start) or row.variable.nominal if row.kind == "parameter" else row.variable.nominal


def _variable(row: Row, layout: Layout) -> tuple[dict[str, str], dict[str, str]]:
    """What is said of a variable, and of its numbers."""
    role = _role(row, layout)
    head = {"name": row.variable.name, "valueReference": str(row.reference), "description": row.variable.description}
    return head | role, _numbers(row, role)


def _structure(layout: Layout) -> dict[str, list[tuple[Row, Mapping[int, str]]]]:
    """Outputs, rates, and what is calculated at the start: what each depends on, and how."""
    unknowns = unknowns_of(layout)
    running = {kind: [(u.row, u.dependencies) for u in unknowns if u.row.kind == kind] for kind in ("output", "rate")}
    return running | {"initial": [] if layout.model.period else [(u.row, u.initial) for u in unknowns]}


def _structure2(root: ET.Element, layout: Layout) -> None:
    structure, found = ET.SubElement(root, "ModelStructure"), _structure(layout)
    for group, kind in (("Outputs", "output"), ("Derivatives", "rate"), ("InitialUnknowns", "initial")):
        parent = ET.SubElement(structure, group) if found[kind] else structure
        for row, known in found[kind]:
            ET.SubElement(parent, "Unknown", {"index": str(row.reference + 1)} | _dependencies(known, 1))


def _structure3(root: ET.Element, layout: Layout) -> None:
    structure, found = ET.SubElement(root, "ModelStructure"), _structure(layout)
    for name, kind in (("Output", "output"), ("ContinuousStateDerivative", "rate"), ("InitialUnknown", "initial")):
        for row, known in found[kind]:
            ET.SubElement(structure, name, {"valueReference": str(row.reference)} | _dependencies(known, 0))


def _dependencies(known: Mapping[int, str], first: int) -> dict[str, str]:
    references = " ".join(str(reference + first) for reference in known)
    return {"dependencies": references, "dependenciesKind": " ".join(known.values())}


def xml_text(root: ET.Element) -> bytes:
    """The element as an indented XML file."""
    ET.indent(root)
    text: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"
