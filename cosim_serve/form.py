"""A card written by a form: numbers with units in, TOML in SI out; each mistake is a sentence that names its field."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite

from cosim.report.repairs import MACHINES
from cosim.support.errors import InputError, UnitError
from cosim.support.units import unit

MOTIONS = {"rotary": "turns", "linear": "moves along a line"}
FRICTIONS = {
    "coulomb": "a level, and viscous friction",
    "static": "also a break-away level that falls with speed (Stribeck)",
    "lugre": "also the elastic motion before break-away",
    "none": "none that matters",
}
"""Laws that the form offers, in plain words; a card as text may name any."""
KINDS = {"": "not said", **MACHINES}
"""What moves the axis: the report names the repair for it."""


@dataclass(frozen=True)
class Field:
    """A number of a card: its key and section, what it is, its unit on a rotary and on a linear axis."""

    key: str
    section: str
    label: str
    rotary: str
    linear: str
    needed: bool = False
    laws: tuple[str, ...] = ()
    """Laws of friction that have it; () where it has nothing to do with friction."""

    @property
    def shown(self) -> str:
        """Classes by which the page shows it only beside a law that has it."""
        return " ".join(["of-law", *(f"law-{law}" for law in self.laws)]) if self.laws else ""

    def si(self, motion: str) -> str:
        """Return the unit in which the card keeps it."""
        return self.linear if motion == "linear" else self.rotary


SLIDING = ("coulomb", "static", "lugre")
"""Laws of the form that have friction while sliding."""
FIELDS = (
    Field("inertia", "mount", "Inertia, or moved mass", "kg.m2", "kg", True),
    Field("Fc", "friction", "Friction while sliding", "N.m", "N", laws=SLIDING),
    Field("sigma2", "friction", "Viscous friction per speed", "N.m.s/rad", "N.s/m", laws=SLIDING),
    Field("Fs", "friction", "Break-away friction", "N.m", "N", laws=("static", "lugre")),
    Field("Vs", "friction", "Speed at which it has fallen (Stribeck)", "rad/s", "m/s", laws=("static", "lugre")),
    Field("sigma0", "friction", "Stiffness before break-away", "N.m/rad", "N/m", laws=("lugre",)),
    Field("torque_limit", "mount", "Largest torque, or force, of the drive", "N.m", "N"),
)
LONGEST = 60
"""Characters of a value that a message repeats."""


def card_of(form: Mapping[str, str]) -> str:
    """Return the text of a card (InputError: one sentence for every field that is wrong)."""
    motion, friction = form.get("motion", "rotary"), form.get("friction", "coulomb")
    name = form.get("name", "").strip() or "axis"
    mount = [f"name = {json.dumps(name, ensure_ascii=False)}", f"motion = {json.dumps(motion)}"]
    if machine := form.get("machine", ""):
        mount.append(f"machine = {json.dumps(machine)}")
    sections: dict[str, list[str]] = {
        "mount": mount,
        "friction": [f"model = {json.dumps(friction)}"],
    }
    wrong = []
    for field in FIELDS:
        try:
            value = _value(field, form, motion)
        except InputError as error:
            wrong.append(str(error))
        else:
            sections[field.section] += [] if value is None else [f"{field.key} = {value!r}  # {field.si(motion)}"]
    if wrong:
        raise InputError(" ".join(wrong))
    return "\n".join(line for title, lines in sections.items() for line in (f"[{title}]", *lines, ""))


def _value(field: Field, form: Mapping[str, str], motion: str) -> float | None:
    """Return a number in SI, None where it is not given."""
    given, stated = form.get(field.key, "").strip(), form.get(f"{field.key}.unit", "").strip()
    if not given:
        if field.needed:
            raise InputError(f"{field.label}: it is needed, in {field.si(motion)} or another unit.", culprit=field.key)
        return None
    try:
        number = float(given.replace(",", ".") if given.count(",") == 1 and "." not in given else given)
    except ValueError:
        number = float("nan")
    if not isfinite(number):
        raise InputError(f'{field.label}: "{given[:LONGEST]}" is no number.', culprit=field.key, value=given)
    return _in_si(field, number, stated or field.si(motion), field.si(motion))


def _in_si(field: Field, number: float, stated: str, wanted: str) -> float:
    try:
        scale, si = unit(stated), unit(wanted)
    except UnitError as error:
        raise InputError(f"{field.label}: {error}", culprit=field.key, value=stated) from None
    if scale.dimension != si.dimension:
        text = f'{field.label}: "{stated[:LONGEST]}" does not fit; it is in {wanted} or a unit that becomes it.'
        raise InputError(text, culprit=field.key, value=stated)
    return float(f"{scale.factor * number / si.factor:.12g}")
