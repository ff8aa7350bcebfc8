"""What the description of somebody else's FMU must not hold, as far as FMPy does not see to it."""

from collections.abc import Mapping
from math import inf
from pathlib import Path
from typing import Any

from cosim.support.errors import FmuError
from cosim.support.xml_files import in_ascii

REFERENCES = 2**32
"""A value reference is a number of 32 bits."""
INDICATORS = 1_000_000
"""Event indicators at most, for which memory is taken."""
VARIABLES = 300_000
"""Variables at most, each of which takes 2 kB of memory while it is read; tools write 200,000."""
WORDS = {
    "causality": ("parameter", "calculatedParameter", "input", "output", "local", "independent"),
    "variability": ("constant", "fixed", "tunable", "discrete", "continuous"),
    "initial": ("exact", "approx", "calculated"),
}
"""What FMI knows of each, beside `structuralParameter` in FMI 3."""
_STRUCTURAL = {"3": ("structuralParameter",)}
_MOST_DOUBTS = 5
"""Doubts about variables that are told one by one."""


def check_count(content: bytes, path: Path) -> None:
    """Refuse the text of a model description with more variables than can be read in a reasonable time.

    Raises:
        FmuError: names the FMU and the limit.
    """
    text = in_ascii(content)
    count = min(
        text.count(b"valueReference"), text.count(b"name")
    )  # FMI 3 repeats references, and units have names too
    if count > VARIABLES:
        message = f"{path} has {count:,} variables; {VARIABLES:,} are the most. Export it without inner ones."
        raise FmuError(message, culprit=str(path), value=count)


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
    known_kinds: set[tuple[str, ...]] = set()
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
        kind = (variable.causality, variable.variability, variable.initial)
        if kind not in known_kinds:
            _check_words(path, variable, words, description.fmiVersion)
            known_kinds.add(kind)
        if variable.name in names:
            raise _error(path, variable, "is there twice")
        names.add(variable.name)


def _check_words(path: Path, variable: Any, words: Mapping[str, tuple[str, ...]], version: str) -> None:
    for key, known in words.items():
        if getattr(variable, key) not in (None, *known):
            rule = f"FMI {version} knows {', '.join(known)}"
            raise _error(path, variable, f'has {key} = "{getattr(variable, key)}"; {rule}', *known)


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
    declared = variable.declaredType
    return own if own is not None or declared is None else getattr(declared, key, None)


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
    if text is None:
        return
    try:
        float(text or 0)
    except (TypeError, ValueError):
        raise _error(path, variable, f'has {key} = "{text}", which is no number') from None


def _error(path: Path, variable: Any, what: str, *choices: str) -> FmuError:
    return FmuError(f'{path}: the variable "{variable.name}" {what}.', culprit=str(variable.name), choices=choices)
