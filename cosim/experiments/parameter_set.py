"""Parameter sets of SSP (SSV) in an FMU: values of its variables by name.

Reference: System Structure and Parameterization 1.0 and 2.0, chapter 6, Modelica Association.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from cosim.fmi.component import Port
from cosim.fmi.xml_member import plain, xml_in
from cosim.support.errors import FmuError, UnitError
from cosim.support.plain import Parsed
from cosim.support.units import conversion

_NUMBERS = ("Real", "Float64", "Float32")
_INTEGERS = ("Integer", *(f"{sign}Int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "U")))


def values_in(path: Path, member: str, ports: Mapping[str, Port]) -> Parsed:
    """Read a parameter set of an FMU's archive; numbers are converted to the units of the variables.

    Raises:
        FmuError: it cannot be read, or sets what the FMU does not have.
    """
    found: Parsed = {}
    for parameter in (one for one in xml_in(path, member).iter() if plain(one) == "Parameter"):
        name, kind = parameter.get("name", ""), next(iter(parameter), None)
        if name not in ports:
            text = f'{path}: {member} sets "{name}", which the FMU does not have.'
            raise FmuError(text, culprit=name, value=name, choices=tuple(ports))
        if kind is None:
            raise FmuError(f'{path}: {member} gives no value for "{name}".', culprit=name)
        found[name] = _value(path, member, ports[name], kind)
    return found


def _value(path: Path, member: str, port: Port, element: ElementTree.Element) -> Any:
    text, kind = element.get("value", ""), plain(element)
    try:
        if kind in _NUMBERS:
            gain, offset = conversion(element.get("unit", ""), port.unit)
            return gain * float(text) + offset
        if kind in _INTEGERS:
            return int(text)
    except (ValueError, UnitError) as error:
        raise FmuError(
            f'{path}: {member}: "{port.name}" = "{text}" is no {kind}: {error}.', culprit=port.name
        ) from error
    return {"true": True, "false": False}.get(text, text) if kind == "Boolean" else text
