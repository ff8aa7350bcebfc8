"""What an FMU says about itself, read by FMPy and judged: can it run here, and which variables does it have."""

import zipfile
from collections.abc import Mapping
from contextlib import suppress
from math import inf
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from cosim.component import Port
from cosim.errors import FmuError
from cosim.files import sha256
from cosim.units import BASE, in_base_units

_REAL = ("Real", "Float64")


def describe(path: Path) -> Any:
    """Read the model description (FMPy's) of an FMU that this tool can run.

    Raises:
        FmuError: the file is missing, no FMU, or of another FMI version or kind.
    """
    import fmpy

    if not path.exists():
        raise FmuError(f"{path} does not exist.", culprit=str(path))
    if not zipfile.is_zipfile(path):
        raise FmuError(f"{path} is no FMU: it is not a zip archive.", culprit=str(path))
    if "modelDescription.xml" not in _names(path):
        raise FmuError(f"{path} is no FMU: the archive holds no modelDescription.xml.", culprit=str(path))
    try:
        version = _version(path)
        description = fmpy.read_model_description(str(path), validate=False) if version[:2] in ("2.", "3.") else None
    except Exception as error:  # FMPy and its XML parser raise many kinds; each means the same to the user
        raise FmuError(f"{path} has a modelDescription.xml that cannot be read: {first_line(error)}.") from error
    if description is None:
        raise FmuError(f"{path} is of FMI {version}; this tool runs FMI 2.0 and 3.0.", culprit=str(path))
    return description


def own_interface(path: Path, description: Any, name: str) -> Any:
    """Return one interface of a model description: `coSimulation` or `modelExchange`.

    Raises:
        FmuError: the FMU does not have it.
    """
    words = {"coSimulation": "co-simulation", "modelExchange": "model-exchange"}
    found = getattr(description, name)
    if found is None:
        have = tuple(word for key, word in words.items() if getattr(description, key) is not None)
        message = f"{path} has no {words[name]} interface; it has: {', '.join(have) or 'none'}."
        raise FmuError(message, culprit=str(path), choices=have)
    return found


def ports_of(description: Any) -> dict[str, Port]:
    """List the scalar variables of a model description by name."""
    own = _own_units(description)
    return {v.name: _port(v, own) for v in description.modelVariables if not v.dimensions}


def feedthrough_of(description: Any) -> dict[str, frozenset[str] | None]:
    """List the inputs that each output follows at once; None where the model description does not say.

    A discrete output changes only when the model steps.
    """
    found: dict[str, frozenset[str] | None] = {}
    for unknown in description.outputs:
        known = unknown.dependencies
        inputs = None if known is None else frozenset(one.name for one in known if one.causality == "input")
        found[unknown.variable.name] = frozenset() if unknown.variable.variability == "discrete" else inputs
    return found


def check_binary(path: Path, description: Any, identifier: str) -> None:
    """Refuse an FMU that has no binary for this platform.

    Raises:
        FmuError: names this platform and those the FMU has.
    """
    import fmpy

    folder = fmpy.platform if description.fmiVersion[0] == "2" else fmpy.platform_tuple
    library = f"{identifier}{fmpy.sharedLibraryExtension}"
    names = _names(path)
    if f"binaries/{folder}/{library}" not in names:
        folders = [name.split("/") for name in names if name.startswith("binaries/")]
        have = sorted({parts[1] for parts in folders if len(parts) > 2})
        has = ", ".join(have) or "none"
        message = f"{path} has no {folder} binary; it has {has}. Export it again for this platform."
        raise FmuError(message, culprit=str(path), value=folder, choices=tuple(have))


def _names(path: Path) -> list[str]:
    with zipfile.ZipFile(path) as archive:
        return archive.namelist()


def _version(path: Path) -> str:
    with zipfile.ZipFile(path) as archive, archive.open("modelDescription.xml") as file:
        return ElementTree.parse(file).getroot().get("fmiVersion", "?")


def _own_units(description: Any) -> dict[str, str]:
    """Write the units of an FMU as this project knows them."""
    bases = {one.name: one.baseUnit for one in description.unitDefinitions or () if one.baseUnit is not None}
    return {
        name: in_base_units(name, {one: getattr(base, one) for one in BASE}, float(base.factor), float(base.offset))
        for name, base in bases.items()
    }


def _port(variable: Any, own_units: Mapping[str, str]) -> Port:
    real = variable.type in _REAL
    kind = variable.declaredType
    inherited = {key: getattr(variable, key) or (kind and getattr(kind, key)) for key in ("unit", "min", "max")}
    exact = variable.initial in ("exact", "approx") or variable.causality in ("parameter", "input")
    return Port(
        name=variable.name,
        reference=variable.valueReference,
        causality=variable.causality or "local",
        unit=own_units.get(inherited["unit"] or "", inherited["unit"] or ""),
        description=variable.description or "",
        start=_number(variable.start),
        low=-inf if inherited["min"] is None else float(inherited["min"]),
        high=inf if inherited["max"] is None else float(inherited["max"]),
        settable=exact and variable.start is not None and variable.variability != "constant",
        real=real,
    )


def _number(text: str | None) -> float | None:
    with suppress(TypeError, ValueError):
        return float(text)  # type: ignore[arg-type]
    return None


def origin_of(path: Path, description: Any) -> dict[str, Any]:
    """Say which FMU it is, for the origin of a recording."""
    return {
        "file": path.name,
        "sha256": sha256(path),
        "model": description.modelName,
        "fmi": description.fmiVersion,
        "tool": description.generationTool or "",
    }


def first_line(error: Exception) -> str:
    """Return the first line of an error, without its full stop."""
    lines = str(error).splitlines()
    return lines[0].rstrip(".") if lines else type(error).__name__
