"""Which column of a file serves as which of ours: as stated, as its format fixes it, or as its name says.

A file that has our own names is taken as it is, but for a set point that has another name: without it a diagnosis
knows less. Only where a name that is needed is missing are the others' names read; what was concluded is said in a
note, and what can be read in two ways is refused with the option that decides.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cosim.data import questions
from cosim.data.checks import renamed, renamed_units
from cosim.data.columns import Columns, Request
from cosim.data.limits import short
from cosim.data.roles import counts, guess, suits
from cosim.data.text.names import bracketed, unit_of_name
from cosim.data.text.unit_words import contradict, is_known, spelled
from cosim.support.errors import RecordingError
from cosim.support.numbers import whole

OPTIONAL = ("q_d", "temperature")
"""Columns that are looked for where names have to be read anyway ..."""
ALWAYS = OPTIONAL[:1]
"""... and where they have not."""
SHARES = ("%", "0.1 %", "count", "counts")
"""Units of a torque that say how much only together with the rated torque of the motor."""
OURS = ("t", "tau", "q", "v", *OPTIONAL)
"""Names of our columns."""


@dataclass(frozen=True)
class Assigned:
    """Columns under our names, the units stated for them, the names they have in the file, and what was concluded."""

    values: dict[str, np.ndarray]
    units: dict[str, str]
    sources: dict[str, str]
    notes: tuple[str, ...] = ()


def assign(request: Request, found: Columns) -> Assigned:
    """Give the columns of a file our names.

    Raises:
        RecordingError: a name is not there, or a meaning is ambiguous; the message names the option that decides.
    """
    path = request.path
    stated = {ours: numbered(theirs, found) for ours, theirs in request.columns.items()}
    named = {name: units_stated(found, name) for name in found.values}
    values, had = renamed(path, found.values, stated), renamed_units(named, stated)
    roles = _missing(request, found, values, had, [*stated])
    sources = stated | roles
    values = renamed(path, values, roles)
    given = {name: spelled(text) for name, text in request.units.items()}
    had = renamed_units({name: text for name, text in found.units.items() if is_known(text)}, stated | roles)
    for ours in [name for name in values if name in OURS and name not in given]:
        text = _unit_of(path, found, ours, sources.get(ours, ours))
        had |= {ours: text} if text else {}
    for ours in [name for name in ("tau", "q", "v") if name in values]:
        _check_scaled(path, ours, sources.get(ours, ours), (had | given).get(ours, ""), ours in given, ours in roles)
    return Assigned(
        values, had | given, {name: sources.get(name, name) for name in values}, _notes(path, roles, had | given)
    )


def units_stated(found: Columns, name: str, role: str = "") -> str:
    """Return the unit that a file states for a column, beside it or in its name; empty where it states none."""
    beside = found.units.get(name, "")
    return beside if is_known(beside) else unit_of_name(name, role) or beside


def _unit_of(path: Path, found: Columns, ours: str, theirs: str) -> str:
    """Return the unit of one of our columns as the file states it.

    Raises:
        UndecidedError: it is not known, or two places of the file state different ones.
    """
    beside, named = found.units.get(theirs, ""), unit_of_name(theirs, ours)
    both = found.contradictions.get(theirs) or (named, beside)
    if all(map(is_known, both)) and both[0] != "1" != both[1] and contradict(*both):
        raise questions.two_units(path, found, ours, theirs, both)
    text = units_stated(found, theirs, ours) or bracketed(theirs)
    if text and not (is_known(text) and (ours != "t" or text == "1" or suits("t", text))):
        raise questions.unknown_unit(path, ours, theirs, text)
    return text


def _check_scaled(path: Path, ours: str, theirs: str, text: str, given: bool, guessed: bool) -> None:
    """Ask how much one unit of a column is that says it only together with a number of the machine's."""
    if ours == "tau" and text in SHARES:
        raise questions.share(path, theirs, text)
    if given:
        return
    if ours != "tau" and (guessed or text) and counts(theirs, text):
        raise questions.counted(path, ours, theirs)
    if guessed and not suits(ours, text):
        raise questions.scaled(path, ours, theirs, text)


def numbered(name: str, found: Columns) -> str:
    """Return the name of a column that is given by its number, `#3`; any other as it is."""
    place = whole(name[1:]) or 0
    if name in found.values or not (name.startswith("#") and 0 < place <= len(found.values)):
        return name
    return [*found.values][place - 1]


def _missing(
    request: Request, found: Columns, values: Mapping[str, np.ndarray], units: Mapping[str, str], taken: Sequence[str]
) -> dict[str, str]:
    """Return the file's names of those of our columns that are missing."""
    path, required = request.path, request.required
    lacking = [rule for rule in ("t", *required) if not any(name in values for name in rule.split("|"))]
    free = [name for name in values if name not in taken and name not in OURS]
    if lacking and found.numbered and questions.may_serve(found, lacking, free):
        raise questions.unnamed(path, found, lacking, free)
    roles: dict[str, str] = {}
    beside = (OPTIONAL if lacking else ALWAYS) if required else ()
    for rule in [*lacking, *(name for name in beside if name not in values)]:
        role, name = _one(request, found, rule, [name for name in free if name not in roles.values()], units)
        roles |= {role: name} if name else {}
    return roles


def _one(request: Request, found: Columns, rule: str, free: Sequence[str], units: Mapping[str, str]) -> tuple[str, str]:
    """Return which of our columns a rule asks for, and the file's name of it; an empty one where there is none."""
    path, names = request.path, rule.split("|")
    for role in names:
        if found.roles.get(role) in free:
            return role, found.roles[role]
        guessed = guess(role, free, units)
        if role == "t" and len(guessed.among) > 1:
            growing = tuple(name for name in guessed.among if questions.grows(found.values[name]))
            guessed = replace(guessed, among=growing or guessed.among)
        if guessed.name or (guessed.current and len(guessed.among) == 1 and role in request.units):
            return role, guessed.among[0]
        if guessed.among and role not in OPTIONAL:
            raise questions.current(path, guessed) if guessed.current else questions.ambiguous(path, found, guessed)
    if rule in found.lacks:
        raise RecordingError(f"{path} cannot serve here: {found.lacks[rule]}.", culprit=str(path), value=rule)
    return names[0], ""


def _notes(path: Path, roles: Mapping[str, str], units: Mapping[str, str]) -> tuple[str, ...]:
    if not roles:
        return ()
    scale = {ours: f" in {units[ours]}" if units.get(ours) else "" for ours in roles}
    named = [f'{ours} = "{short(theirs)}"{scale[ours]}' for ours, theirs in roles.items()]
    return (f"{path.stem}: by the names of its columns, {', '.join(named)}; --columns says it otherwise.",)
