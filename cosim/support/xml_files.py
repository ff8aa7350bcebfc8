"""XML of somebody else, judged before a tree is made of it: a tree takes up to 50 times the memory of its text."""

from collections.abc import Callable
from typing import Any
from xml.parsers import expat

LARGEST = 2**27
"""Bytes of a document at most; the description of 200,000 variables has 20 to 60 MB."""
TREE = 800_000_000
"""Bytes that a document may take as a tree: with what is made of it a command stays near 1 GB."""
ELEMENT, ATTRIBUTE = 120, 250
"""Bytes of an element and of an attribute in a tree (libxml2's, measured; that of Python takes less)."""
PIECE = 8192


class _Begun(Exception):
    """The root of the document has begun."""


def check_xml(content: bytes, name: str, error: Callable[[str], Exception]) -> None:
    """Refuse a document that is too large, or that defines what it is made of (DOCTYPE): neither FMI nor SSP needs it.

    What is no XML is left to the parser, which says where.

    Args:
        content: the document.
        name: what it is called in a message.
        error: makes an error of what is wrong.

    Raises:
        what `error` makes.
    """
    if len(content) > LARGEST:
        raise error(f"{name} has more than {LARGEST >> 20} MiB")
    text = in_ascii(content)
    elements, attributes = text.count(b"<") - text.count(b"</"), text.count(b"=")
    size = ELEMENT * elements + ATTRIBUTE * attributes + len(text)
    if size > TREE:
        held = f"{elements:,} elements with {attributes:,} attributes"
        raise error(f"{name} has {held}, which takes {size / 1e6:,.0f} MB of memory; {TREE / 1e6:,.0f} are the most")
    if _has_doctype(content):
        raise error(f"{name} has a DOCTYPE, which neither FMI nor SSP needs")


def in_ascii(content: bytes) -> bytes:
    """Return a document in which words can be searched: in encodings of 16 and 32 bits without their zeros."""
    return content.translate(None, b"\0") if b"\0" in content[:PIECE] else content


def _has_doctype(content: bytes) -> bool:
    """Whether a document has a DOCTYPE, which can only stand in front of its root."""
    found = []

    def doctype(*_: Any) -> None:
        found.append(True)
        raise _Begun

    def begun(*_: Any) -> None:
        raise _Begun

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler, parser.StartElementHandler = doctype, begun
    try:
        for place in range(0, len(content), PIECE):
            parser.Parse(content[place : place + PIECE])
    except (_Begun, expat.ExpatError, LookupError, ValueError):
        pass  # it is well so far, or no XML
    return bool(found)
