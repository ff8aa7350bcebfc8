"""What the description of somebody else's FMU must not hold, as far as FMPy does not see to it."""

import io
import zipfile
from pathlib import Path
from typing import Any
from xml.parsers import expat

from cosim.support.errors import FmuError

REFERENCES = 2**32
"""A value reference is a number of 32 bits."""
INDICATORS = 1_000_000
"""Event indicators at most, for which memory is taken."""
LARGEST = 2**28
"""Bytes of an XML member at most."""


class _Begun(Exception):
    """The root of the document has begun."""


def check_xml(path: Path, member: str) -> None:
    """Refuse an XML member that is too large, or that defines what it is made of (DOCTYPE): FMI needs none.

    Raises:
        FmuError: names the archive and the member.
    """

    def doctype(*_: Any) -> None:
        raise FmuError(f"{path} has a DOCTYPE in {member}, which FMI does not know.", culprit=str(path))

    def begun(*_: Any) -> None:
        raise _Begun

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler, parser.StartElementHandler = doctype, begun
    with zipfile.ZipFile(path) as archive:
        if archive.getinfo(member).file_size > LARGEST:
            raise FmuError(f"{path} has more than {LARGEST >> 20} MiB of {member}.", culprit=str(path))
        try:
            with archive.open(member) as file:
                for piece in iter(lambda: file.read(io.DEFAULT_BUFFER_SIZE), b""):
                    parser.Parse(piece)
        except (_Begun, expat.ExpatError, LookupError, ValueError):
            return  # it is well so far, or no XML, which is said where it is read


def check_variables(path: Path, description: Any) -> None:
    """Refuse variables that no FMU can have.

    Raises:
        FmuError: names the FMU, the variable, what it says and what it may say.
    """
    indicators = description.numberOfEventIndicators or 0
    if not 0 <= indicators <= INDICATORS:
        message = f"{path} has numberOfEventIndicators = {indicators}; {INDICATORS:,} are the most."
        raise FmuError(message, culprit=str(path), value=indicators)
    names: set[str] = set()
    for variable in description.modelVariables:
        if not variable.name:
            raise _error(path, variable, "has no name")
        reference = variable.valueReference
        if not isinstance(reference, int) or not 0 <= reference < REFERENCES:
            rule = "a value reference is a whole number from 0 to 4294967295"
            raise _error(path, variable, f"has the value reference {reference}; {rule}")
        for key in ("min", "max", "nominal"):
            _check_number(path, variable, key)
        if variable.name in names:
            raise _error(path, variable, "is there twice")
        names.add(variable.name)


def _check_number(path: Path, variable: Any, key: str) -> None:
    text = getattr(variable, key, None)
    try:
        float(text or 0)
    except (TypeError, ValueError):
        raise _error(path, variable, f'has {key} = "{text}", which is no number') from None


def _error(path: Path, variable: Any, what: str) -> FmuError:
    return FmuError(f'{path}: the variable "{variable.name}" {what}.', culprit=str(variable.name))
