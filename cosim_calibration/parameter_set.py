"""The numbers of a calibration as a parameter set of SSP (SSV), which any tool applies to the FMU as it was.

Reference: System Structure and Parameterization 1.0 (2019), 6; Modelica Association.
"""

from pathlib import Path
from xml.etree import ElementTree

from cosim.support.errors import UnitError
from cosim.support.files import replacing
from cosim.support.units import unit
from cosim_calibration.calibrate import Calibrated

VALUES = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
COMMON = "http://ssp-standard.org/SSP1/SystemStructureCommon"
_DIMENSION = ("m", "kg", "s", "A", "K")


def write_set(done: Calibrated, path: Path, force: bool) -> Path:
    """Write the parameter set (OutputError where the file exists and `force` is not set)."""
    attributes = {"version": "1.0", "name": f"{done.subject.source.stem} identified"}
    root = ElementTree.Element("ssv:ParameterSet", {"xmlns:ssv": VALUES, "xmlns:ssc": COMMON, **attributes})
    group = ElementTree.SubElement(root, "ssv:Parameters")
    units: dict[str, dict[str, str]] = {}
    for one in done.free:
        parameter = ElementTree.SubElement(group, "ssv:Parameter", name=one.name)
        real = ElementTree.SubElement(parameter, "ssv:Real", value=repr(done.values[one.name]))
        base = _base(one.unit)
        if base is not None:
            units[one.unit] = base
            real.set("unit", one.unit)
    if units:
        holder = ElementTree.SubElement(root, "ssv:Units")
        for name, base in sorted(units.items()):
            ElementTree.SubElement(ElementTree.SubElement(holder, "ssc:Unit", name=name), "ssc:BaseUnit", base)
    ElementTree.indent(root)
    with replacing(path, force) as partial:
        partial.write_bytes(ElementTree.tostring(root, "utf-8", xml_declaration=True) + b"\n")
    return path


def _base(name: str) -> dict[str, str] | None:
    """A unit in base units; None where it is not known."""
    if not name:
        return None
    try:
        found = unit(name)
    except UnitError:
        return None
    base = {key: str(power) for key, power in zip(_DIMENSION, found.dimension, strict=True) if power}
    return base | ({"factor": repr(found.factor)} if found.factor != 1 else {})
