"""An effect on one screen: what it is, what to check at the machine, what to repair."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING

from cosim.api.show_results import Shown
from cosim.support.plain import Json

if TYPE_CHECKING:
    from pyfmi_models.effects import Effect


def effects() -> tuple[str, ...]:
    """Return the ids of all effects, also of your own."""
    return tuple(sorted(_catalogue()))


def of_effect(name: str) -> Shown:
    """Return facts and tables of an effect by its id: parameters, checks in their order, repair by kind of machine."""
    from cosim.report.repairs import MACHINES, repairs_of

    forms = _catalogue()[name]
    form = forms[0]
    first = (form.__doc__ or "").partition("\n\n")[0]
    facts = {
        "effect": name,
        "title": form.title,
        "what it is": " ".join(first.split()),
        "equation": form.equation,
        "what to do": form.action,
        "rivals": ", ".join(form.rivals),
        "how to distinguish": form.told_apart_by,
        "to record": form.to_record,
    }
    declared = {  # of an effect that has several forms, the numbers of all
        one.name: one.metadata["variable"] for form in forms for one in fields(form) if "variable" in one.metadata
    }
    rows = [{"parameter": key, "unit": v.unit, "description": v.description} for key, v in declared.items()]
    tables: dict[str, Sequence[Mapping[str, Json]]] = {"parameters": rows}
    if known := repairs_of(name):
        tables["checks"] = [
            {"check": f"{number}. {check.do}" if first else "", "result": seen, "means": means}
            for number, check in enumerate(known.checks, 1)
            for first, (seen, means) in zip((True, *[False] * len(check.results)), check.results, strict=False)
        ]
        tables["repair"] = [{"machine": MACHINES[kind], "repair": text} for kind, text in known.by_machine.items()]
    return {name: value for name, value in facts.items() if value}, tables


def _catalogue() -> "Mapping[str, Sequence[type[Effect]]]":
    from pyfmi_models import plugins
    from pyfmi_models.effects import CATALOGUE

    plugins.load()
    return CATALOGUE
