"""What an FMU says about itself, read by FMPy and judged: can it run here, and which variables does it have."""

import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from math import inf
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from cosim.fmi.sound import check_count, check_variables
from cosim.support.archive import contents, read
from cosim.support.errors import FmuError
from cosim.support.files import sha256
from cosim.support.memory import many_objects
from cosim.support.xml_files import LARGEST, check_xml

DESCRIPTION = "modelDescription.xml"
READ = {DESCRIPTION, "sources/buildDescription.xml"}
"""XML members that FMPy reads."""
INTERFACES = {
    "coSimulation": "co-simulation",
    "modelExchange": "model-exchange",
    "scheduledExecution": "scheduled-execution",
}
"""What FMI calls the interfaces, by their element in a model description."""


def describe(path: Path) -> Any:
    """Read the model description (FMPy's) of an FMU that this tool can run.

    Raises:
        FmuError: the file is missing, no FMU, or of another FMI version or kind.
    """
    import fmpy

    if not path.exists():
        raise FmuError(f"{path} does not exist.", culprit=str(path))
    if path.is_dir():
        raise FmuError(f"{path} is no FMU: it is a folder.", culprit=str(path))
    if not zipfile.is_zipfile(path):
        raise FmuError(f"{path} is no FMU: it is not a zip archive.", culprit=str(path))
    complaint = complaint_of(path)
    names = {one.filename for one in contents(path, complaint)}
    if DESCRIPTION not in names:
        raise FmuError(f"{path} is no FMU: the archive holds no modelDescription.xml.", culprit=str(path))
    try:
        for member in names & READ:
            check_xml(read(path, member, complaint, LARGEST), member, complaint)
        content = read(path, DESCRIPTION, complaint)
        check_count(content, path)
        version = _version(content)
        # FMPy would leave the file open where it cannot read it
        with path.open("rb") as file, _long_attributes(), many_objects():
            description = fmpy.read_model_description(file, validate=False) if version[:2] in ("2.", "3.") else None
    except FmuError:
        raise
    except Exception as error:  # FMPy and its XML parser raise many kinds; each means the same to the user
        raise FmuError(f"{path} has a modelDescription.xml that cannot be read: {first_line(error)}.") from error
    if description is None:
        raise FmuError(f"{path} is of FMI {version}; this tool runs FMI 2.0 and 3.0.", culprit=str(path))
    check_variables(path, description)
    return description


def complaint_of(path: Path) -> Callable[[str], FmuError]:
    """Return what makes an error of a sentence about the archive of an FMU."""
    return lambda what: FmuError(f"{path} is no FMU that can be run: {what}.", culprit=str(path))


def own_interface(path: Path, description: Any, name: str) -> Any:
    """Return one interface of a model description: `coSimulation`, `modelExchange` or `scheduledExecution`.

    Raises:
        FmuError: the FMU does not have it.
    """
    found = getattr(description, name)
    if found is None:
        have = tuple(word for key, word in INTERFACES.items() if getattr(description, key) is not None)
        message = f"{path} has no {INTERFACES[name]} interface; it has: {', '.join(have) or 'none'}."
        raise FmuError(message, culprit=str(path), choices=have)
    return found


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


def initial_dependencies_of(description: Any) -> dict[str, frozenset[str] | None]:
    """List the inputs that each variable follows in initialisation mode; None where it may follow all of them.

    Only what FMI lets a master read there is listed: in FMI 2 outputs and initial unknowns, in FMI 3 every variable.
    What starts exactly at its start value follows nothing.
    """
    readable = [
        one for one in description.modelVariables if one.causality == "output" or description.fmiVersion[0] > "2"
    ]
    found: dict[str, frozenset[str] | None] = {
        one.name: frozenset() if one.initial == "exact" else None for one in readable
    }
    for unknown in description.initialUnknowns:
        known = unknown.dependencies
        inputs = None if known is None else frozenset(one.name for one in known if one.causality == "input")
        found[unknown.variable.name] = inputs
    aliases = {alias.name: one.name for one in description.modelVariables for alias in one.aliases or ()}
    return found | {alias: found[name] for alias, name in aliases.items() if name in found}


