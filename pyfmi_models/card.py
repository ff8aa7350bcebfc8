"""Model cards: what a mount is, as data.

A card is TOML (see `cards/` for examples). Only `[mount] inertia` and `[friction]` are required. `read_card` checks
everything and names file, key, value and rule; `Card.plant` and `Card.controller_model` make the equations.
"""

import tomllib
from collections.abc import Collection
from dataclasses import MISSING, dataclass, field, fields
from dataclasses import Field as Declared
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args

from pydantic import Field, ValidationError

from pyfmi_models import plugins
from pyfmi_models.controller_section import ControllerSection, Section, compose
from pyfmi_models.effects import CATALOGUE, Effect, GravityUnbalance
from pyfmi_models.errors import CardError
from pyfmi_models.friction import LAWS, FrictionLaw
from pyfmi_models.model import Model, Pair, Variable
from pyfmi_models.mount import Axis, Mount
from pyfmi_models.near import did_you_mean
from pyfmi_models.numbers import LARGEST, LARGEST_GIVEN, LEAST, LONGEST_NAME, MOST_COUNTS, Table, parsed, shown

Part = TypeVar("Part")


MachineKind = Literal["rotary_table", "ball_screw", "belt", "harmonic_drive", "direct_drive", "hydraulic"]
"""What moves the axis; a report names the repair for it."""


class MountSection(Section):
    """`[mount]`: name, motion, inertia [kg m2 or kg], torque limit [N m or N], kind of machine (None: not said)."""

    name: str = Field(default="mount", max_length=LONGEST_NAME)
    motion: Literal["rotary", "linear"] = "rotary"
    inertia: float = Field(ge=LEAST, le=LARGEST_GIVEN)
    torque_limit: float = Field(default=1e6, ge=LEAST, le=LARGEST_GIVEN)
    machine: MachineKind | None = None


class EncoderSection(Section):
    """`[encoder]`: counts per turn (0: not known), white noise RMS [rad, m], encoder turns per axis turn.

    Firmware and virtual drive count by them; the noise is a note for people: no calculation reads it.
    """

    counts_per_rev: float = Field(default=0.0, ge=0, le=MOST_COUNTS)
    noise_rms: float = Field(default=0.0, ge=0, le=LARGEST_GIVEN)
    ratio: float = Field(default=1.0, ge=LEAST, le=LARGEST_GIVEN)


class _Card(Section):
    mount: MountSection
    friction: Table
    unbalance: Table | None = None
    encoder: EncoderSection = EncoderSection()
    controller: ControllerSection | None = None
    columns: dict[str, str] = Field(default_factory=dict)
    effects: list[Table] = Field(default_factory=list)
    origin: Table = Field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Card:
    """A checked card: sections as numbers, friction and effects as objects.

    `believed` is the friction that the controller compensates, where it is not the card's.
    """

    path: str
    mount: MountSection
    friction: FrictionLaw
    unbalance: GravityUnbalance | None = None
    effects: tuple[Effect, ...] = ()
    encoder: EncoderSection = field(default_factory=EncoderSection)
    controller: ControllerSection | None = None
    believed: FrictionLaw | None = None
    columns: dict[str, str] = field(default_factory=dict)
    origin: Table = field(default_factory=dict)

    def plant(self) -> Mount:
        """Make the plant: the base, the known load, the effects."""
        known = (self.unbalance,) if self.unbalance else ()
        axis = Axis(inertia=self.mount.inertia, torque_limit=self.mount.torque_limit)
        return Mount(
            name=_identifier(self.mount.name),
            axis=axis,
            friction=self.friction,
            effects=(*known, *self.effects),
            motion=self.mount.motion,
        )

    def remarks(self) -> tuple[str, ...]:
        """Say what is legal in this card but should be known; the report of a diagnosis and `cosim show` print it."""
        broken = self.plant().law.broken_passivity()
        meaning = "Some fast motions would take more energy from the friction than they gave (it is not passive)"
        return (f'[friction]: {broken}. {meaning}; model = "lugre_passive" without Vd has none.',) if broken else ()

    def controller_model(self) -> Model:
        """Make the controller; the card must have a `[controller]` section."""
        if self.controller is None:
            raise CardError(f"{self.path}: there is no [controller] section, so there is no controller to export.")
        adrc = compose(
            name=_identifier(self.mount.name),
            section=self.controller,
            inertia=self.mount.inertia,
            limit=self.mount.torque_limit,
            law=self.believed or self.friction,
            path=self.path,
        )
        return self.plant().model_in_axis_units(adrc.model())


