"""An FMU with other start values: the archive as it was, with a model description in which these are written.

Experiments that the FMU carries go: their references are what it gave with the old numbers (`left_behind`).
A binary may have start values of its own; `cosim` sets those that were changed, other tools may need the SSV.
"""

import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cosim.fmi.component import Port
from cosim.fmi.description import DESCRIPTION, complaint_of
from cosim.fmi.manifest import MANIFEST
from cosim.fmi.own_starts import MEMBER, as_member, own_starts
from cosim.support.archive import contents
from cosim.support.files import replacing
from cosim_calibration.left_behind import left_behind
from cosim_calibration.subject import Subject


def write_with_starts(subject: Subject, values: Mapping[str, float], path: Path, force: bool) -> Path:
    """Write an FMU with these start values, by name of the variable.

    Raises:
        OutputError: the file exists and `force` is not set.
    """
    source = subject.source
    with zipfile.ZipFile(source) as archive, replacing(path, force) as partial:
        text = _changed(archive.read(DESCRIPTION), [(subject.ports[name], one) for name, one in values.items()])
        gone, manifest = left_behind(archive)
        with zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as target:
            for member in contents(source, complaint_of(source)):
                if member.filename == MEMBER or member.filename in gone:
                    continue
                target.writestr(member, text if member.filename == DESCRIPTION else archive.read(member))
            if gone and manifest:
                target.writestr(MANIFEST, manifest)
            target.writestr(MEMBER, as_member({**own_starts(source), **values}))
    return path


def _changed(text: bytes, values: Sequence[tuple[Port, float]]) -> bytes:
    """The model description with other start values; everything else stays as it is written."""
    from lxml import etree

    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_blank_text=False)
    root: Any = etree.fromstring(text, parser)
    variables = root.find("ModelVariables")
    for port, value in values:
        element = next(one for one in variables if one.get("name") == port.variable or _has_alias(one, port.variable))
        holder = element if element.tag != "ScalarVariable" else element[0]
        holder.set("start", _start(holder.get("start", ""), port, value))
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8"))


def _has_alias(element: Any, name: str) -> bool:
    return any(one.get("name") == name for one in element.findall("Alias"))


def _start(before: str, port: Port, value: float) -> str:
    """The start value of a scalar, or of an array of which one element is changed."""
    if not port.array:
        return repr(value)
    texts = before.split()
    texts[port.element] = repr(value)
    return " ".join(texts)
