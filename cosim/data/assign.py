"""Which column of a file serves as which of ours: as stated, as its format fixes it, or as its name says.

A file that has our own names is taken as it is, but for a set point that has another name: without it a diagnosis
knows less. Only where a name that is needed is missing are the others' names read; what was concluded is said in a
note, and what can be read in two ways is refused with the option that decides.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosim.data import questions
from cosim.data.checks import renamed, renamed_units
from cosim.data.columns import Columns
from cosim.data.limits import short
from cosim.data.roles import counts, guess
from cosim.data.text.names import bracketed, is_unit, spelled, suffixed_unit
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


def assign(
    path: Path, found: Columns, columns: Mapping[str, str], units: Mapping[str, str], required: Sequence[str]
) -> Assigned:
    """Give columns our names.

    Args:
        path: the file, for messages.
        found: its columns.
        columns: what the user says, our name to the file's; `#3` is the third column.
        units: what the user says of units, by our name.
        required: columns that are needed, `q|v` for one of two; nothing but the time where it is empty.

    Raises:
        RecordingError: a name is not there, or a meaning is ambiguous; the message names the option that decides.
    """
    stated = {ours: numbered(theirs, found) for ours, theirs in columns.items()}
    values, had = renamed(path, found.values, stated), renamed_units(found.units, stated)
    roles = _missing(path, found, values, had, [*stated], required, units)
    sources = {**{ours: theirs for ours, theirs in stated.items()}, **roles}
    values = renamed(path, values, roles)
    had = renamed_units(had, roles)
    suffixes = {ours: suffixed_unit(theirs) for ours, theirs in sources.items() if ours not in had and ours in OURS}
    had |= {ours: text for ours, text in suffixes.items() if text}
    given = {name: spelled(text) for name, text in units.items()}
    for ours in [name for name in values if name in OURS and name not in units]:
        theirs = sources.get(ours, ours)
        text = had.get(ours) or bracketed(theirs)
        if text and not _known(text):
            raise questions.unknown_unit(path, ours, theirs, text)
    had = {name: text for name, text in had.items() if _known(text)}
    share = (had | given).get("tau", "")
    if share in SHARES:
        raise questions.share(path, sources.get("tau", "tau"), share)
    if "q" in roles and "q" not in given and counts(roles["q"], had.get("q", "")):
        raise questions.counted(path, roles["q"])
    return Assigned(
        values, had | given, {name: sources.get(name, name) for name in values}, _notes(path, roles, had | given)
    )


def _known(text: str) -> bool:
    return text == "1" or is_unit(text)


def numbered(name: str, found: Columns) -> str:
    """Return the name of a column that is given by its number, `#3`; any other as it is."""
    place = whole(name[1:]) or 0
    if name in found.values or not (name.startswith("#") and 0 < place <= len(found.values)):
        return name
    return [*found.values][place - 1]


def _missing(
    path: Path,
    found: Columns,
    values: Mapping[str, np.ndarray],
    units: Mapping[str, str],
    taken: Sequence[str],
    required: Sequence[str],
    given: Mapping[str, str],
) -> dict[str, str]:
    """Return the file's names of those of our columns that are missing."""
    lacking = [rule for rule in ("t", *required) if not any(name in values for name in rule.split("|"))]
    if lacking and found.numbered:
        raise questions.unnamed(path, found, lacking)
    free = [name for name in values if name not in taken and name not in OURS]
    roles: dict[str, str] = {}
    beside = (OPTIONAL if lacking else ALWAYS) if required else ()
    for rule in [*lacking, *(name for name in beside if name not in values)]:
        role, name = _one(path, found, rule, [name for name in free if name not in roles.values()], units, given)
        roles |= {role: name} if name else {}
    return roles


def _one(
    path: Path, found: Columns, rule: str, free: Sequence[str], units: Mapping[str, str], given: Mapping[str, str]
) -> tuple[str, str]:
    """Return which of our columns a rule asks for, and the file's name of it; an empty one where there is none."""
    names = rule.split("|")
    for role in names:
        if found.roles.get(role) in free:
            return role, found.roles[role]
        told = guess(role, free, units)
        if told.name or (told.current and len(told.among) == 1 and role in given):
            return role, told.among[0]
        if told.among and role not in OPTIONAL:
            raise questions.current(path, told) if told.current else questions.ambiguous(path, told)
    if rule in found.lacks:
        raise RecordingError(f"{path} cannot serve here: {found.lacks[rule]}.", culprit=str(path), value=rule)
    return names[0], ""


def _notes(path: Path, roles: Mapping[str, str], units: Mapping[str, str]) -> tuple[str, ...]:
    if not roles:
        return ()
    told = [f'{ours} = "{short(theirs)}"{_in(units.get(ours, ""))}' for ours, theirs in roles.items()]
    return (f"{path.stem}: by the names of its columns, {', '.join(told)}; --columns says it otherwise.",)


def _in(text: str) -> str:
    return f" in {text}" if text else ""
