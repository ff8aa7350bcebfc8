"""The model description of a system's FMU, FMI 2.0 and 3.0."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence

from cosim.support.version import __version__
from cosim_nesting.prepared import Prepared
from cosim_nesting.variables import Shown

TOOL = f"mount-cosim {__version__}"


def description(prepared: Prepared, shown: Sequence[Shown], token: str, identifier: str, fmi: int) -> bytes:
    """Write modelDescription.xml; value references count from 1 in the order of `shown`, and 0 is the time of FMI 3."""
    root = ET.Element("fmiModelDescription", fmiVersion=f"{fmi}.0", modelName=prepared.name)
    root.set("guid" if fmi == 2 else "instantiationToken", token)
    root.set("description", f"{prepared.name}: {', '.join(part.name for part in prepared.plan.parts)} as one system")
    root.set("generationTool", TOOL)
    root.set("variableNamingConvention", "structured" if all(map(_is_structured, shown)) else "flat")
    (_head2 if fmi == 2 else _head3)(root, prepared, identifier)
    _units(root, shown)
    span = {
        "startTime": "0",
        "stopTime": repr(prepared.ticks * prepared.plan.step),
        "stepSize": repr(prepared.plan.step),
    }
    ET.SubElement(root, "DefaultExperiment", span)
    variables, structure = ET.SubElement(root, "ModelVariables"), ET.SubElement(root, "ModelStructure")
    (_variables2 if fmi == 2 else _variables3)(variables, structure, shown)
    ET.indent(root)
    text: bytes = ET.tostring(root, encoding="utf-8")
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + text + b"\n"


def _head2(root: ET.Element, prepared: Prepared, identifier: str) -> None:
    del prepared
    flags = {"canHandleVariableCommunicationStepSize": "true", "providesDirectionalDerivative": "false"}
    ET.SubElement(root, "CoSimulation", {"modelIdentifier": identifier, **flags})


def _head3(root: ET.Element, prepared: Prepared, identifier: str) -> None:
    flags = {"canHandleVariableCommunicationStepSize": "true", "providesDirectionalDerivatives": "false"}
    flags |= {"providesAdjointDerivatives": "false", "fixedInternalStepSize": repr(prepared.plan.step)}
    ET.SubElement(root, "CoSimulation", {"modelIdentifier": identifier, **flags})


def _units(root: ET.Element, shown: Sequence[Shown]) -> None:
    units = sorted({one.unit for one in shown if one.unit})
    if units:
        listed = ET.SubElement(root, "UnitDefinitions")
        for unit in units:
            ET.SubElement(listed, "Unit", name=unit)


def _facts(one: Shown, reference: int) -> dict[str, str]:
    kinds = {"INPUT": ("input", "continuous"), "PARAMETER": ("parameter", "fixed"), "OUTPUT": ("output", "continuous")}
    causality, variability = kinds[one.kind]
    facts = {"name": one.name, "valueReference": str(reference)}
    facts |= {"description": one.description} if one.description else {}
    return facts | {"causality": causality, "variability": variability}


def _real(one: Shown) -> dict[str, str]:
    start = {} if one.kind == "OUTPUT" else {"start": repr(one.start)}
    return ({"unit": one.unit} if one.unit else {}) | start


def _variables2(variables: ET.Element, structure: ET.Element, shown: Sequence[Shown]) -> None:
    outputs, unknowns = (ET.SubElement(structure, name) for name in ("Outputs", "InitialUnknowns"))
    for reference, one in enumerate(shown, 1):
        scalar = ET.SubElement(variables, "ScalarVariable", _facts(one, reference))
        ET.SubElement(scalar, "Real", _real(one))
        if one.kind == "OUTPUT":
            for listed in (outputs, unknowns):
                ET.SubElement(listed, "Unknown", index=str(reference))
    for listed in (outputs, unknowns):
        if not len(listed):
            structure.remove(listed)


def _variables3(variables: ET.Element, structure: ET.Element, shown: Sequence[Shown]) -> None:
    time = {"name": "time", "valueReference": "0", "causality": "independent", "variability": "continuous"}
    ET.SubElement(variables, "Float64", time)
    for reference, one in enumerate(shown, 1):
        ET.SubElement(variables, "Float64", _facts(one, reference) | _real(one))
    for kind in ("Output", "InitialUnknown"):
        for reference, one in enumerate(shown, 1):
            if one.kind == "OUTPUT":
                ET.SubElement(structure, kind, valueReference=str(reference))


def _is_structured(one: Shown) -> bool:
    return all(part.isidentifier() for part in one.name.split("."))
