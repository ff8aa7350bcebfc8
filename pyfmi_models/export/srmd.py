"""SRMD: what a model was identified from and how well, beside its FMU in an SSP, for programs of other teams.

Reference: SSP Traceability, Simulation Resource Meta Data 1.0.0, Modelica Association.
"""

import hashlib
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence

from pyfmi_models.export.description import xml_text

NAMESPACES = {
    "srmd": "http://ssp-standard.org/SSPTraceability1/SimulationResourceMetaData",
    "stc": "http://ssp-standard.org/SSPTraceability1/SSPTraceabilityCommon",
}
KIND = "mount-cosim.identification"
"""The type of the classification, whose keywords are the keys of `origin` in a card: recordings.0.sha256, evidence."""


def metadata(name: str, facts: Mapping[str, object], file: str = "", content: bytes = b"") -> bytes:
    """Write the metadata of one resource.

    Args:
        name: of the component.
        facts: by keyword; tables and lists are flattened, their keys joined by dots.
        file: the resource, relative to the metadata; none where they lie in it, which cannot hold its own hash.
        content: of the resource, for its SHA3-256.
    """
    spaces = {f"xmlns:{prefix}": one for prefix, one in NAMESPACES.items()}
    about = {"version": "1.0.0", "name": name}
    if file:
        about |= {"data": file, "checksum": hashlib.sha3_256(content).hexdigest(), "checksumType": "SHA3-256"}
    root = ET.Element("srmd:SimulationResourceMetaData", {**spaces, **about})
    entries = ET.SubElement(root, "stc:Classification", type=KIND)
    for keyword, value in _flat(facts):
        ET.SubElement(entries, "stc:ClassificationEntry", keyword=keyword).text = value
    return xml_text(root)


def _flat(facts: object, before: str = "") -> Iterator[tuple[str, str]]:
    """List pairs of keyword and text."""
    if isinstance(facts, Mapping):
        pairs = list(facts.items())
    elif isinstance(facts, Sequence) and not isinstance(facts, str):
        pairs = list(enumerate(facts))
    else:
        yield before, str(facts)
        return
    for key, value in pairs:
        yield from _flat(value, f"{before}.{key}" if before else str(key))
