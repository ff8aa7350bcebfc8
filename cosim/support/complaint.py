"""What pydantic complains about first, as one sentence: culprit, value, rule, choices."""

from collections.abc import Callable
from typing import Any

from pydantic import ValidationError

from cosim.support.numbers import shown as display
from cosim.support.plain import Parsed

Location = tuple[int | str, ...]
RULES = {
    **dict.fromkeys(("model_type", "dict_type", "dataclass_type"), "it must be a section with keys"),
    **dict.fromkeys(("list_type", "tuple_type"), "it must be a list in square brackets"),
    "string_type": "it must be text in quotes",
    "union_tag_not_found": "it needs a {discriminator}",
    "union_tag_invalid": "{discriminator} '{tag}' is none of {expected_tags}",
    "too_short": "it needs {min_length} or more entries, not {actual_length}",
}
"""What pydantic tells in words of Python, in words of the file."""
UNKNOWN_KEY = ("extra_forbidden", "unexpected_keyword_argument")
"""What pydantic calls a key that a model, or a dataclass, does not have."""


def first_of(error: ValidationError) -> Any:
    """Return the first key that is none, if there is one: a misspelt key leaves another one missing."""
    errors = error.errors(include_url=False)
    return next((one for one in errors if one["type"] in UNKNOWN_KEY), errors[0])


def complaint(error: ValidationError, path: str, noun: str, keys: Callable[[Location], tuple[str, ...]]) -> Parsed:
    """Return the arguments of an `InputError`; `keys` lists the legal keys beside a location of `noun`."""
    first = first_of(error)
    where = ".".join(str(part) for part in first["loc"]) or "the file"
    if first["type"] in UNKNOWN_KEY:
        choices = keys(first["loc"])
        message = f'{path}: "{where}" is no key of {noun}; keys there are: {", ".join(choices)}.'
        return {"message": message, "culprit": where, "choices": choices}
    if first["type"] == "missing":
        return {"message": f'{path}: "{where}" is missing.', "culprit": where}
    value, rule = first["input"], _rule(first)
    shown = "" if isinstance(value, dict | list) else f" = {display(value)}"
    message = f"{path}: {where}{shown} breaks a rule: {rule[0].lower()}{rule[1:]}."
    return {"message": message, "culprit": where, "value": value}


def _rule(first: Any) -> str:
    """The rule that is broken, in words of the file."""
    told = RULES.get(first["type"], "").format(**first.get("ctx", {}))
    return told or str(first["msg"]).removeprefix("Value error, ").rstrip(".")
