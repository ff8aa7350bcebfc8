"""What pydantic complains about first, as one sentence: culprit, value, rule, choices."""

from collections.abc import Callable
from typing import Any

from pydantic import ValidationError

Location = tuple[int | str, ...]


def complaint(
    error: ValidationError, path: str, noun: str, keys: Callable[[Location], tuple[str, ...]]
) -> dict[str, Any]:
    """Return the arguments of an `InputError`; `keys` lists the legal keys beside a location of `noun`."""
    first = error.errors(include_url=False)[0]
    where = ".".join(str(part) for part in first["loc"]) or "the file"
    if first["type"] == "extra_forbidden":
        choices = keys(first["loc"])
        message = f'{path}: "{where}" is no key of {noun}; keys there are: {", ".join(choices)}.'
        return {"message": message, "culprit": where, "choices": choices}
    if first["type"] == "missing":
        return {"message": f'{path}: "{where}" is missing.', "culprit": where}
    value, rule = first["input"], first["msg"].removeprefix("Value error, ").rstrip(".")
    shown = "" if isinstance(value, dict | list) else f" = {value!r}"
    message = f"{path}: {where}{shown} breaks a rule: {rule[0].lower()}{rule[1:]}."
    return {"message": message, "culprit": where, "value": value}
