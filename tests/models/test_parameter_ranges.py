"""What friction laws and effects declare is what was promised: to cards, to other tools, to fits and to readers.

A number: low .. high, ~ the size that an FMU states as nominal, its unit, = what it is where a card says nothing;
`fixed`: never fitted to a recording; `held`: an FMU keeps it from the start of a run to its end. Behind a form stand
the number that tells how large it is and how it is treated. `promised.txt` has all of it; a change of it is a promise
changed, and a line of the changelog. Written anew:

    PYTHONPATH=tests/tools python tests/models/test_parameter_ranges.py
"""

from collections.abc import Iterator
from dataclasses import MISSING, fields
from math import inf
from pathlib import Path
from typing import Any

import pytest
from effect_examples import example

import pyfmi_models.friction
from pyfmi_models.effects import FORMS, Effect
from pyfmi_models.friction.base import FrictionLaw
from pyfmi_models.model import Variable, parameters_of

PROMISED = Path(__file__).with_name("promised.txt")
LAWS = [
    one
    for one in vars(pyfmi_models.friction).values()
    if isinstance(one, type) and issubclass(one, FrictionLaw) and hasattr(one, "key")
]
ALL: list[type] = [*LAWS, *FORMS]
MARKS = ("is_torque", "at_once", "is_determined", "in_torque", "never_negative", "unit_value", "ordered")
"""How an effect is treated: by a screening, an inverse, a fit; of learned terms what their coefficients are."""


def told(one: Variable) -> str:
    """Name, unit, and what is not as by default."""
    bounds = f" {one.low:g}..{one.high:g}" if (one.low, one.high) != (-inf, inf) else ""
    start = f" = {one.start:g}" if one.start else ""
    return f"{one.name} [{one.unit}]{start}{bounds}{f' ~{one.nominal:g}' if one.nominal != 1 else ''}"


def number(item: Any) -> str:
    """A number of a form."""
    variable, default = item.metadata["variable"], item.default
    value = "" if default is MISSING else " = None" if default is None else f" = {default:g}"
    fixed = "" if item.metadata.get("fitted") else " fixed"
    return f"{item.name} {variable.low:g}..{variable.high:g} ~{variable.nominal:g} [{variable.unit}]{value}{fixed}"


def treated(form: type[Effect]) -> Iterator[str]:
    """The main number of an effect, its marks, and the states and inputs that it brings."""
    yield f"main {getattr(form, 'main', None)}"
    yield " ".join(f"{name}={getattr(form, name)}" for name in MARKS if hasattr(form, name))
    effect = example(form)
    yield from (f"state {told(one)}" for one in effect.states())
    yield from (f"input {told(one)}" for one in effect.inputs())
    yield from (f"held {one.name}" for one in parameters_of(effect) if not one.tunable)


def declared(form: type) -> list[str]:
    """What a form declares, a line each."""
    lists = {item.name: item.metadata["structure"] for item in fields(form) if "structure" in item.metadata}
    return [
        *(number(item) for item in fields(form) if "variable" in item.metadata),
        *(f"list {name} {one.low:g}..{one.high:g}" for name, one in lists.items()),
        *(treated(form) if issubclass(form, Effect) else ()),
    ]


def promised() -> dict[str, list[str]]:
    """The lines of `promised.txt` by form."""
    found: dict[str, list[str]] = {}
    for line in PROMISED.read_text("utf-8").splitlines():
        if line.startswith(" "):
            found[list(found)[-1]].append(line.strip())
        else:
            found[line] = []
    return found


@pytest.mark.parametrize("form", ALL, ids=lambda one: one.__name__)
def test_a_form_declares_what_was_promised(form: type) -> None:
    assert declared(form) == promised().get(form.__name__, [])


def test_the_table_names_only_forms_that_there_are() -> None:
    assert set(promised()) == {one.__name__ for one in ALL}


if __name__ == "__main__":
    PROMISED.write_text("".join("\n    ".join([one.__name__, *declared(one)]) + "\n" for one in ALL), "utf-8")
