"""Values of parameters and start values, judged against the variable that shall have them.

A number for a number, an item's name or value for an enumeration, text for a string, hexadecimal digits for a binary,
a list in FMI's order (or nested by rows) for an array. Nothing is rounded and nothing is cut.
"""

from collections.abc import Mapping
from math import isfinite, prod
from typing import Any

import numpy as np

from cosim.fmi.component import Port
from cosim.fmi.types import FLOATS, INTEGERS, article, limits
from cosim.support.errors import FmuError
from cosim.support.numbers import shown

LARGEST_FLOAT32, LARGEST_FLOAT64 = float(np.finfo(np.float32).max), float(np.finfo(np.float64).max)
_BOOLEANS: Mapping[Any, bool] = {True: True, False: False, "true": True, "false": False}


def prepared(port: Port, value: Any, who: str) -> list[Any]:
    """Return the elements that FMI's set function takes for a variable (one for a scalar).

    Args:
        port: the variable, a scalar or a whole array.
        value: what it shall be.
        who: the variable's name for messages, with its component.

    Raises:
        FmuError: the value is none of the variable's; the sentence says why.
    """
    if not port.shape:
        if isinstance(value, list | tuple | np.ndarray):
            raise _error(who, value, "it is one value, no array")
        return [_element(port, value, who)]
    found = _flat(value)
    if len(found) != prod(port.shape):
        size = " x ".join(map(str, port.shape))
        raise _error(who, value, f"it has {size} elements, and {len(found)} are given")
    return [_element(port, one, who) for one in found]


def _flat(value: Any) -> list[Any]:
    if isinstance(value, list | tuple | np.ndarray):
        return [one for row in value for one in _flat(row)]
    return [value]


def _element(port: Port, value: Any, who: str) -> Any:
    if port.type in ("String", "Binary"):
        return _text(port.type, value, who)
    if port.type == "Boolean":
        return _boolean(value, who)
    number = _item(port, value, who) if port.type == "Enumeration" else value
    if isinstance(number, bool) or not isinstance(number, int | float | np.number):
        raise _error(who, value, "it must be a number, or an output of a signal")
    if isinstance(number, int) and abs(number) > LARGEST_FLOAT64:
        raise _error(who, value, "that is beyond a Float64")
    if port.low <= port.high and not port.low <= number <= port.high:  # limits that contradict each other are a doubt
        unit = f" {port.unit}" if port.unit else ""
        raise _error(who, value, f"it must lie in {port.low:g} .. {port.high:g}{unit}")
    return _float(port, number, who) if port.type in FLOATS else _integer(port, number, who)


def _float(port: Port, number: Any, who: str) -> float:
    if port.type == "Float32" and isfinite(number) and abs(number) > LARGEST_FLOAT32:
        raise _error(who, number, "that is beyond a Float32")
    return float(number)


def _integer(port: Port, number: Any, who: str) -> int:
    low, high = limits(port.type)
    if not isfinite(number) or number != int(number) or not low <= int(number) <= high:
        kind = port.type if port.type in INTEGERS else "Enumeration"
        raise _error(who, number, f"{article(kind)} takes whole numbers from {low} to {high}")
    return int(number)


def _item(port: Port, value: Any, who: str) -> Any:
    """Return the value of an item that is named or numbered."""
    named = {name: number for number, name in port.items.items()}
    number = named.get(value, value) if isinstance(value, str) else value
    if port.items and number not in port.items:
        items = ", ".join(f"{key} ({name})" for key, name in port.items.items())
        raise _error(who, value, f"its items are: {items}", *named)
    return number


def _boolean(value: Any, who: str) -> bool:
    if isinstance(value, int | float | np.number) and value in (0, 1):
        return bool(value)
    if not isinstance(value, bool | str) or value not in _BOOLEANS:
        raise _error(who, value, "it must be true or false")
    return _BOOLEANS[value]


def _text(kind: str, value: Any, who: str) -> Any:
    if kind == "Binary" and isinstance(value, bytes):
        return value
    if not isinstance(value, str):
        raise _error(who, value, "it must be text")
    if kind == "String":
        if "\0" in value:
            raise _error(who, value, "text for an FMU cannot hold a zero byte")
        return value
    try:
        return bytes.fromhex(value)
    except ValueError as error:
        raise _error(who, value, "a binary is written in hexadecimal digits, two for each byte") from error


def _error(who: str, value: Any, rule: str, *choices: str) -> FmuError:
    told = f'"{value}"' if isinstance(value, str) else f"{value:g}" if isinstance(value, float) else shown(value)
    return FmuError(f'"{who}" is {told}; {rule}.', culprit=who, value=value, choices=choices)
