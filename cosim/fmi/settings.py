"""Parameters and start values of an FMU: which may be set, what each becomes, and how FMI is told."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from math import prod
from typing import Any

from cosim.fmi.component import Port
from cosim.fmi.types import function_of
from cosim.fmi.values import prepared
from cosim.support.errors import FmuError

STRUCTURAL = "structuralParameter"
_MOST_NAMED = 40
"""Names that a message lists at most."""


@dataclass(frozen=True)
class Setting:
    """A variable, scalar or whole array, and its elements as FMI's set function takes them."""

    port: Port
    values: list[Any]


def sizes_of(ports: Mapping[str, Port], name: str, parameters: Mapping[str, Any]) -> dict[str, int]:
    """Return the structural parameters that are given, by the name of their variable.

    Raises:
        FmuError: a value is none of the parameter's.
    """
    given = {key: value for key, value in parameters.items() if _is_structural(ports.get(key))}
    return {key: prepared(ports[key], value, f"{name}.{key}")[0] for key, value in given.items()}


def settings_of(ports: Mapping[str, Port], name: str, parameters: Mapping[str, Any]) -> list[Setting]:
    """Check parameters and start values of the component called `name`; elements of an array become one setting.

    Raises:
        FmuError: a name is unknown or cannot be set, or a value is none of the variable's.
    """
    found: dict[str, list[Any]] = {}
    for key, value in parameters.items():
        port = _settable(ports, name, key, value)
        whole = ports[port.variable]
        if port.array:
            elements = found.setdefault(whole.name, _start_values(whole, name))
            elements[port.element] = prepared(port, value, f"{name}.{key}")[0]
        else:
            found[whole.name] = prepared(whole, value, f"{name}.{key}")
    return [Setting(ports[key], values) for key, values in found.items()]


def tell(fmu: Any, version: int, settings: list[Setting]) -> None:
    """Call FMI's set functions, in the mode in which the FMU is."""
    for one in settings:
        getattr(fmu, f"set{function_of(one.port.type, version)}")([one.port.reference], one.values)


def _is_structural(port: Port | None) -> bool:
    return port is not None and port.causality == STRUCTURAL


def _settable(ports: Mapping[str, Port], name: str, key: str, value: Any) -> Port:
    port = ports.get(key)
    if port is not None and port.settable:
        return port
    choices = tuple(one.name for one in ports.values() if one.settable and not one.array)
    listed: Sequence[str] = choices
    if len(choices) > _MOST_NAMED:
        listed = get_close_matches(key, choices, 10, 0.3) or choices[:_MOST_NAMED]
    what = f"{port.not_settable} and cannot be set" if port else "does not exist"
    more = f" and {len(choices) - len(listed)} more" if len(listed) < len(choices) else ""
    message = f'"{name}.{key}" {what}; what can be set: {", ".join(listed)}{more}.'
    raise FmuError(message, culprit=f"{name}.{key}", value=value, choices=choices)


def _start_values(whole: Port, name: str) -> list[Any]:
    """Return the start values of an array, of which some elements are to be set."""
    texts = str(whole.start).split()
    if len(texts) != prod(whole.shape) or whole.type in ("String", "Binary"):
        message = f'"{name}.{whole.name}" does not say the start values of its elements; set it whole.'
        raise FmuError(message, culprit=f"{name}.{whole.name}")
    named = {"true": True, "false": False}
    return prepared(whole, [named.get(text, _number(text)) for text in texts], f"{name}.{whole.name}")


def _number(text: str) -> float | str:
    """Read a number; what is none stays text, which no number takes."""
    try:
        return int(text) if text.lstrip("+-").isdigit() else float(text)
    except ValueError:
        return text