def read_card(source: str | Path) -> Card:
    """Read a card from a file, or by the name of a shipped one; raise `CardError` with one sentence if it is bad."""
    path = Path(source)
    shipped = files("pyfmi_models") / "cards" / f"{source}.toml"
    try:
        text = path.read_text("utf-8") if path.is_file() or not shipped.is_file() else shipped.read_text("utf-8")
    except IsADirectoryError:
        raise CardError(f"{source} is a folder, not a card.") from None
    except OSError:
        names = shipped_cards()
        meant = did_you_mean(str(source), names)
        raise CardError(f"{source}: no such card. Shipped cards are: {', '.join(names)}.{meant}") from None
    except UnicodeDecodeError:
        raise CardError(f"{source} is not a card: it is not UTF-8 text.") from None
    return parse_card(text, str(source))


def shipped_cards() -> list[str]:
    """Return the names of the cards that come with the package."""
    return sorted(p.name.removesuffix(".toml") for p in (files("pyfmi_models") / "cards").iterdir())


def parse_card(text: str, path: str) -> Card:
    """Check the text of a card; `path` is its name in errors."""
    plugins.load()
    try:
        raw = _Card.model_validate(parsed(text))
    except tomllib.TOMLDecodeError as error:
        raise CardError(f"{path} is not valid TOML: {error}.") from None
    except ValidationError as error:
        raise CardError(f"{path}: {_sentence(error)}") from None
    known, believed = raw.unbalance, raw.controller.friction if raw.controller else None
    return Card(
        path=path,
        mount=raw.mount,
        friction=_friction(dict(raw.friction), f"{path}: [friction]"),
        unbalance=None if known is None else _build(GravityUnbalance, dict(known), f"{path}: [unbalance]"),
        effects=tuple(_effect(dict(table), path, index) for index, table in enumerate(raw.effects)),
        encoder=raw.encoder,
        controller=raw.controller,
        believed=None if believed is None else _friction(dict(believed), f"{path}: [controller.friction]"),
        columns=raw.columns,
        origin=raw.origin,
    )


RULES = {
    "model_type": "it must be a section with keys",
    "dict_type": "it must be a section with keys",
    "string_type": "it must be text in quotes",
}
"""What pydantic tells in words of Python, in words of the card."""


def _sentence(error: ValidationError) -> str:
    errors = error.errors()  # a misspelt key comes first: it leaves another one missing
    first = next((one for one in errors if one["type"] == "extra_forbidden"), errors[0])
    *section, key = [str(part) for part in first["loc"]]
    where = f"[{'.'.join(section)}] {key}" if section else f"[{key}]"
    if first["type"] == "extra_forbidden":
        return f"{where} is not a key of a card{_there(section, key)}"
    if first["type"] == "missing":
        return f"{where} is missing."
    if first["type"] == "list_type" and key == "effects":
        return '[effects] is one table; write [[effects]] above each effect, and in it effect = "cogging" or another.'
    rule = RULES.get(first["type"]) or first["msg"][:1].lower() + first["msg"][1:]
    return f"{where} = {shown(first['input'])} breaks the rule: {rule}."


def _there(section: list[str], key: str) -> str:
    """List the keys that a section has, and the one that may have been meant."""
    part: Any = _Card
    for name in section:
        part = part.model_fields[name].annotation if name in part.model_fields else None
        part = next(
            (one for one in (part, *get_args(part)) if isinstance(one, type) and issubclass(one, Section)), None
        )
        if part is None:
            return "."
    keys = tuple(part.model_fields)
    return f"; keys are: {', '.join(keys)}.{did_you_mean(key, keys)}"


