"""What the description of somebody else's FMU must not hold, as far as FMPy does not see to it."""

import io
import zipfile
from math import inf
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
WORDS = {
    "causality": ("parameter", "calculatedParameter", "input", "output", "local", "independent"),
    "variability": ("constant", "fixed", "tunable", "discrete", "continuous"),
    "initial": ("exact", "approx", "calculated"),
}
"""What FMI knows of each, beside `structuralParameter` in FMI 3."""
_STRUCTURAL = {"3": ("structuralParameter",)}
_MOST_DOUBTS = 5
"""Doubts about variables that are told one by one."""


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
    words = WORDS | {"causality": (*WORDS["causality"], *_STRUCTURAL.get(description.fmiVersion[:1], ()))}
    for variable in description.modelVariables:
        if not variable.name:
            raise _error(path, variable, "has no name")
        reference = variable.valueReference
        if not isinstance(reference, int) or not 0 <= reference < REFERENCES:
            rule = "a value reference is a whole number from 0 to 4294967295"
            raise _error(path, variable, f"has the value reference {reference}; {rule}")
        for key in ("min", "max", "nominal"):
            _check_number(path, variable, key)
        for key, known in words.items():
            if getattr(variable, key) not in (None, *known):
                rule = f"FMI {description.fmiVersion} knows {', '.join(known)}"
                raise _error(path, variable, f'has {key} = "{getattr(variable, key)}"; {rule}', *known)
        if variable.name in names:
            raise _error(path, variable, "is there twice")
        names.add(variable.name)


def doubts_of(description: Any) -> tuple[str, ...]:
    """Say what a model description states of start values and limits that cannot be right, though the FMU may run."""
    found = [f'"{one.name}" {doubt}' for one in description.modelVariables if (doubt := _doubt(one))]
    more = len(found) - _MOST_DOUBTS
    return (
        *found[:_MOST_DOUBTS],
        *([f"{more:,} more variables have start values or limits like these"] if more > 0 else []),
    )


def _doubt(variable: Any) -> str:
    low, high = (inherited(variable, key) for key in ("min", "max"))
    items = [int(item.value) for item in getattr(variable.declaredType, "items", None) or ()]
    if variable.start is None or not (low or high or items):
        return _contradiction(low, high)
    texts = variable.start.split() if variable.dimensions else [variable.start]
    numbers = [number for text in texts if (number := _number(text)) is not None]
    least, greatest = -inf if low is None else float(low), inf if high is None else float(high)
    if least > greatest:
        return _contradiction(low, high)
    wrong = next((number for number in numbers if not least <= number <= greatest), None)
    if wrong is not None:
        return f"starts at {wrong:g}, outside its own limits of {least:g} .. {greatest:g}"
    wrong = next((number for number in numbers if items and number not in items), None)
    return "" if wrong is None else f"starts at {wrong:g}, which is none of its items"


def inherited(variable: Any, key: str) -> str | None:
    """Return an attribute of a variable, or that of its declared type where it states none itself."""
    own: str | None = getattr(variable, key, None)
    return own if own is not None else getattr(variable.declaredType, key, None)


def _contradiction(low: str | None, high: str | None) -> str:
    if low is None or high is None or float(low) <= float(high):
        return ""
    return f"has min = {low} above max = {high}; neither is used"


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _check_number(path: Path, variable: Any, key: str) -> None:
    text = inherited(variable, key)
    try:
        float(text or 0)
    except (TypeError, ValueError):
        raise _error(path, variable, f'has {key} = "{text}", which is no number') from None


def _error(path: Path, variable: Any, what: str, *choices: str) -> FmuError:
    return FmuError(f'{path}: the variable "{variable.name}" {what}.', culprit=str(variable.name), choices=choices)