def own_step_of(description: Any, name: str) -> float:
    """Return the length of an FMU's own steps in s; 0 where it has none, or takes steps of any length.

    FMI 3 states it. In FMI 2 it is the step of the default experiment of an FMU that takes steps of one length only.
    """
    own, experiment = getattr(description, name), description.defaultExperiment
    if name != "coSimulation":
        return 0.0
    stated = own.fixedInternalStepSize
    if description.fmiVersion[0] == "2" and not own.canHandleVariableCommunicationStepSize:
        stated = experiment.stepSize if experiment else None
    try:
        length = float(stated or 0.0)
    except ValueError:
        return 0.0
    return length if 0 < length < inf else 0.0


def check_binary(path: Path, description: Any, identifier: str) -> None:
    """Refuse an FMU that has no binary for this platform.

    Raises:
        FmuError: names this platform and those the FMU has, or the file that is misnamed.
    """
    import fmpy

    folder = fmpy.platform if description.fmiVersion[0] == "2" else fmpy.platform_tuple
    library = f"{identifier}{fmpy.sharedLibraryExtension}"
    names = _names(path)
    if f"binaries/{folder}/{library}" not in names:
        folders = [name.split("/") for name in names if name.startswith("binaries/")]
        have = sorted({parts[1] for parts in folders if len(parts) > 2 and parts[2]})
        if folder in have:
            there = ", ".join(parts[2] for parts in folders if parts[1] == folder and parts[2:3] > [""])
            rule = f"its modelIdentifier asks for binaries/{folder}/{library}, and there is only: {there}"
            raise FmuError(f"{path} cannot run: {rule}.", culprit=str(path), value=library)
        has = ", ".join(have) or "none"
        message = f"{path} has no {folder} binary; it has {has}. Export it again for this platform."
        raise FmuError(message, culprit=str(path), value=folder, choices=tuple(have))


def provides_derivatives(path: Path, description: Any, name: str) -> bool:
    """Say whether an interface of an FMU gives directional derivatives; FMPy does not read it of FMI 3."""
    if description.fmiVersion[0] == "2":
        return bool(getattr(description, name).providesDirectionalDerivative)
    element = name[0].upper() + name[1:]
    with zipfile.ZipFile(path) as archive, archive.open("modelDescription.xml") as file:
        found = next((one for _, one in ElementTree.iterparse(file, ("start",)) if one.tag == element), None)
    return found is not None and found.get("providesDirectionalDerivatives") in ("true", "1")


def _names(path: Path) -> list[str]:
    with zipfile.ZipFile(path) as archive:
        return archive.namelist()


def _version(content: bytes) -> str:
    _, root = next(ElementTree.iterparse(BytesIO(content), ("start",)))
    return str(root.get("fmiVersion", "?"))


@contextmanager
def _long_attributes() -> Iterator[None]:
    """Let libxml2 take attributes of more than 10 MB: a million start values of an array are longer."""
    from lxml import etree

    etree.set_default_parser(etree.XMLParser(huge_tree=True, resolve_entities=False, no_network=True))
    try:
        yield
    finally:
        etree.set_default_parser(None)


def origin_of(path: Path, description: Any) -> dict[str, Any]:
    """Say which FMU it is, for the origin of a recording."""
    return {
        "file": path.name,
        "sha256": sha256(path),
        "model": description.modelName,
        "fmi": description.fmiVersion,
        "tool": description.generationTool or "",
    }


def first_line(error: BaseException) -> str:
    """Return the first line of an error, without its full stop."""
    lines = str(error).splitlines()
    return lines[0].rstrip(".") if lines else type(error).__name__
