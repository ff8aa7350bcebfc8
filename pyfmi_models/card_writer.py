"""Cards as text: what a diagnosis writes, `read_card` reads back."""

import json
from datetime import date, time
from typing import Any

from pyfmi_models.card import Card, EncoderSection
from pyfmi_models.effects import Effect
from pyfmi_models.model import Pair, parameters_of, structure_of
from pyfmi_models.numbers import Table

_NUMERICAL = (("smoothing", 1e-5),)
"""Numbers of the solver, not of the machine: left out of a card while they have their default."""


def card_text(card: Card, comment: str = "") -> str:
    """Write a card as TOML; defaults that were never set are written too, so that a card says all it means."""
    lines = [f"# {line}".rstrip() for line in comment.splitlines()]
    lines += _section("mount", card.mount.model_dump())
    lines += _section("friction", {"model": card.friction.key, **_numbers(card.friction)})
    if card.unbalance:
        lines += _section("unbalance", _numbers(card.unbalance))
    if card.encoder != EncoderSection():  # nothing is known of it
        lines += _section("encoder", card.encoder.model_dump())
    if card.controller:
        lines += _section("controller", card.controller.model_dump())
    if card.columns:
        lines += _section("columns", card.columns)
    for effect in card.effects:
        lines += ["", "[[effects]]", *_pairs(effect_table(effect))]
    if card.origin:
        lines += _section("origin", card.origin)
    return "\n".join(lines).lstrip("\n") + "\n"


def effect_table(effect: Effect) -> Table:
    """Return an effect as the table that stands for it in a card."""
    return {"effect": effect.id, **_numbers(effect)}


def _numbers(part: Any) -> Table:
    names = [variable.name.split(".")[0] for variable in parameters_of(part)]
    shown = [name for name in dict.fromkeys(names) if (name, getattr(part, name)) not in _NUMERICAL]
    shaping = {name: numbers for name, numbers in structure_of(part).items() if numbers}
    return {name: getattr(part, name) for name in shown} | shaping


def _section(name: str, table: Table) -> list[str]:
    return ["", f"[{name}]", *_pairs(table)]


def _pairs(table: Table) -> list[str]:
    return [f"{_key(key)} = {_value(value)}" for key, value in table.items() if value is not None]


def _value(value: Any) -> str:
    if isinstance(value, Pair):
        return f"{{ positive = {_value(value.positive)}, negative = {_value(value.negative)} }}"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False).replace(
            "\x7f", "\\u007f"
        )  # the one character TOML escapes, JSON not
    if isinstance(value, date | time):
        return value.isoformat()
    return repr(value)


def _key(key: str) -> str:
    plain = key.replace("_", "").replace("-", "")
    return key if plain.isascii() and plain.isalnum() else json.dumps(key)
