"""A closed form in the place of a learned table, as a diagnosis knows it; who finds one is plugged in.

An entry point of the group `cosim.formulas` names a function that is called once for each learned effect:

    (mount with it, effect, fit of the base, comparison, held-out recordings) -> ClosedForm or None
"""

from collections.abc import Callable
from typing import Protocol

from cosim.diagnosis.answer.entries import FormulaEntry
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.estimation.fit import Fit
from cosim.support.plugins import loaded, names
from pyfmi_models.effects.learned_base import LearnedEffect
from pyfmi_models.mount import Mount

GROUP = "cosim.formulas"


class ClosedForm(Protocol):
    """A formula of one learned effect: what is said of it, and the file of an effect that it would be."""

    @property
    def id(self) -> str:
        """Id of the effect, and name of its file."""

    def as_json(self) -> FormulaEntry:
        """Return what `diagnosis.json` holds of it under `learned.formula`."""

    def text(self, statement: str) -> str:
        """Return the file; `statement` is what the diagnosis says of the learned term, with its errors."""


Search = Callable[[Mount, LearnedEffect, Fit, Comparison, Predictive], ClosedForm | None]


def searches() -> tuple[Search, ...]:
    """What is installed that looks for closed forms (raises PlugInError: one of them cannot be imported)."""
    return tuple(loaded(GROUP, name) for name in names(GROUP))


def closed_form(
    learned: Mount, effect: LearnedEffect, found: Fit, comparison: Comparison, held: Predictive
) -> ClosedForm | None:
    """The first closed form that a search finds; None where none is as good, or nothing that searches is installed."""
    forms = (search(learned, effect, found, comparison, held) for search in searches())
    return next((form for form in forms if form), None)
