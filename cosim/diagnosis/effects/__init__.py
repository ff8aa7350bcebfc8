"""Hypotheses: for each effect what a diagnosis must know to ask recordings for it, one file an effect.

The folder is searched, so a new file is all that a new hypothesis needs; `base.py` is the contract.
"""

from collections.abc import Collection
from typing import Any

from cosim.diagnosis.effects.base import Hypothesis
from cosim.diagnosis.effects.candidates import Candidate, span_of
from cosim.estimation.prepare import Array, Prepared
from pyfmi_models import plugins
from pyfmi_models.discovery import classes_in
from pyfmi_models.effects import Effect
from pyfmi_models.mount import Mount

HYPOTHESES: list[Hypothesis[Any]] = []
"""All that a diagnosis looks for, in the order in which it does."""
TRIED: list[str] = []
"""Effects that a diagnosis can name; the catalogue holds more, for cards and FMUs."""
_OF_FORM: dict[type[Effect], Hypothesis[Any]] = {}
_NAMED: dict[str, Hypothesis[Any]] = {}
_NONE = Hypothesis[Any]()


def _take(*kinds: type[Hypothesis[Any]]) -> None:
    """Take hypotheses into the tables, in place, as others hold them; one that is defined anew replaces the old one."""
    kept = [one for one in HYPOTHESES if not any(plugins.is_again(kind, type(one)) for kind in kinds)]
    HYPOTHESES[:] = sorted([*kept, *(kind() for kind in kinds)], key=lambda one: one.rank)
    TRIED[:] = dict.fromkeys(form.id for one in HYPOTHESES for form in one.forms)
    _OF_FORM.update({form: one for one in HYPOTHESES for form in one.forms})
    _NAMED.update({form.id: one for one in reversed(HYPOTHESES) for form in one.forms})


_take(*classes_in(__name__, __path__, Hypothesis, "forms"))
plugins.follow(Hypothesis, "forms", _take)


def hypothesis_of(effect: Effect) -> Hypothesis[Any]:
    """The hypothesis that proposes effects of this form; one that proposes nothing where a card alone may hold it."""
    return _OF_FORM.get(type(effect), _NONE)


def named(effect: str) -> Hypothesis[Any]:
    """The first hypothesis of an effect by its id or name; one that proposes nothing for an id that is none."""
    return _NAMED.get(effect.partition(":")[0], _NONE)


def candidates(
    mount: Mount, prepared: Prepared, residual: Array, level: Array, only: Collection[str] = TRIED
) -> list[Candidate]:
    """List what is worth trying of `only` these effects, given the torque residual at the kept rows."""
    span = span_of(mount, prepared, residual, level)
    usable = [one for one in HYPOTHESES if prepared.has_position or not one.needs_position]
    usable = [one for one in usable if one.may_come(mount)]
    asked = [one for one in usable if {form.id for form in one.forms} & set(only)]
    found = [candidate for one in asked for candidate in one.candidates(mount, span)]
    return [candidate for candidate in found if candidate.effect in only]
