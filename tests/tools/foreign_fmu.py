"""An FMU as another team would have made it: the tiny one with other names and units."""

import zipfile
from pathlib import Path
from xml.etree import ElementTree

THEIRS = {"a": "Motor.torque", "b": "Brake.torque", "k": "Gain[1]", "y": "Encoder.angle"}


def foreign(fmu: Path, path: Path, definitions: str = "", names: dict[str, str] | None = None, **units: str) -> Path:
    """The same FMU with other names (THEIRS), and other units of inputs ("" for none) with definitions of units."""
    names = THEIRS if names is None else names
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(path, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            told = name == "modelDescription.xml"
            target.writestr(name, restated(content, definitions, names, units) if told else content)
    return path


def restated(content: bytes, definitions: str, names: dict[str, str], units: dict[str, str]) -> bytes:
    root = ElementTree.fromstring(content)
    root.find("UnitDefinitions").extend(ElementTree.fromstring(f"<all>{definitions}</all>"))
    for variable in root.find("ModelVariables"):
        ours = variable.get("name")
        variable.set("name", names.get(ours, ours))
        numbers = variable if variable.find("Real") is None else variable.find("Real")
        if ours in units:
            numbers.attrib.pop("unit")
            numbers.attrib.update({"unit": units[ours]} if units[ours] else {})
    return ElementTree.tostring(root)