def _friction(table: Table, where: str) -> FrictionLaw:
    key = _word(table, "model", LAWS, where)
    # A card says "no Stribeck term" by Fs = Fc; the law says it by having no Fs, so that a fit of Fc cannot make one.
    if "Fs" in _keys(LAWS[key]) and "Fs" in table and table["Fs"] == table.get("Fc"):
        table = {name: value for name, value in table.items() if name not in ("Fs", "Vs")}
    return _build(LAWS[key], table, where)


def _effect(table: Table, path: str, index: int) -> Effect:
    where = f"{path}: [[effects]] number {index + 1}"
    name = _word(table, "effect", CATALOGUE, f"{where}:")
    form = max(CATALOGUE[name], key=lambda form: len(set(table) & set(_keys(form))))
    effect = _build(form, table, f"{where} ({name})")
    if effect.broken_rule():
        raise CardError(f"{where} ({name}): {effect.broken_rule()}.")
    return effect


def _word(table: Table, key: str, choices: Collection[str], where: str) -> str:
    """Take the word that says which law or effect a table is."""
    word, listed = table.pop(key, None), ", ".join(choices)
    if word is None:
        raise CardError(f"{where} {key} is missing; {key}s are: {listed}.")
    if not isinstance(word, str) or word not in choices:
        raise CardError(f"{where} {key} = {word!r} is unknown; {key}s are: {listed}.{did_you_mean(str(word), choices)}")
    return word


def _keys(part: type[Any]) -> dict[str, Declared[Any]]:
    return {item.name: item for item in fields(part) if item.metadata}


def _build(part: type[Part], table: Table, where: str) -> Part:
    keys = _keys(part)
    for key, value in table.items():
        if key not in keys:
            raise CardError(
                f'{where}: "{key}" is not a key here; keys are: {", ".join(keys)}.{did_you_mean(key, keys)}'
            )
        table[key] = _value(value, keys[key], issubclass(part, FrictionLaw), f"{where}: {key}")
    for one, other, meaning in (("Fs", "Vs", "speed over which friction falls"), ("Vs", "Fs", "level at rest")):
        if one in table and other in keys and other not in table:
            raise CardError(f"{where}: {one} needs {other}, the {meaning}.")
    missing = [key for key, item in keys.items() if key not in table and item.default is MISSING]
    if missing:
        raise CardError(f"{where}: {missing[0]} is missing.")
    return part(**table)


def _value(value: Any, item: Declared[Any], by_direction: bool, where: str) -> Any:
    """Check one value: what shapes the equations (a word, a list of numbers), a pair by direction, or a number."""
    if "word" in item.metadata:
        if not isinstance(value, str):
            raise CardError(f"{where} = {shown(value)} is not a text.")
        return value
    if "structure" in item.metadata:
        if not isinstance(value, list):
            raise CardError(f"{where} = {shown(value)} is not a list of numbers.")
        return tuple(_number(one, item.metadata["structure"], f"{where}[{k}]") for k, one in enumerate(value, 1))
    return (_number_or_pair if by_direction else _number)(value, item.metadata["variable"], where)


def _number_or_pair(value: Any, variable: Variable, where: str) -> float | Pair:
    if isinstance(value, dict):
        if set(value) != set(Pair._fields):
            raise CardError(f"{where} = {shown(value)} is no pair; a pair is {{ positive = ..., negative = ... }}.")
        return Pair(**{side: _number(value[side], variable, f"{where}.{side}") for side in Pair._fields})
    return _number(value, variable, where)


def _number(value: Any, variable: Variable, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < LARGEST:
        raise CardError(f"{where} = {shown(value)} is not a number.")
    if not variable.low <= value <= variable.high:
        raise CardError(f"{where} = {value:g} is outside {variable.low:g} .. {variable.high:g}.")
    return float(value)


def _identifier(name: str) -> str:
    clean = "".join(c if c.isascii() and c.isalnum() else "_" for c in name) or "mount"
    return f"_{clean}" if clean[0].isdigit() else clean
