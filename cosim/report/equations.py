"""What the catalogues say to a reader of the report: of effects by the id of a finding, of the base by a full name."""

from collections.abc import Iterator
from dataclasses import fields
from math import inf
from typing import Any

from pyfmi_models.assembly import LINEAR_UNITS, Axis
from pyfmi_models.effects import CATALOGUE, Effect
from pyfmi_models.friction import LAWS
from pyfmi_models.model import Variable


def equation(effect: str) -> str:
    """The equation; an effect torque resists. Empty for what is no effect."""
    return _form(effect).equation


def least(effect: str, parameter: str) -> float:
    """The least value that a parameter of an effect may have; of what is no effect, any."""
    return next((one.low for one in _declared(_form(effect), parameter)), -inf)


def base_unit(parameter: str, motion: str) -> str:
    """The unit of a number of the base, `axis.inertia` or `friction.Fc.positive`; empty where none is known."""
    group, name, *_ = [*parameter.split("."), ""]
    parts = (Axis,) if group == "axis" else LAWS.values()
    unit = next((one.unit for part in parts for one in _declared(part, name)), "")
    return LINEAR_UNITS.get(unit, unit) if motion == "linear" else unit


def _declared(part: Any, name: str) -> Iterator[Variable]:
    """What a class of parts declares of the parameter of this name, if it has one."""
    return (item.metadata["variable"] for item in fields(part) if item.name == name and "variable" in item.metadata)


def _form(effect: str) -> type[Effect]:
    return CATALOGUE.get(effect, (Effect,))[0]
